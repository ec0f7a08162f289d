"""Results in files: JSON records, result folders, VTU histories for ParaView.

What is written here can be read again, and compared with the expectations of a case. Files are
written whole or not at all.
"""

from typing import TYPE_CHECKING

from needlefem._exports import lazy_exports

if TYPE_CHECKING:
    from needlefem.io.expectations import compare, look_up
    from needlefem.io.records import insertion_record, plan_record
    from needlefem.io.result_folder import to_json, whole_file, write_json
    from needlefem.io.saved_result import SavedResult, load_result
    from needlefem.io.vtu import History, Recording, recorded, recorded_states, write_pvd, write_vtu

__all__ = [
    "History",
    "Recording",
    "SavedResult",
    "compare",
    "insertion_record",
    "load_result",
    "look_up",
    "plan_record",
    "recorded",
    "recorded_states",
    "to_json",
    "whole_file",
    "write_json",
    "write_pvd",
    "write_vtu",
]

if not TYPE_CHECKING:
    __getattr__, __dir__ = lazy_exports(
        __name__,
        expectations="compare look_up",
        records="insertion_record plan_record",
        result_folder="to_json whole_file write_json",
        saved_result="SavedResult load_result",
        vtu="History Recording recorded recorded_states write_pvd write_vtu",
    )
