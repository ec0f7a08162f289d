"""Label maps of scanners: NRRD, NIfTI and MetaImage files, read without further packages.

Other formats need SimpleITK. A label map says which voxels belong to which segment and where the
voxels are in the patient.
"""

from typing import TYPE_CHECKING

from needlefem._exports import lazy_exports

if TYPE_CHECKING:
    from needlefem.image.labelmap import LabelMap, Segment, read_labelmap

__all__ = ["LabelMap", "Segment", "read_labelmap"]

if not TYPE_CHECKING:
    __getattr__, __dir__ = lazy_exports(
        __name__,
        labelmap="LabelMap Segment read_labelmap",
    )
