"""A case from contour files."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from needlefem.casefile.contourfile import read_contour
from needlefem.casefile.openkeys import OPEN
from needlefem.casefile.starters.boxes import box_around, mesh_text
from needlefem.casefile.starters.draft import Draft, millimetres, numbers_text, point_text, quoted
from needlefem.casefile.starters.wanted import Wanted, direction_of, point_of
from needlefem.errors import CaseError

UNKNOWN = f'"{OPEN}"'
FINEST = 0.5e-3
"""Smallest size along a contour, m, where no voxel says more."""


def of_contours(paths: Sequence[Path], wanted: Wanted) -> Draft:
    """Return the case that contour files begin: a box around them, a region each.

    Raises
    ------
    CaseError
        A file that can't be read, two of one name, or axes that differ between them.
    """
    contours = {path.stem: read_contour(path, "--contour") for path in paths}
    if len(contours) < len(paths):
        problem = f"two files of {len(paths)} have one name"
        raise CaseError("--contour", problem, "regions are called by their files: rename one")
    axes = {_axes(path) for path in paths}
    if len(axes) > 1:
        raise CaseError("--contour", "the files' headers name other axes", "write one pair")
    contours = dict(sorted(contours.items(), key=lambda item: -item[1].area))
    target = point_of(wanted.target, 2, "--target") if wanted.target else None
    box = box_around(contours, wanted.around, *([] if target is None else [target]))
    draft = Draft(
        title=paths[0].stem,
        file=", ".join(path.name for path in paths),
        axes=axes.pop(),
        remarks=(f"The tissue is a box, {wanted.margin} around the contours: its faces are skin.",),
        mesh=mesh_text(box, contours, FINEST, 0.0),
        regions={name: f"contour = {quoted(name + '.csv')}" for name in contours},
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


def _axes(path: Path) -> tuple[str, ...]:
    """Return the names of the axes in a contour's header; (y, z) where there are none."""
    titles = path.read_text(encoding="utf-8").splitlines()[0].split(",")
    names = tuple(title.partition("[")[0].strip() for title in titles)
    return names if all(names) and len(set(names)) == len(names) == 2 else ("y", "z")


def csv_text(points: np.ndarray, axes: Sequence[str]) -> str:
    """Return a contour's corners, shape (n, 2), m, as the text of a contour file in mm."""
    rows = [f"{1e3 * y:.9g}, {1e3 * z:.9g}" for y, z in points]
    return "\n".join([", ".join(f"{axis} [mm]" for axis in axes), *rows]) + "\n"
