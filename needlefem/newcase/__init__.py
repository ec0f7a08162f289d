"""First cases from anatomy in files: contours, label maps, meshes.

A draft is a case file as far as it can be written from the anatomy; what only the user knows is
left open in it. ``needlefem new`` writes drafts.
"""

from typing import TYPE_CHECKING

from needlefem._exports import lazy_exports

if TYPE_CHECKING:
    from needlefem.newcase.draft import CaseRequest, Draft, case_text, csv_text
    from needlefem.newcase.from_contours import of_contours, of_mesh
    from needlefem.newcase.from_label_map import of_labelmap

__all__ = ["CaseRequest", "Draft", "case_text", "csv_text", "of_contours", "of_labelmap", "of_mesh"]

if not TYPE_CHECKING:
    __getattr__, __dir__ = lazy_exports(
        __name__,
        draft="CaseRequest Draft case_text csv_text",
        from_contours="of_contours of_mesh",
        from_label_map="of_labelmap",
    )
