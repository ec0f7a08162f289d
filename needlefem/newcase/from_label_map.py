"""Drafts of cases from label maps: the plane of the needle and the contours of segments in it."""

import csv
import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import cast

import numpy as np
from scipy import ndimage

from needlefem._arrays import Floats, Ints, Points, Vector
from needlefem._toml import brief, quoted
from needlefem.errors import CaseError, nearest
from needlefem.geometry.contour import Contour
from needlefem.geometry.image_frame import ImageFrame, Voxels
from needlefem.image.labelmap import LabelMap, Segment, read_labelmap
from needlefem.newcase.box import Box, TargetLine, box_around, box_draft, with_room
from needlefem.newcase.draft import (
    CaseRequest,
    Draft,
    different,
    direction_of,
    file_names,
    millimetres,
    planning_text,
    point_of,
    point_text,
)

SMOOTHING = 1.2
"""Standard deviation of the smoothing filter, in the longest side of a voxel."""
THINNEST = 0.25
"""Largest deviation of the filter relative to the radius of the largest ball in a segment."""
REACH = 4.0
"""Radius of the filter in standard deviations."""
STEPS = 2.0
"""Samples in the plane per shortest side of a voxel."""
NEAR = 1.5
"""Distance of a contour from the edge of the image below which the image cuts it, voxels."""
SIDES = (("right", "left"), ("anterior", "posterior"), ("inferior", "superior"))
"""Negative and positive anatomical direction of each axis of LPS."""
LEAST = 4.0
"""Smallest area of an island that is kept, in squares of the shortest side of a voxel."""


def needle_plane(
    voxels: Voxels, space: str, target: Vector, direction: Vector, across: Vector | None = None
) -> ImageFrame:
    """Return the plane that contains the needle, with its point (0, 0) at the target.

    Parameters
    ----------
    voxels : Voxels
    space : str
        Coordinate system of all coordinates: ``LPS`` or ``RAS``.
    target : array, shape (3,), m
    direction : array, shape (3,)
        Direction of the needle, which is the second axis of the case.
    across : array, shape (3,), optional
        Second direction of the plane, made normal to the needle: the first axis of the case. By
        default, the voxel axis that is nearest to a right angle with the needle; if several are
        equal, the one with the smallest voxel side.

    Raises
    ------
    CaseError
        The direction is zero, or `across` is parallel to it.
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
        problem = f"{[float(x) for x in across]} is parallel to the needle"
        raise CaseError("--across", problem, "give a direction across the needle")
    side = side / np.linalg.norm(side)
    axes = tuple(tuple(float(x) + 0.0 for x in axis) for axis in (side, along))
    origin = tuple(float(x) for x in target)
    return ImageFrame(space=space, origin=origin, axes=axes, voxels=voxels)


@dataclasses.dataclass(frozen=True, eq=False)
class Outlines:
    """Contours of a segment in a plane.

    Parameters
    ----------
    contours : list of Contour
        One per part, the largest first; holes are filled.
    dropped : int
        Number of islands that are too small or are removed by the filter.
    holes : int
        Number of filled holes.
    """

    contours: list[Contour]
    dropped: int
    holes: int


def outlines(labelmap: LabelMap, segment: Segment, frame: ImageFrame) -> Outlines:
    """Return the contours of a segment in a plane.

    The segment is smoothed by a Gaussian filter as wide as a voxel (`SMOOTHING`) where it is thick
    enough (`THINNEST`). It is sampled in the plane, and marching squares return the contour at the
    level that encloses the volume of the voxels, so that the filter does not shrink the segment.
    The distance between vertices is that of the finest voxel side.
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
    """Return one sentence for each side at which the image cuts the segment.

    There the contours follow the edge of the image, unless the plane does not contain this side.
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
                "its contour follows the edge of the image there instead of its surface"
                if met
                else "its contour in this plane is not affected"
            )
            found.append(
                f"The image cuts {brief(segment.name)} at its {side} side "
                f"({'ijk'[axis]} = {number}): {outline}."
            )
    return found


def _side(direction: Vector, space: str) -> str:
    """Return the side of the body that a direction in the scanner's space points to."""
    towards = direction * (np.array([1.0, 1.0, 1.0]) if space == "LPS" else [-1.0, -1.0, 1.0])
    axis = int(np.argmax(np.abs(towards)))
    return SIDES[axis][int(towards[axis] > 0.0)]


def _smoothed(labelmap: LabelMap, segment: Segment) -> tuple[Floats, Floats, float, Floats]:
    """Return a segment, its smoothed field, the level of its surface, and its first voxel."""
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
    """Return contours at a level, the largest first, and the numbers of small ones and of holes."""
    from contourpy import contour_generator  # noqa: PLC0415  (only label maps need it)

    lines = contour_generator(y, z, values, fill_type="OuterOffset")
    filled = lines.filled(level, float(values.max()) + 1.0)
    found = cast(tuple[list[Floats], list[Ints]], filled)  # by its type of filling
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
    """Return vertices on a closed polygon with distances of about `spacing`, at least eight."""
    ring = points if np.array_equal(points[0], points[-1]) else np.vstack([points, points[:1]])
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(ring, axis=0), axis=1))])
    count = max(8, round(along[-1] / spacing))
    at = along[-1] * np.arange(count) / count
    return np.stack([np.interp(at, along, ring[:, i]) for i in range(2)], axis=1)


# A draft from a label map: the plane of the needle.


INTO = np.array([0.0, 1.0])
"""Direction of the needle in the case: its second axis."""


def of_labelmap(path: Path, wanted: CaseRequest) -> Draft:
    """Return the draft for a label map: the plane of the needle, and one region per segment.

    The first axis of the case is across the needle, the second along it, from the skin. The skin
    is at the entry, or where the needle enters the image.

    Raises
    ------
    CaseError
        The file can't be read, target or direction are missing or not possible, the plane
        contains no segment, or a segment extends beyond the skin.
    """
    labelmap = read_labelmap(path, wanted.space)
    segments = _chosen(labelmap, wanted.segments)
    target = _target(labelmap, wanted.target)
    direction, depth = _line(labelmap, target, wanted)
    across = direction_of(wanted.across, 3, "--across") if wanted.across else None
    frame = needle_plane(labelmap.voxels, wanted.space, target, direction, across)
    cut, remarks = _regions(labelmap, segments, frame)
    _check_skin(cut, depth)
    corner = np.array([box_around(cut, wanted.around, np.zeros(2)).low[0], -depth])
    frame = dataclasses.replace(frame, origin=tuple(float(x) for x in frame.to_scanner(corner)))
    contours = {name: contour.moved(-corner) for name, contour in cut.items()}
    line = TargetLine(-corner, INTO, depth)
    box = box_around(contours, wanted.around, line.target)
    box = with_room(Box(np.zeros(2), box.high), line)
    remedy = "check the spacing of the voxels, --target and --margin, or use fewer --segments"
    finest = min(labelmap.voxels.spacing)
    mesh = box_draft(box, contours, finest, line, key="--labelmap", remedy=remedy)
    files = file_names(contours)
    skin = "at the entry" if wanted.entry else "where the needle enters the image (or give --entry)"
    return Draft(
        title=f"{path.name.partition('.')[0]}: {', '.join(s.name for s in segments)}",
        file=path.name,
        axes=("y", "z"),
        remarks=(
            "y is the coordinate across the needle, z the depth from the skin; the skin is flat,",
            f"{skin}. Contours are smoothed; where regions overlap, the last one applies.",
            *labelmap.remarks,
            *remarks,
        ),
        mesh=mesh.text(),
        regions={
            name: f"contour = {quoted(files[name])}{mesh.own_size(name)}" for name in contours
        },
        faces=("y_min", "y_max", "z_min (the skin)", "z_max"),
        direction="[0.0, 1.0]",
        max_depth=millimetres(line.max_depth),
        target=point_text(line.target),
        planning=planning_text(line.sideways),
        frame=frame,
        contours={files[name]: contour for name, contour in contours.items()},
    )


def _chosen(labelmap: LabelMap, names: str) -> list[Segment]:
    known = {segment.name: segment for segment in labelmap.segments}
    if not names:
        return list(known.values())
    found = []
    wanted = [names] if names in known else next(csv.reader([names], skipinitialspace=True))
    for name in (part if part in known else part.strip() for part in wanted):
        if name not in known:
            raise CaseError("--segments", f"no segment '{name}'", nearest(name, known))
        found.append(known[name])
    return found


def _target(labelmap: LabelMap, text: str) -> Vector:
    """Return the target in the scanner's space, shape (3,), m: a point, or a segment's centre."""
    known = {segment.name: segment for segment in labelmap.segments}
    if text in known:
        return labelmap.centre(known[text])
    if not text:
        remedy = f"give a point ('12, -3.5, 40 mm') or a segment: {', '.join(known)}"
        raise CaseError("--target", "missing", remedy)
    if "," not in text:
        raise CaseError("--target", f"no segment '{text}'", nearest(text, known))
    return point_of(text, 3, "--target")


def _line(labelmap: LabelMap, target: Vector, wanted: CaseRequest) -> tuple[Vector, float]:
    """Return the direction of the needle, and the depth of the target below the skin, m."""
    if wanted.entry:
        away = target - point_of(wanted.entry, 3, "--entry")
        if not np.any(away):
            raise CaseError("--entry", f"'{wanted.entry}' is the target", "give a point of skin")
        return away / np.linalg.norm(away), float(np.linalg.norm(away))
    if not wanted.direction:
        remedy = "give a direction ('0, 0.2, 1'), or a point of the skin by --entry"
        raise CaseError("--direction", "missing", remedy)
    direction = direction_of(wanted.direction, 3, "--direction")
    voxels = labelmap.voxels
    at = voxels.numbers(target[None])[0]
    step = voxels.numbers((target + direction)[None])[0] - at
    low, high = np.full(3, -0.5), np.array(voxels.size) - 0.5
    if np.any(at < low) or np.any(at > high):
        place = ", ".join(f"{1e3 * x:.4g}" for x in target)
        problem = f"({place}) mm in {labelmap.space} is outside the image"
        raise CaseError("--target", problem, "correct it, or --space")
    with np.errstate(divide="ignore", invalid="ignore"):
        travel = np.where(step > 0, (at - low) / step, (at - high) / step)
    return direction, float(np.min(travel[step != 0]))


def _regions(
    labelmap: LabelMap, segments: list[Segment], frame: ImageFrame
) -> tuple[dict[str, Contour], list[str]]:
    """Return contours by region, enclosing regions first, and comments on them."""
    found: dict[str, Contour] = {}
    remarks = []
    for segment in segments:
        cut, name = outlines(labelmap, segment, frame), brief(segment.name)
        if not cut.contours:
            remarks.append(f"The plane does not contain {name}.")
        if cut.dropped:
            remarks.append(f"Islands of {name} that are too small: {cut.dropped}.")
        if cut.holes:
            remarks.append(f"Holes in {name}, filled unless a later region is there: {cut.holes}.")
        remarks += cut_sides(labelmap, segment, frame, cut)
        others = {other.name for other in segments if other is not segment}
        for contour in cut.contours:
            found[different(segment.name, {*found, *others})] = contour
    if not found:
        names = ", ".join(segment.name for segment in segments)
        problem = f"the plane of the needle contains none of {names}"
        raise CaseError("--target", problem, "move the target, or rotate the plane by --across")
    return dict(sorted(found.items(), key=lambda item: -item[1].area)), remarks


def _check_skin(contours: Mapping[str, Contour], depth: float) -> None:
    for name, contour in contours.items():
        out = -depth - float(contour.points[:, 1].min())
        if out > 0.0:
            problem = f"segment '{brief(name)}' extends {1e3 * out:.2g} mm beyond the skin"
            raise CaseError("--entry", problem, "move the entry outwards, or omit it in --segments")
