"""A case from contour files."""

import dataclasses
from collections.abc import Collection, Sequence
from pathlib import Path

import numpy as np

from needlefem.casefile.contourfile import ContourTable, read_table
from needlefem.casefile.openkeys import OPEN
from needlefem.casefile.starters.boxes import box_around, mesh_text
from needlefem.casefile.starters.draft import Draft, millimetres, numbers_text, point_text, quoted
from needlefem.casefile.starters.wanted import Wanted, direction_of, point_of
from needlefem.errors import CaseError
from needlefem.units import parse_quantity

UNKNOWN = f'"{OPEN}"'
UNNAMED = ("y", "z")
"""Axes of files whose columns have no names."""
FINEST = 0.5e-3
"""Smallest size along a contour, m, where no voxel says more."""


def of_contours(paths: Sequence[Path], folder: Path, wanted: Wanted) -> Draft:
    """Return the case that contour files begin: a box around them, a region each.

    `folder` is the case's; contour files that lie there stay as they are.

    Raises
    ------
    CaseError
        A file that can't be read, two of one name, or axes that differ between them.
    """
    tables = {path.stem: read_table(path, "--contour") for path in paths}
    if len(tables) < len(paths):
        problem = f"two files of {len(paths)} have one name"
        raise CaseError("--contour", problem, "regions are called by their files: rename one")
    axes = next((table.names for table in tables.values() if table.names), UNNAMED)
    staying = {path.stem for path in paths if path.resolve().parent == folder.resolve()}
    unit = parse_quantity(wanted.unit, "length", "--unit") if wanted.unit else None
    contours = {name: table.contour("--contour", axes, unit) for name, table in tables.items()}
    contours = dict(sorted(contours.items(), key=lambda item: -item[1].area))
    target = point_of(wanted.target, 2, "--target") if wanted.target else None
    box = box_around(contours, wanted.around, *([] if target is None else [target]))
    draft = Draft(
        title=paths[0].stem,
        file=", ".join(path.name for path in paths),
        axes=axes,
        remarks=(f"The tissue is a box, {wanted.margin} around the contours: its faces are skin.",),
        mesh=mesh_text(box, contours, FINEST, 0.0),
        regions={
            name: _contour_text(name, tables[name], wanted.unit, staying) for name in contours
        },
        faces=(),
        direction=UNKNOWN,
        max_depth=UNKNOWN,
        target=UNKNOWN if target is None else point_text(target),
        contours={name + ".csv": contour for name, contour in contours.items()},
    )
    faces = tuple(f"{axis}_{end}" for axis in draft.axes for end in ("min", "max"))
    draft = dataclasses.replace(draft, faces=faces)
    if not wanted.direction:
        return draft
    direction = direction_of(wanted.direction, 2, "--direction")
    depth = UNKNOWN
    if target is not None:
        depth = millimetres(box.depth_of(target, direction) + 0.5 * wanted.around)
    return dataclasses.replace(draft, direction=numbers_text(direction), max_depth=depth)


def _contour_text(name: str, table: ContourTable, unit: str, staying: Collection[str]) -> str:
    """Return the keys of a region; those of `staying` whose files say no unit need it here."""
    line = f"contour = {quoted(name + '.csv')}"
    if name not in staying or all(column.factor is not None for column in table.columns):
        return line
    return f"{line}\nunit = {quoted(unit)}"


def csv_text(points: np.ndarray, axes: Sequence[str]) -> str:
    """Return a contour's corners, shape (n, 2), m, as the text of a contour file in mm."""
    rows = [f"{1e3 * y:.9g}, {1e3 * z:.9g}" for y, z in points]
    return "\n".join([", ".join(f"{axis} [mm]" for axis in axes), *rows]) + "\n"
