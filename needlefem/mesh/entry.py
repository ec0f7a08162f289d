"""Where a line enters the tissue."""

from typing import NamedTuple

import numpy as np

from needlefem._arrays import Floats, Ints, Points, SkfemMesh, Vector
from needlefem.errors import CaseError
from needlefem.mesh.surface import line_crossings

STEEPEST = 0.2
"""Least cosine between needle and inward normal: flatter, a tip would slide on the skin."""


class Entry(NamedTuple):
    """A point of the skin.

    Parameters
    ----------
    point : array, shape (dim,), m
    inward : array, shape (dim,)
        Unit normal into the tissue.
    facet : int
        Number of the mesh facet.
    """

    point: Vector
    inward: Vector
    facet: int


def entry_along(mesh: SkfemMesh, through: Vector, direction: Vector) -> Entry | None:
    """Return where the line through a point first enters the mesh, or None if it misses it.

    Parameters
    ----------
    mesh : skfem.Mesh
        Simplicial.
    through, direction : array, shape (dim,)
        A point of the line, m, and its unit direction.
    """
    facets = mesh.boundary_facets()
    corners = np.moveaxis(mesh.p[:, mesh.facets[:, facets]], 2, 0).swapaxes(1, 2)
    crossed, travel = line_crossings(corners, through, direction)
    if not crossed.size:
        return None
    first = int(np.argmin(travel))
    number = int(facets[crossed[first]])
    point = through + travel[first] * direction
    return Entry(point, _inward(mesh, number), number)


def entry_at(mesh: SkfemMesh, point: Vector, direction: Vector) -> Entry:
    """Return the entry at a given point of the skin.

    Raises
    ------
    CaseError
        The point is not on the skin where a needle of this direction enters.
    """
    found = entry_along(mesh, point, direction)
    size = float(np.max(np.ptp(mesh.p, axis=1)))
    if found is None or np.linalg.norm(found.point - point) > 1e-6 * size:
        where = "the needle's line misses the tissue"
        if found is not None:
            where = f"the needle's line enters the tissue at {place_text(found.point)}"
        raise CaseError("motion.entry", f"{place_text(point)} is not on the skin", where)
    return found


def check_entry(entry: Entry, direction: Vector, held: Ints) -> None:
    """Raise a `CaseError` if the needle would slide along the skin or meets a held face.

    `held` are the facets of all supports.
    """
    if entry.inward @ direction < STEEPEST:
        problem = f"the needle meets the skin at {place_text(entry.point)} almost along it"
        raise CaseError("motion.direction", problem, "choose a steeper direction")
    if entry.facet in held:
        problem = f"the face at {place_text(entry.point)} is held by a support"
        raise CaseError("motion.entry", problem, "enter through a free face")


def _inward(mesh: SkfemMesh, facet: int) -> Vector:
    corners = mesh.p[:, mesh.facets[:, facet]].T
    normal: Floats = np.linalg.svd(corners[1:] - corners[0])[2][-1]
    inside: Points = mesh.p[:, mesh.t[:, mesh.f2t[0, facet]]].mean(axis=1)
    return normal if normal @ (inside - corners[0]) > 0.0 else -normal


def place_text(point: Vector) -> str:
    """Return a point as messages have it, in cm."""
    return "(" + ", ".join(f"{100.0 * x:.4g}" for x in point) + ") cm"
