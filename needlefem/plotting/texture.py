"""An image mapped on the tissue, which deforms with it: an ultrasound slice, or one made up.

The image covers the box around the undeformed tissue as pictures show it: its right side is
where the needle comes from, up is lateral.
"""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import gaussian_filter

from needlefem._arrays import Floats, Ints, Points
from needlefem._inputfile import require_file
from needlefem.errors import CaseError
from needlefem.fem.tissue_model import TissueModel
from needlefem.needle.insertion_axis import InsertionAxis
from needlefem.plotting.backend import renderer
from needlefem.plotting.canvas import Canvas
from needlefem.scene import Scene

PIXEL = 0.15e-3
"""Of a synthetic image, m."""
SPECKLE = (0.22e-3, 0.4e-3)
"""Size of a speckle along the beam and across it (standard deviations), m."""
RANGE = 45.0
"""Range of echoes that is shown, dB."""
CHUNK = 20_000
"""Pixels whose distance to a contour is found at once."""
RIM = 0.5e-3
"""Thickness of the bright rim of a region, m."""
ECHO = (0.0, -8.0, -4.0, -11.0)
"""Mean echo of the background and of the regions, in the order of their names, dB."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Texture:
    """A grey image on the tissue.

    Parameters
    ----------
    grey : array, shape (rows, columns)
        0 to 255, first row on top.
    note : str
        Written into the picture: what is not measured must say so.
    """

    grey: Ints
    note: str = ""

    def image(self) -> Any:
        """Return it as a PyVista texture."""
        rgb = np.repeat(self.grey.astype(np.uint8)[:, :, None], 3, axis=2)
        found = renderer().Texture(rgb)
        found.interpolate = True
        return found

    @staticmethod
    def coordinates(canvas: Canvas, points: Points) -> Floats:
        """Return where the tissue's points lie in the image, shape (n, 2), 0 to 1."""
        at = canvas.screen(points)[:, :2]
        found: Floats = (at - at.min(axis=0)) / np.ptp(at, axis=0)
        return found


def read_texture(path: str | Path) -> Texture:
    """Read an image of the undeformed tissue from a file that Pillow knows.

    Raises
    ------
    CaseError
        It can't be read.
    """
    require_file(path, "texture", remedy="give a PNG, JPEG or TIFF file")
    from PIL import Image, UnidentifiedImageError  # noqa: PLC0415  (comes with the pictures)

    try:
        with Image.open(path) as image:
            return Texture(grey=np.asarray(image.convert("L"), dtype=np.intp))
    except (OSError, UnidentifiedImageError) as error:
        remedy = "give a PNG, JPEG or TIFF file"
        raise CaseError("texture", f"'{path}' can't be read ({error})", remedy) from None


def synthetic_ultrasound(
    scene: Scene, model: TissueModel, axis: InsertionAxis, seed: int = 2003
) -> Texture:
    """Return made-up ultrasound of plane tissue: speckle, darker regions with bright rims.

    Speckle is the size of a sum of many random echoes under the beam's point spread (complex
    Gaussian noise, smoothed; J. W. Goodman 1976), shown in dB.
    """
    corners = np.stack([-axis.direction, axis.lateral_directions[0]], axis=1)
    at = model.mesh.p.T @ corners
    low, high = at.min(axis=0), at.max(axis=0)
    columns, rows = (max(int(n), 8) for n in np.ceil((high - low) / PIXEL))
    x, y = np.meshgrid(np.linspace(low[0], high[0], columns), np.linspace(high[1], low[1], rows))
    points = np.column_stack([x.ravel(), y.ravel()]) @ corners.T
    random = np.random.default_rng(seed)
    sizes = [size / PIXEL for size in SPECKLE]
    echoes = [gaussian_filter(random.standard_normal((rows, columns)), sizes) for _ in range(2)]
    size = np.hypot(*echoes)
    decibels = 20.0 * np.log10(size / size.mean() + 1e-6) + _mean_echo(scene, points).reshape(
        x.shape
    )
    grey = np.clip((decibels + 0.72 * RANGE) / RANGE, 0.0, 1.0)
    return Texture(grey=np.round(255.0 * grey).astype(np.intp), note="ultrasound image: synthetic")


def _mean_echo(scene: Scene, points: Floats) -> Floats:
    """Return the mean echo at points of the world, dB."""
    found = np.full(len(points), ECHO[0])
    for number, region in enumerate(scene.regions.values(), start=1):
        found[region.contour.contains(points)] = ECHO[1 + (number - 1) % (len(ECHO) - 1)]
    for region in scene.regions.values():
        parts = np.array_split(points, 1 + len(points) // CHUNK)
        near = np.concatenate([region.contour.distance(part) for part in parts])
        found += 9.0 * np.exp(-((near / RIM) ** 2))
    return found
