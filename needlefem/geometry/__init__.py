"""Closed contours in the plane of a scene, and the frame that places this plane in an image.

All coordinates are in metres, in the order of the scene's axes.
"""

from typing import TYPE_CHECKING

from needlefem._exports import lazy_exports

if TYPE_CHECKING:
    from needlefem.geometry.contour import Contour
    from needlefem.geometry.image_frame import ImageFrame, Voxels

__all__ = ["Contour", "ImageFrame", "Voxels"]

if not TYPE_CHECKING:
    __getattr__, __dir__ = lazy_exports(
        __name__,
        contour="Contour",
        image_frame="ImageFrame Voxels",
    )
