"""A case from a mesh file with named groups."""

import os
from pathlib import Path

import numpy as np

from needlefem._toml import quoted
from needlefem.casefile.openkeys import OPEN
from needlefem.mesh.cell_map import cell_measures, is_simplicial
from needlefem.mesh.file import read_plane_mesh
from needlefem.mesh.generation import BACKGROUND
from needlefem.newcase.draft import Draft, numbers_text, point_text
from needlefem.newcase.from_contours import UNKNOWN
from needlefem.newcase.request import CaseRequest, direction_of, point_of


def of_mesh(path: Path, folder: Path, wanted: CaseRequest) -> Draft:
    """Return the case that a mesh file begins.

    Every group of cells is a region, and the rest is the background: the cells without a group,
    or the largest group where every cell has one.

    Raises
    ------
    CaseError
        The file can't be read, or its mesh can't be used.
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
        remarks.append("Groups share cells: a cell belongs to the last of its regions below.")
    if found.axes != ("x", "y"):
        remarks.append(f"The mesh lies in the {''.join(found.axes)}-plane of the file.")
    low, high = mesh.p.min(axis=1), mesh.p.max(axis=1)
    span = " to ".join("(" + ", ".join(f"{x:g}" for x in corner) + ")" for corner in (low, high))
    lines = [
        "[mesh]",
        f"file = {quoted(Path(os.path.relpath(path, folder)).as_posix())}",
        f"unit = {quoted(wanted.unit or OPEN)}                     # the file goes from {span}",
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
    """Return the material outside all regions, and a sentence on it.

    Parameters
    ----------
    order : list of str
        Groups, the largest first.
    without : int
        How many cells are in no group.
    """
    if not order:
        return BACKGROUND, ["The file names no group of cells: all of them are the background."]
    if not without:
        return order[0], [f"The largest group, {order[0]}, is the background."]
    return BACKGROUND, [f"The {without} cells in no group are the background."]
