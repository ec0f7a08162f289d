"""The plane in which a needle moves, and the outlines of segments in it."""

import dataclasses
from typing import Any

import numpy as np
from scipy import ndimage

from needlefem._arrays import Floats, Points, Vector
from needlefem._toml import brief
from needlefem.errors import CaseError
from needlefem.geometry.contour import Contour
from needlefem.geometry.image_frame import ImageFrame, Voxels
from needlefem.image.labelmap import LabelMap, Segment

SMOOTHING = 1.2
"""Standard deviation of the filter that takes the steps out of a segment, coarsest voxel sides."""
THINNEST = 0.25
"""The most that the filter's deviation may be, of the radius of the largest ball in a segment."""
REACH = 4.0
"""Where the filter ends, standard deviations."""
STEPS = 2.0
"""Samples in the plane per shortest side of a voxel."""
NEAR = 1.5
"""How near an outline comes to the image's edge where the image cuts it, voxels."""
SIDES = (("right", "left"), ("anterior", "posterior"), ("inferior", "superior"))
"""By the axes of LPS: where their negative and their positive direction go."""
LEAST = 4.0
"""Area of the smallest island that is kept, squares of the shortest side of a voxel."""


def needle_plane(
    voxels: Voxels, space: str, target: Vector, direction: Vector, across: Vector | None = None
) -> ImageFrame:
    """Return the plane through the needle, its point (0, 0) at the target.

    Parameters
    ----------
    voxels : Voxels
    space : str
        Of all coordinates: ``LPS`` or ``RAS``.
    target : array, shape (3,), m
    direction : array, shape (3,)
        Of the needle: the case's second axis.
    across : array, shape (3,), optional
        What the plane contains beside the needle: the case's first axis, made normal to it. When
        left out, the voxels' axis nearest to a right angle with the needle (of equal ones the
        finest).

    Raises
    ------
    CaseError
        The direction has no length, or `across` is along it.
    """
    length = np.linalg.norm(direction)
    if not length > 0.0:
        raise CaseError("--direction", f"{list(direction)} has no length", "give 3 numbers")
    along = direction / length
    if across is None:
        own = np.array(voxels.axes)
        across = own[np.lexsort((voxels.spacing, np.round(np.abs(own @ along), 6)))[0]]
    side = across - (across @ along) * along
    if np.linalg.norm(side) < 1e-6 * np.linalg.norm(across) or not np.any(across):
        problem = f"{[float(x) for x in across]} is along the needle"
        raise CaseError("--across", problem, "give a direction across it")
    side = side / np.linalg.norm(side)
    axes = tuple(tuple(float(x) + 0.0 for x in axis) for axis in (side, along))
    origin = tuple(float(x) for x in target)
    return ImageFrame(space=space, origin=origin, axes=axes, voxels=voxels)


@dataclasses.dataclass(frozen=True, eq=False)
class Outlines:
    """What a plane cuts out of a segment.

    Parameters
    ----------
    contours : list of Contour
        One for every part, the largest first; holes are filled.
    dropped : int
        Islands too small for a contour, or lost in the filter.
    holes : int
        Holes that were filled.
    """

    contours: list[Contour]
    dropped: int
    holes: int


def outlines(labelmap: LabelMap, segment: Segment, frame: ImageFrame) -> Outlines:
    """Return a segment's outlines in a plane.

    The segment is smoothed by a Gaussian as wide as its steps are high (`SMOOTHING`) where it is
    thick enough (`THINNEST`), sampled in the plane, and outlined by marching squares at the level
    that encloses the volume of its voxels, so that the filter does not shrink it. Corners are as
    far apart as voxels at their finest.
    """
    part, smooth, level, start = _smoothed(labelmap, segment)
    y, z = _ticks(labelmap.voxels, smooth.shape, start, frame)
    if not len(y) or not len(z):
        return Outlines([], 0, 0)
    places = np.stack(np.meshgrid(y, z), axis=-1)
    numbers = labelmap.voxels.numbers(frame.to_scanner(places.reshape(-1, 2))) - start
    shape, at = places.shape[:2], numbers[:, ::-1].T
    sampled = ndimage.map_coordinates(smooth, at, order=1).reshape(shape)
    contours, small, holes = _rings(y, z, sampled, level, min(labelmap.voxels.spacing))
    bodies = ndimage.label(part, np.ones((3, 3, 3)))[0]
    met = ndimage.map_coordinates(bodies, at, order=0).reshape(shape)
    lost = np.setdiff1d(met, met[sampled > level])
    return Outlines(contours, small + int(np.count_nonzero(lost)), holes)


def cut_sides(labelmap: LabelMap, segment: Segment, frame: ImageFrame, cut: Outlines) -> list[str]:
    """Return a sentence for every side of the image at which it cuts a segment off.

    The outlines in the plane then follow the image's edge there, or are not concerned.
    """
    mask, voxels = labelmap.mask(segment), labelmap.voxels
    numbers = [voxels.numbers(frame.to_scanner(c.points)) for c in cut.contours]
    found = []
    for axis, count in enumerate(voxels.size):
        slices = np.moveaxis(mask, 2 - axis, 0)
        for number, end in ((0, -1.0), (count - 1, 1.0)):
            if not np.any(slices[number]):
                continue
            edge = number + 0.5 * end
            met = any(bool(np.any(np.abs(n[:, axis] - edge) < NEAR)) for n in numbers)
            if count == 1 and not met:
                continue
            side = _side(end * np.array(voxels.axes[axis]), labelmap.space)
            outline = (
                "its outline follows the image's edge there, not its own surface"
                if met
                else "its outline in this plane is not concerned"
            )
            found.append(
                f"The image cuts {brief(segment.name)} off at its {side} side "
                f"({'ijk'[axis]} = {number}): {outline}."
            )
    return found


def _side(direction: Vector, space: str) -> str:
    """Return the side of the body to which a direction of the scanner's space points most."""
    towards = direction * (np.array([1.0, 1.0, 1.0]) if space == "LPS" else [-1.0, -1.0, 1.0])
    axis = int(np.argmax(np.abs(towards)))
    return SIDES[axis][int(towards[axis] > 0.0)]


def _smoothed(labelmap: LabelMap, segment: Segment) -> tuple[Floats, Floats, float, Floats]:
    """Return a segment, the same smoothed, its edge's level, and its first voxel's (i, j, k)."""
    mask = labelmap.mask(segment)
    box = ndimage.find_objects(mask.astype(np.int8))[0]
    sides = np.array(labelmap.voxels.spacing)[::-1]
    ball = float(ndimage.distance_transform_edt(np.pad(mask[box], 1), sampling=sides).max())
    deviation = min(SMOOTHING * sides.max(), THINNEST * ball) / sides
    margin = np.ceil(REACH * deviation).astype(int) + 1
    part = np.pad(mask[box].astype(float), [(m, m) for m in margin])
    smooth: Floats = ndimage.gaussian_filter(part, deviation, truncate=REACH)
    inside = np.count_nonzero(part)
    ordered = np.sort(smooth, axis=None)[::-1]
    level = 0.5 * float(ordered[inside - 1] + ordered[inside])
    start = np.array([edge.start for edge in box[::-1]], dtype=float) - margin[::-1]
    return part, smooth, level, start


def _ticks(
    voxels: Voxels, shape: tuple[int, ...], start: Floats, frame: ImageFrame
) -> tuple[Floats, Floats]:
    """Return samples along both axes of the plane that cover a block of voxels."""
    corners = np.array(np.meshgrid(*[(0, n - 1) for n in shape[::-1]])).reshape(3, -1).T
    points = voxels.points(corners + start)
    off = frame.off_plane(points)
    if off.min() > 0.0 or off.max() < 0.0:
        return np.empty(0), np.empty(0)
    step = min(voxels.spacing) / STEPS
    plane = frame.from_scanner(points)
    low, high = plane.min(axis=0), plane.max(axis=0)
    ticks = [step * np.arange(np.floor(a / step), np.ceil(b / step) + 1) for a, b in zip(
        low, high, strict=True)]  # fmt: skip
    return ticks[0], ticks[1]


def _rings(
    y: Floats, z: Floats, values: Floats, level: float, spacing: float
) -> tuple[list[Contour], int, int]:
    """Return lines around a level, the largest first, how many are too small, and the holes."""
    from contourpy import contour_generator  # noqa: PLC0415  (only a label map needs it)

    lines = contour_generator(y, z, values, fill_type="OuterOffset")
    found: Any = lines.filled(level, float(values.max()) + 1.0)
    contours, small, holes = [], 0, 0
    for polygon, offset in zip(*found, strict=True):
        outer = np.asarray(polygon[: offset[1]], dtype=float)
        holes += len(offset) - 2
        if Contour(outer).area < LEAST * spacing**2:
            small += 1
        else:
            contours.append(Contour(evenly(outer, spacing)))
    contours.sort(key=lambda contour: -contour.area)
    return contours, small, holes


def evenly(points: Points, spacing: float) -> Points:
    """Return corners along a closed polygon, about `spacing` apart and at least eight."""
    ring = points if np.array_equal(points[0], points[-1]) else np.vstack([points, points[:1]])
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(ring, axis=0), axis=1))])
    count = max(8, round(along[-1] / spacing))
    at = along[-1] * np.arange(count) / count
    return np.stack([np.interp(at, along, ring[:, i]) for i in range(2)], axis=1)
