"""Uniform refinement of meshes, and meshes whose edges follow contours."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import NoReturn

import numpy as np

from needlefem._arrays import Bools, Floats, Ints, Points, SkfemMesh
from needlefem.errors import CaseError
from needlefem.geometry.contour import Contour
from needlefem.mesh.generation import cell_sizes, signed_measures

NEAR = 0.25
"""Largest distance of an edge's ends from a contour, relative to its length, to be moved to it."""


def uniformly_refined(mesh: SkfemMesh, contours: Sequence[Contour] = ()) -> SkfemMesh:
    """Return the mesh with each cell divided into four (eight in 3D); names are kept.

    Vertices between two regions are moved to the nearest contour, because the straight edges of a
    fitted mesh are chords of it.

    Parameters
    ----------
    mesh : skfem.Mesh
        With named regions that contain all cells.
    contours : sequence of Contour
        Contours of the fitted mesh.
    """
    finer = mesh.refined()
    if not contours:
        return finer
    owner = np.zeros(finer.nelements, dtype=np.intp)
    for number, cells in enumerate((finer.subdomains or {}).values()):
        owner[cells] = number
    one, other = finer.f2t
    between = finer.facets[:, (other >= 0) & (owner[one] != owner[other])]
    ends = finer.p[:, between]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=0)
    vertices, first = np.unique(between, return_index=True)
    points = finer.p.T[vertices]
    feet = _nearest(points, contours)
    near = np.linalg.norm(feet - points, axis=1) <= NEAR * np.tile(length, 2)[first]
    moved = finer.p.copy()
    moved[:, vertices[near]] = feet[near].T
    return dataclasses.replace(finer, doflocs=moved)


def _nearest(points: Points, contours: Sequence[Contour]) -> Points:
    feet = np.array([contour.project(points) for contour in contours])
    away: Floats = np.linalg.norm(feet - points, axis=2)
    found: Points = feet[np.argmin(away, axis=0), np.arange(len(points))]
    return found


# Movement of mesh vertices to contours, so that no contour intersects a cell.


ON_LINE = 1e-9
"""Share of an edge within which its end counts as on the contour."""
RELAXATIONS = 5
"""Smoothing sweeps after the fit; further ones change the smallest angle by less than a degree."""
FLAT = 0.5
"""Shape of a cell below which it counts as flat if all its vertices are on a contour; cells in
vertices of the contour with less than about 130 degrees have a better shape."""


def fit_to_contour(mesh: SkfemMesh, contour: Contour) -> SkfemMesh:
    """Return the mesh with vertices near a contour moved onto it; see `fit_to_contours`."""
    return fit_to_contours(mesh, {"region": contour})


def fit_to_contours(mesh: SkfemMesh, contours: Mapping[str, Contour]) -> SkfemMesh:
    """Return the mesh with vertices near contours moved to them, for each contour in turn.

    For every edge that the contour intersects, the nearer end is moved to the contour, in the order
    of the distances. A vertex does not move if a cell would become flat (all three vertices on the
    contour, unless the cell is in a vertex of the contour), or if it is on the boundary or on an
    earlier contour; the other end of the edge moves instead. Free vertices nearby are then smoothed
    if that improves the worst of their cells.

    Raises
    ------
    CaseError
        Contours intersect, an edge still intersects a contour, or a cell would be inverted: the
        mesh is too coarse for the contour.
    """
    known = list(contours.items())
    for number, (name, contour) in enumerate(known):
        for other, before in known[:number]:
            place = contour.meeting(before)
            if place is not None:
                problem = f"the contours of '{other}' and '{name}' meet at {_text(place)}"
                remedy = "draw them apart, or set mesh.interfaces to 'by_centroid'"
                raise CaseError("mesh.interfaces", problem, remedy)
    kept = np.full(mesh.nvertices, -1)
    kept[mesh.boundary_nodes()] = len(known)
    for number, (name, contour) in enumerate(known):
        others = [*(f"the contour of '{other}'" for other in contours), "the tissue's boundary"]
        moved, on_line = _move_to_contour(
            mesh, contour, kept, [f"the contour of '{name}'", *others]
        )
        moved = _smooth(mesh, moved, on_line, kept >= 0)
        fitted = dataclasses.replace(mesh, doflocs=np.ascontiguousarray(moved.T))
        flipped = np.flatnonzero(np.sign(signed_measures(fitted)) != np.sign(signed_measures(mesh)))
        if flipped.size:
            place = mesh.p[:, mesh.t[:, flipped[0]]].mean(axis=1)
            size = cell_sizes(mesh)[flipped[0]]
            _refuse(f"the contour of '{name}' inverts a cell of {1e3 * size:.3g} mm", place)
        kept[on_line & (kept < 0)] = number
        mesh = fitted
    return mesh


def _text(place: Floats) -> str:
    return "(" + ", ".join(f"{100.0 * x:.4g}" for x in place) + ") cm"


def _refuse(problem: str, place: Floats) -> NoReturn:
    remedy = "set mesh.refine.contour_size smaller, or mesh.interfaces to 'by_centroid'"
    raise CaseError("mesh.interfaces", f"{problem} at {_text(place)}", remedy)


def _move_to_contour(
    mesh: SkfemMesh, contour: Contour, kept: Ints, names: list[str]
) -> tuple[Points, Bools]:
    """Return the positions of the vertices, and whether each is on the contour.

    Parameters
    ----------
    mesh : skfem.Mesh
    contour : Contour
    kept : array, shape (nvertices,)
        Number of the curve on which a vertex is fixed; -1 if it may move.
    names : list of str
        Names of the contour and of the curves on which vertices are fixed.
    """
    points = mesh.p.T.copy()
    inside = contour.contains(points)
    edges = mesh.facets.T
    cut = edges[inside[edges[:, 0]] != inside[edges[:, 1]]]
    share = contour.crossings(points[cut[:, 0]], points[cut[:, 1]])
    lost = np.flatnonzero(np.isnan(share))  # by round-off: one end is on the contour
    ends = [contour.distance(points[cut[lost, i]]) for i in range(2)]
    share[lost] = np.where(ends[0] <= ends[1], 0.0, 1.0)
    place = points[cut[:, 0]] + share[:, None] * (points[cut[:, 1]] - points[cut[:, 0]])
    on_line = np.zeros(len(points), dtype=bool)
    for column, away in ((0, share), (1, 1.0 - share)):
        on_line[cut[away <= ON_LINE, column]] = True
    on_line &= kept >= 0
    cells_at = _cells_at_vertices(mesh)
    for edge in np.argsort(np.minimum(share, 1.0 - share), kind="stable"):
        near, far = cut[edge] if share[edge] <= 0.5 else cut[edge][::-1]
        if on_line[near] or on_line[far]:
            continue
        for vertex in (near, far):
            cells = mesh.t[:, cells_at[vertex]]
            closing = cells[:, np.sum(on_line[cells], axis=0) == 2]
            if kept[vertex] < 0 and not _flattened(points, closing, vertex, place[edge]):
                points[vertex] = place[edge]
                on_line[vertex] = True
                break
        else:
            size = 1e3 * float(np.linalg.norm(mesh.p[:, near] - mesh.p[:, far]))
            stuck = [int(kept[v]) for v in (near, far) if kept[v] >= 0]
            problem = f"edges of {size:.3g} mm cannot represent {names[0]}"
            if stuck:
                near_to = names[1 + stuck[0]]
                problem = f"{names[0]} is closer to {near_to} than edges of {size:.3g} mm resolve"
            _refuse(problem, place[edge])
    return points, on_line


def _flattened(points: Points, cells: Ints, vertex: int, place: Floats) -> bool:
    """Return whether a vertex at a new position makes one of its cells flat."""
    if not cells.size:
        return False
    before = points[vertex].copy()
    points[vertex] = place
    flat = bool(np.any(_shape(points, cells) < FLAT))
    points[vertex] = before
    return flat


def _cells_at_vertices(mesh: SkfemMesh) -> list[Ints]:
    order = np.argsort(mesh.t.ravel(), kind="stable")
    counts = np.bincount(mesh.t.ravel(), minlength=mesh.nvertices)
    return np.split(order % mesh.nelements, np.cumsum(counts)[:-1])


def _smooth(mesh: SkfemMesh, points: Points, on_line: Bools, kept: Bools) -> Points:
    """Move free vertices to the mean of their neighbours where the cells improve."""
    cells_at = _cells_at_vertices(mesh)
    ring = on_line.copy()
    for _ in range(2):
        ring[mesh.t[:, np.any(ring[mesh.t], axis=0)]] = True
    ring[kept] = False
    movable = np.flatnonzero(ring & ~on_line)
    for _ in range(RELAXATIONS):
        for vertex in movable:
            cells = mesh.t[:, cells_at[vertex]]
            before, place = _shape(points, cells).min(), points[vertex].copy()
            points[vertex] = points[np.setdiff1d(cells, vertex)].mean(axis=0)
            if _shape(points, cells).min() <= before:
                points[vertex] = place
    return points


def _shape(points: Points, cells: Ints) -> Floats:
    """Return the shape of triangles: 1 if equilateral, 0 if flat, negative if inverted.

    The sign depends on the order of the vertices; only its absolute value is compared.
    """
    a, b, c = points[cells[0]], points[cells[1]], points[cells[2]]
    u, v, w = b - a, c - a, c - b
    area = 0.5 * np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
    sides = np.sum(u**2 + v**2 + w**2, axis=1)
    quality: Floats = 4.0 * np.sqrt(3.0) * area / sides
    return quality
