"""Drafts of cases from contour files and from mesh files."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from needlefem._arrays import Vector
from needlefem._inputfile import require_file
from needlefem._toml import brief, quoted
from needlefem.casefile.contourfile import ContourTable, read_table
from needlefem.casefile.reader import OPEN
from needlefem.errors import CaseError
from needlefem.geometry.contour import Contour
from needlefem.mesh.cell_map import cell_measures, is_simplicial
from needlefem.mesh.file import read_plane_mesh
from needlefem.mesh.generation import BACKGROUND
from needlefem.newcase.box import Box, TargetLine, box_around, box_draft, with_room
from needlefem.newcase.draft import (
    CaseRequest,
    Draft,
    different,
    direction_of,
    file_names,
    millimetres,
    numbers_text,
    planning_text,
    point_of,
    point_text,
)
from needlefem.units import parse_quantity

UNKNOWN = f'"{OPEN}"'
UNNAMED = ("y", "z")
"""Names of the axes for files whose columns have no names."""
FINEST = 0.5e-3
"""Smallest element size along a contour, m, if no voxel size is known."""


def of_contours(paths: Sequence[Path], folder: Path, wanted: CaseRequest) -> Draft:
    """Return the draft for contour files: a box around them, and one region per file.

    The coordinates are those of the files. The skin contains the entry; without an entry it is
    placed at a margin before the contours. `folder` is that of the case; contour files in this
    folder are not copied.

    Raises
    ------
    CaseError
        A file can't be read or is given twice, files have different axes, or a contour
        extends beyond the skin.
    """
    sources = _sources(paths)
    tables = {name: read_table(path, "--contour") for name, path in sources.items()}
    axes = next((table.names for table in tables.values() if table.names), UNNAMED)
    unit = parse_quantity(wanted.unit, "length", "--unit") if wanted.unit else None
    contours = {name: table.contour("--contour", axes, unit) for name, table in tables.items()}
    contours = dict(sorted(contours.items(), key=lambda item: -item[1].area))
    target = point_of(wanted.target, 2, "--target") if wanted.target else None
    entry = point_of(wanted.entry, 2, "--entry") if wanted.entry else None
    direction = _direction(wanted, target, entry)
    points = [point for point in (target, entry) if point is not None]
    box = box_around(contours, wanted.around, *points)
    if entry is not None and direction is not None:
        box = _behind(box, contours, entry, direction)
    line = None
    if target is not None and direction is not None:
        line = TargetLine(target, direction, box.depth_of(target, direction))
        box = with_room(box, line)
    remedy = f"check units, --margin, --target and {_farthest(contours)}"
    mesh = box_draft(box, contours, FINEST, line, key="--contour", remedy=remedy)
    files = _files(sources, folder)
    return Draft(
        title=paths[0].stem,
        file=", ".join(path.name for path in paths),
        axes=axes,
        remarks=_remarks(wanted, axes, box, direction, contours),
        mesh=mesh.text(),
        regions={
            name: _contour_text(files[name], tables[name], wanted.unit, _is_in(path, folder))
            + mesh.own_size(name)
            for name, path in ((name, sources[name]) for name in contours)
        },
        faces=tuple(f"{axis}_{end}" for axis in axes for end in ("min", "max")),
        direction=UNKNOWN if direction is None else numbers_text(direction),
        max_depth=UNKNOWN if line is None else millimetres(line.max_depth),
        target=UNKNOWN if target is None else point_text(target),
        planning=planning_text(line.sideways) if line is not None else "",
        contours={files[name]: contour for name, contour in contours.items()},
    )


def _sources(paths: Sequence[Path]) -> dict[str, Path]:
    """Return the files by the names of their regions."""
    found: dict[str, Path] = {}
    for path in paths:
        require_file(path, "--contour", remedy="give a CSV file")
        if path.resolve() in [other.resolve() for other in found.values()]:
            raise CaseError("--contour", f"'{path}' is given twice", "give a file once")
        found[different(path.stem, found)] = path
    return found


def _is_in(path: Path, folder: Path) -> bool:
    """Return whether a file is in the folder of the case with a name that TOML can contain."""
    try:
        path.name.encode()
    except UnicodeEncodeError:
        return False
    return path.resolve().parent == Path(os.path.realpath(folder))  # safe for circular links


def _files(sources: Mapping[str, Path], folder: Path) -> dict[str, str]:
    """Return the names of contour files by region; files in the folder keep their names."""
    staying = {name: path.name for name, path in sources.items() if _is_in(path, folder)}
    rest = [name for name in sources if name not in staying]
    return staying | file_names(rest, taken=staying.values())


def _direction(wanted: CaseRequest, target: Vector | None, entry: Vector | None) -> Vector | None:
    if entry is None:
        return direction_of(wanted.direction, 2, "--direction") if wanted.direction else None
    if target is None:
        raise CaseError("--target", "missing", "the needle's line goes from --entry to --target")
    away = target - entry
    if not np.any(away):
        raise CaseError("--entry", f"'{wanted.entry}' is the target", "give a point of the skin")
    return np.asarray(away / np.linalg.norm(away))


def _face(direction: Vector) -> tuple[int, bool]:
    """Return the axis of the face where the needle enters, and whether it is the lower face."""
    axis = int(np.argmax(np.abs(direction)))
    return axis, bool(direction[axis] > 0.0)


def _behind(box: Box, contours: Mapping[str, Contour], entry: Vector, direction: Vector) -> Box:
    """Return the box with the entry on its entry face."""
    axis, lower = _face(direction)
    low, high = box.low.copy(), box.high.copy()
    (low if lower else high)[axis] = entry[axis]
    for name, contour in contours.items():
        along = contour.points[:, axis]
        out = float(entry[axis] - along.min() if lower else along.max() - entry[axis])
        if out > 0.0:
            problem = f"contour '{brief(name)}' extends {1e3 * out:.2g} mm beyond the skin"
            raise CaseError("--entry", problem, "move the entry outwards, or omit the contour")
    return Box(low, high)


def _farthest(contours: Mapping[str, Contour]) -> str:
    """Return the name and the position of the vertex with the largest distance to the others."""
    points = np.vstack([contour.points for contour in contours.values()])
    away = np.linalg.norm(points - np.median(points, axis=0), axis=1)
    name, number = [
        (name, number)
        for name, contour in contours.items()
        for number in range(len(contour.points))
    ][int(np.argmax(away))]
    place = ", ".join(f"{x:.4g}" for x in contours[name].points[number])
    return f"the most distant vertex, {number + 1} of '{brief(name)}' at ({place}) m"


def _remarks(
    wanted: CaseRequest,
    axes: Sequence[str],
    box: Box,
    direction: Vector | None,
    contours: Mapping[str, Contour],
) -> tuple[str, ...]:
    """Return comments on the box and on the depths for the reader of the case."""
    plain = "Coordinates are those of the files; plan and run print the depths as well."
    if direction is None:
        return (
            f"The tissue is a box, {wanted.margin} around the contours; its faces are skin.", plain
        )  # fmt: skip
    axis, lower = _face(direction)
    at = float(box.low[axis] if lower else box.high[axis])
    face = f"{axes[axis]}_{'min' if lower else 'max'}"
    where = f"the face {face} of the box, at {axes[axis]} = {1e3 * at:.6g} mm"
    if wanted.entry:
        skin = f"The skin is {where}, which contains the entry."
    else:
        skin = f"The skin is {where}, {wanted.margin} before the contours (or give --entry)."
    straight = bool(np.count_nonzero(direction) == 1)
    if straight and at == 0.0 and lower:
        depth = f"The depth below the skin is {axes[axis]}."
    elif straight:
        sign = f"{axes[axis]} - {1e3 * at:.6g} mm" if lower else f"{1e3 * at:.6g} mm - {axes[axis]}"
        depth = f"The depth below the skin is {sign}. {plain}"
    else:
        depth = f"Depths are measured along the needle from the skin. {plain}"
    touching = [
        f"Contour {brief(name)} touches the skin."
        for name, contour in contours.items()
        if abs(box.gap(contour)) < 1e-9
    ]
    return (skin, depth, *touching)


def _contour_text(file: str, table: ContourTable, unit: str, stays: bool) -> str:
    """Return the keys of a region; the unit is added for a file that has none and is not copied."""
    line = f"contour = {quoted(file)}"
    if not stays or all(column.factor is not None for column in table.columns):
        return line
    return f"{line}\nunit = {quoted(unit)}"


# A draft from a mesh file with named groups.


def of_mesh(path: Path, folder: Path, wanted: CaseRequest) -> Draft:
    """Return the draft for a mesh file.

    Each group of cells is a region. The background consists of the cells without a group, or of
    the largest group if every cell is in a group.

    Raises
    ------
    CaseError
        The file can't be read, or its mesh is not valid.
    """
    found = read_plane_mesh(path, 1.0, "--mesh")
    mesh = found.mesh
    groups = mesh.subdomains or {}
    measures = cell_measures(mesh)
    areas = {name: float(np.sum(measures[cells])) for name, cells in groups.items()}
    order = sorted(areas, key=lambda name: -areas[name])
    count = np.zeros(mesh.nelements, dtype=np.intp)
    for cells in groups.values():
        count[cells] += 1
    background, remarks = _background(order, int(np.count_nonzero(count == 0)))
    regions = [name for name in order if name != background or not np.all(count)]
    covered = [np.zeros(mesh.nelements, dtype=bool) for _ in regions]
    for mask, name in zip(covered, regions, strict=True):
        mask[groups[name]] = True
    if any(np.any(one & two) for k, one in enumerate(covered) for two in covered[:k]):
        remarks.append("Groups share cells; a cell belongs to the last of its regions below.")
    if found.axes != ("x", "y"):
        remarks.append(f"The mesh lies in the {''.join(found.axes)}-plane of the file.")
    low, high = mesh.p.min(axis=1), mesh.p.max(axis=1)
    span = " to ".join("(" + ", ".join(f"{x:g}" for x in corner) + ")" for corner in (low, high))
    lines = [
        "[mesh]",
        f"file = {quoted(Path(os.path.relpath(path, folder)).as_posix())}",
        f"unit = {quoted(wanted.unit or OPEN)}                     # coordinates from {span}",
        f'cell = "{"triangle" if is_simplicial(mesh) else "quadrilateral"}"',
    ]
    target, direction = wanted.target, wanted.direction
    return Draft(
        title=path.stem,
        file=path.name,
        axes=("y", "z") if found.axes == ("x", "y") else found.axes,
        remarks=(*remarks, *found.notes, *found.repairs),
        mesh="\n".join(lines),
        regions={name: f"group = {quoted(name)}" for name in regions},
        background=background,
        faces=tuple(sorted(mesh.boundaries or {})),
        direction=numbers_text(direction_of(direction, 2, "--direction")) if direction else UNKNOWN,
        max_depth=UNKNOWN,
        target=point_text(point_of(target, 2, "--target")) if target else UNKNOWN,
    )


def _background(order: list[str], without: int) -> tuple[str, list[str]]:
    """Return the material outside of all regions, and a sentence about it.

    Parameters
    ----------
    order : list of str
        Groups by decreasing size.
    without : int
        Number of cells without a group.
    """
    if not order:
        return BACKGROUND, ["The file names no group of cells; all cells are the background."]
    if not without:
        return order[0], [f"The largest group, {order[0]}, is the background."]
    return BACKGROUND, [f"The {without} cells without a group are the background."]
