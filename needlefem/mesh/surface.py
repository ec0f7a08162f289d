"""The surface of the undeformed tissue: intersections with lines, and the entry of a needle."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from needlefem._arrays import Bools, Floats, Ints, Points, SkfemMesh, Vector
from needlefem.errors import CaseError

PARALLEL = 1e-12
"""Largest sine of the angle between a line and a facet that count as parallel."""
SHORTEST = 1e-9
"""Shortest part of a segment between two intersections that is evaluated."""


def line_crossings(corners: Floats, through: Vector, direction: Vector) -> tuple[Ints, Floats]:
    """Return which facets a line crosses, and where along it.

    Facets that are parallel to the line are not crossed.

    Parameters
    ----------
    corners : array, shape (n, dim, dim), m
        The corners of every facet.
    through, direction : array, shape (dim,)
        A point of the line, and its direction.

    Returns
    -------
    Numbers of the facets, and the crossings' coordinates along the line, in units of `direction`.
    """
    edges = corners[:, 1:] - corners[:, :1]
    columns = np.broadcast_to(-direction, (len(corners), 1, len(direction)))
    system = np.swapaxes(np.concatenate([edges, columns], axis=1), 1, 2)
    scale = np.prod(np.linalg.norm(system, axis=1), axis=1)
    across = np.flatnonzero(np.abs(np.linalg.det(system)) > PARALLEL * scale)
    solved = np.linalg.solve(system[across], (through - corners[across, 0])[:, :, None])[:, :, 0]
    local = solved[:, :-1]
    hit = (local.min(axis=1, initial=np.inf) >= -1e-9) & (local.sum(axis=1) <= 1.0 + 1e-9)
    return across[hit], solved[hit, -1]


class Surface:
    """The boundary facets of a mesh.

    Parameters
    ----------
    mesh : skfem.Mesh
        With straight edges.
    inside : callable
        Takes points, shape (n, dim), m, and says which are in the tissue.
    """

    def __init__(self, mesh: SkfemMesh, inside: Callable[[Points], Bools]) -> None:
        facets = mesh.facets[:, mesh.boundary_facets()]
        self._inside = inside
        self._corners: Floats = np.moveaxis(mesh.p[:, facets], 0, 2).swapaxes(0, 1)
        self._middles: Points = self._corners.mean(axis=1)
        spread = self._corners - self._middles[:, None]
        self._reach: Floats = np.linalg.norm(spread, axis=2).max(axis=1)
        self._normals: Points = np.linalg.svd(spread)[2][:, -1]

    def clearance(self, point: Vector) -> float:
        """Return a distance from a point within which there is no surface, m.

        Every facet is at least as far as its plane, and as the sphere around it.
        """
        apart = self._middles - point
        spheres = np.sqrt(np.einsum("ij,ij->i", apart, apart)) - self._reach
        planes = np.abs(np.einsum("ij,ij->i", apart, self._normals))
        return float(np.maximum(spheres, planes).min())

    def first_exit(self, start: Vector, end: Vector) -> float | None:
        """Return where a straight segment that starts in the tissue leaves it, or None.

        Parts of the segment are tested in their middles, so that touching the surface, or running
        along it, is not leaving.

        Parameters
        ----------
        start, end : array, shape (dim,), m

        Returns
        -------
        Part of the segment up to the exit, or None: all of it is in the tissue.
        """
        ahead = end - start
        apart = self._middles - 0.5 * (start + end)
        reach = self._reach + 0.5 * (1.0 + 1e-6) * float(np.sqrt(ahead @ ahead))
        near = np.flatnonzero(np.einsum("ij,ij->i", apart, apart) <= reach**2)
        stops = np.array([0.0, 1.0])
        if near.size:
            _, shares = line_crossings(self._corners[near], start, ahead)
            inner = shares[(shares > 0.0) & (shares < 1.0)]
            stops = np.concatenate([[0.0], np.sort(inner), [1.0]])
        long = np.diff(stops) > SHORTEST
        begins, middles = stops[:-1][long], 0.5 * (stops[1:] + stops[:-1])[long]
        begins, looked_at = np.append(begins, 1.0), np.append(middles, 1.0)
        outside = np.flatnonzero(~self._inside(start + looked_at[:, None] * ahead))
        return float(begins[outside[0]]) if outside.size else None


class TipWatch:
    """Detection of the point at which the path of the tip leaves the tissue.

    Far from the surface nothing is looked for until the tip has gone as far as it is deep.

    Parameters
    ----------
    surface : Surface
    start : array, shape (dim,), m
        Where the tip is: on or in the tissue.
    """

    def __init__(self, surface: Surface, start: Vector) -> None:
        self._surface = surface
        self._seen, self._clear = start, 0.0

    def first_exit(self, start: Vector, end: Vector) -> float | None:
        """Return the share of the tip's next step at which it leaves the tissue, or None.

        Parameters
        ----------
        start, end : array, shape (dim,), m
            Material points at the tip before and after the step.
        """
        if self._clear_of(start) and self._clear_of(end):
            return None
        self._seen, self._clear = start, self._surface.clearance(start)
        return None if self._clear_of(end) else self._surface.first_exit(start, end)

    def _clear_of(self, point: Vector) -> bool:
        """Return whether a point is within the last known distance without a surface."""
        apart = point - self._seen
        return float(apart @ apart) < self._clear**2


# Where a line enters the tissue.


STEEPEST = 0.2
"""Smallest cosine of the angle between needle and inward normal of the skin at the entry."""


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
    """Return the first intersection of the line through a point with the surface, or None.

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
    """Raise a `CaseError` if the needle is too oblique to the skin or meets a supported face.

    `held` are the facets of all supports.
    """
    if entry.inward @ direction < STEEPEST:
        problem = f"the needle is almost parallel to the skin at {place_text(entry.point)}"
        raise CaseError("motion.direction", problem, "choose a steeper direction")
    if entry.facet in held:
        problem = f"the face at {place_text(entry.point)} is fixed by a support"
        raise CaseError("motion.entry", problem, "enter through a free face")


def _inward(mesh: SkfemMesh, facet: int) -> Vector:
    corners = mesh.p[:, mesh.facets[:, facet]].T
    normal: Floats = np.linalg.svd(corners[1:] - corners[0])[2][-1]
    inside: Points = mesh.p[:, mesh.t[:, mesh.f2t[0, facet]]].mean(axis=1)
    return normal if normal @ (inside - corners[0]) > 0.0 else -normal


def place_text(point: Vector) -> str:
    """Return the text of a point in messages, in cm."""
    return "(" + ", ".join(f"{100.0 * x:.4g}" for x in point) + ") cm"
