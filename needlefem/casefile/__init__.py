"""Case files: a scene with its expectations, read from TOML, contours and meshes.

Everything is checked when a case is loaded; a `CaseError` names the key, the value and the
remedy.
"""

from typing import TYPE_CHECKING

from needlefem._exports import lazy_exports

if TYPE_CHECKING:
    from needlefem.casefile.contourfile import ContourTable, read_contour, read_table
    from needlefem.casefile.load import SavedCase, load_case, read_again, read_scene

__all__ = [
    "ContourTable",
    "SavedCase",
    "load_case",
    "read_again",
    "read_contour",
    "read_scene",
    "read_table",
]

if not TYPE_CHECKING:
    __getattr__, __dir__ = lazy_exports(
        __name__,
        contourfile="ContourTable read_contour read_table",
        load="SavedCase load_case read_again read_scene",
    )
