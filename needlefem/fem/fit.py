"""Move mesh vertices onto a contour, so that the contour cuts no cell."""

import dataclasses

import numpy as np

from needlefem.arrays import Bools, Floats, Ints, Points, SkfemMesh
from needlefem.contour import Contour
from needlefem.errors import CaseError
from needlefem.fem.mesh import signed_measures

RELAXATIONS = 5
"""Smoothing sweeps after the fit; more change the smallest angle by less than a degree."""


def fit_to_contour(mesh: SkfemMesh, contour: Contour) -> SkfemMesh:
    """Return the mesh with vertices near the contour moved onto it.

    Every edge that the contour crosses gives its nearer end to the contour, nearest first. A
    vertex that would flatten a cell (all three corners on the contour), or that lies on the
    outer boundary, stays, and the edge's other end moves. Then the free vertices around are
    smoothed wherever that widens the worst of their cells.

    Raises
    ------
    CaseError
        An edge can't be freed of its crossing, or a cell would turn over: the mesh is too
        coarse for the contour.
    """
    moved, on_line = _snap(mesh, contour)
    moved = _smooth(mesh, moved, on_line)
    fitted = dataclasses.replace(mesh, doflocs=np.ascontiguousarray(moved.T))
    flipped = np.sign(signed_measures(fitted)) != np.sign(signed_measures(mesh))
    if np.any(flipped):
        _refuse(f"fitting turned cell {np.flatnonzero(flipped)[0]} over")
    return fitted


def _refuse(problem: str) -> None:
    remedy = "set mesh.refine.contour_size smaller, or mesh.interfaces to 'centroid'"
    raise CaseError("mesh.interfaces", problem, remedy)


def _snap(mesh: SkfemMesh, contour: Contour) -> tuple[Points, Bools]:
    points = mesh.p.T.copy()
    inside = contour.contains(points)
    edges = mesh.facets.T
    cut = edges[inside[edges[:, 0]] != inside[edges[:, 1]]]
    share = contour.crossings(points[cut[:, 0]], points[cut[:, 1]])
    place = points[cut[:, 0]] + share[:, None] * (points[cut[:, 1]] - points[cut[:, 0]])
    on_line = np.zeros(len(points), dtype=bool)
    fixed = np.zeros(len(points), dtype=bool)
    fixed[mesh.boundary_nodes()] = True
    cells_at = _cells_at_vertices(mesh)
    for edge in np.argsort(np.minimum(share, 1.0 - share), kind="stable"):
        near, far = cut[edge] if share[edge] <= 0.5 else cut[edge][::-1]
        if on_line[near] or on_line[far]:
            continue
        for vertex in (near, far):
            flat = np.any(np.sum(on_line[mesh.t[:, cells_at[vertex]]], axis=0) == 2)
            if not fixed[vertex] and not flat:
                points[vertex] = place[edge]
                on_line[vertex] = True
                break
        else:
            _refuse(f"no vertex can be moved onto the contour at {place[edge]}")
    return points, on_line


def _cells_at_vertices(mesh: SkfemMesh) -> list[Ints]:
    order = np.argsort(mesh.t.ravel(), kind="stable")
    counts = np.bincount(mesh.t.ravel(), minlength=mesh.nvertices)
    return np.split(order % mesh.nelements, np.cumsum(counts)[:-1])


def _smooth(mesh: SkfemMesh, points: Points, on_line: Bools) -> Points:
    """Move free vertices near the line to the mean of their neighbours where cells gain."""
    cells_at = _cells_at_vertices(mesh)
    ring = on_line.copy()
    for _ in range(2):
        ring[mesh.t[:, np.any(ring[mesh.t], axis=0)]] = True
    ring[mesh.boundary_nodes()] = False
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
    """Return the shape of triangles: 1 for equilateral, 0 for flat, negative when turned over.

    The sign is that of the cell's corner order, so only its size is compared between moves.
    """
    a, b, c = points[cells[0]], points[cells[1]], points[cells[2]]
    u, v, w = b - a, c - a, c - b
    area = 0.5 * np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
    sides = np.sum(u**2 + v**2 + w**2, axis=1)
    quality: Floats = 4.0 * np.sqrt(3.0) * area / sides
    return quality
