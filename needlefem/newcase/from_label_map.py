"""A case from a label map: the plane of the needle, cut out of it."""

import csv
import dataclasses
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from needlefem._arrays import Vector
from needlefem._toml import brief, quoted
from needlefem.errors import CaseError, nearest
from needlefem.geometry.contour import Contour
from needlefem.geometry.image_frame import ImageFrame
from needlefem.image.labelmap import LabelMap, Segment, read_labelmap
from needlefem.newcase.box import Box, TargetLine, box_around, box_draft, with_room
from needlefem.newcase.draft import Draft, millimetres, planning_text, point_text
from needlefem.newcase.names import different, file_names
from needlefem.newcase.request import CaseRequest, direction_of, point_of
from needlefem.newcase.slicing import cut_sides, needle_plane, outlines

INTO = np.array([0.0, 1.0])
"""Direction of the needle in the case: along its second axis."""


def of_labelmap(path: Path, wanted: CaseRequest) -> Draft:
    """Return the case that a label map begins: the plane of the needle, a region a segment.

    The case's first axis lies across the needle, its second along it from the skin on. The skin
    is at the entry, or where the needle enters the image.

    Raises
    ------
    CaseError
        The file can't be read; target or direction are missing or can't be; the plane meets no
        segment, or a segment reaches out of the skin.
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
    remedy = "check the spacing of the voxels, --target and --margin, or take fewer --segments"
    finest = min(labelmap.voxels.spacing)
    mesh = box_draft(box, contours, finest, line, key="--labelmap", remedy=remedy)
    files = file_names(contours)
    skin = "at the entry" if wanted.entry else "where the needle enters the image (or give --entry)"
    return Draft(
        title=f"{path.name.partition('.')[0]}: {', '.join(s.name for s in segments)}",
        file=path.name,
        axes=("y", "z"),
        remarks=(
            "y is across the needle, z the depth along it, from the skin on; the skin is flat,",
            f"{skin}. Outlines are smoothed; of overlapping regions the later wins.",
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
    """Return the needle's direction and the depth of the target below the skin, m."""
    if wanted.entry:
        away = target - point_of(wanted.entry, 3, "--entry")
        if not np.any(away):
            raise CaseError("--entry", f"'{wanted.entry}' is the target", "give a point of skin")
        return away / np.linalg.norm(away), float(np.linalg.norm(away))
    if not wanted.direction:
        remedy = "give it ('0, 0.2, 1'), or a point of the skin by --entry"
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
    """Return contours by region, those that enclose others first, and what there is to say."""
    found: dict[str, Contour] = {}
    remarks = []
    for segment in segments:
        cut, name = outlines(labelmap, segment, frame), brief(segment.name)
        if not cut.contours:
            remarks.append(f"The plane does not meet {name}.")
        if cut.dropped:
            remarks.append(f"Islands of {name} too small to keep: {cut.dropped}.")
        if cut.holes:
            remarks.append(f"Holes in {name}, filled unless a later region is there: {cut.holes}.")
        remarks += cut_sides(labelmap, segment, frame, cut)
        others = {other.name for other in segments if other is not segment}
        for contour in cut.contours:
            found[different(segment.name, {*found, *others})] = contour
    if not found:
        names = ", ".join(segment.name for segment in segments)
        problem = f"the plane of the needle meets none of {names}"
        raise CaseError("--target", problem, "move it, or turn the plane by --across")
    return dict(sorted(found.items(), key=lambda item: -item[1].area)), remarks


def _check_skin(contours: Mapping[str, Contour], depth: float) -> None:
    for name, contour in contours.items():
        out = -depth - float(contour.points[:, 1].min())
        if out > 0.0:
            problem = f"segment '{brief(name)}' reaches {1e3 * out:.2g} mm out of the skin"
            raise CaseError("--entry", problem, "move it out, or leave it away by --segments")
