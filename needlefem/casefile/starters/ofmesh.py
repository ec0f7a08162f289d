"""A case from a mesh file with named groups."""

import os
from pathlib import Path

import numpy as np

from needlefem.casefile.openkeys import OPEN
from needlefem.casefile.starters.draft import Draft, numbers_text, point_text
from needlefem.casefile.starters.wanted import Wanted, direction_of, point_of
from needlefem.errors import CaseError
from needlefem.fem.cellmap import cell_measures, is_simplicial
from needlefem.fem.meshfile import read_mesh
from needlefem.tomltext import quoted

UNKNOWN = f'"{OPEN}"'


def of_mesh(path: Path, folder: Path, wanted: Wanted) -> Draft:
    """Return the case that a mesh file begins: a region for every group but the largest.

    Raises
    ------
    CaseError
        The file can't be read, or names no group of cells.
    """
    mesh = read_mesh(path, 1.0)
    groups = mesh.subdomains or {}
    if not groups:
        remedy = "save physical groups with it, or begin from contours"
        raise CaseError("--mesh", f"'{path.name}' names no group of cells", remedy)
    measures = cell_measures(mesh)
    areas = {name: float(np.sum(measures[cells])) for name, cells in groups.items()}
    order = sorted(areas, key=lambda name: -areas[name])
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
        axes=("y", "z"),
        remarks=(f"The largest group, {order[0]}, is the background.",),
        mesh="\n".join(lines),
        regions={name: f"group = {quoted(name)}" for name in order[1:]},
        background=order[0],
        faces=tuple(sorted(mesh.boundaries or {})),
        direction=numbers_text(direction_of(direction, 2, "--direction")) if direction else UNKNOWN,
        max_depth=UNKNOWN,
        target=point_text(point_of(target, 2, "--target")) if target else UNKNOWN,
    )
