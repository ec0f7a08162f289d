"""From a cell to its reference cell and back, and what its corners say of it."""

from typing import Protocol

import numpy as np

from needlefem.arrays import Floats, Ints, Points, SkfemMesh
from needlefem.errors import CaseError
from needlefem.fem.shapes import ShapeTable

NEWTON_STEPS = 12
"""Quadratic convergence: points inside convex cells need six at most."""


class CellMap(Protocol):
    """The map between cells of a mesh and the reference cell."""

    def invert(self, cells: Ints, points: Points) -> Points:
        """Return reference points, shape (n, dim), of points in given cells."""
        ...

    def depth(self, local: Points) -> Floats:
        """Return how far inside the reference cell points are, shape (n,); negative outside."""
        ...


def cell_corners(mesh: SkfemMesh) -> Floats:
    """Return the corners of every cell, shape (ncells, corners, dim), m."""
    return np.ascontiguousarray(np.moveaxis(mesh.p[:, mesh.t], 0, 2).swapaxes(0, 1))


def is_simplicial(mesh: SkfemMesh) -> bool:
    """Say whether the cells are triangles (tetrahedra)."""
    return bool(mesh.t.shape[0] == mesh.dim() + 1)


def cell_map(mesh: SkfemMesh) -> CellMap:
    """Return the map of a mesh with straight edges."""
    return AffineMap(mesh) if is_simplicial(mesh) else MultilinearMap(mesh)


class AffineMap:
    """The map of triangles and tetrahedra; see `CellMap`."""

    def __init__(self, mesh: SkfemMesh) -> None:
        corners = cell_corners(mesh)
        self._base = np.ascontiguousarray(corners[:, 0])
        self._forward = np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2).copy()
        self._inverse = np.linalg.inv(self._forward)

    def invert(self, cells: Ints, points: Points) -> Points:
        """See `CellMap`."""
        local: Points = np.einsum("nij,nj->ni", self._inverse[cells], points - self._base[cells])
        return local

    def depth(self, local: Points) -> Floats:
        """See `CellMap`."""
        least: Floats = np.minimum(local.min(axis=1, initial=np.inf), 1.0 - local.sum(axis=1))
        return least


class MultilinearMap:
    """The map of quadrilaterals and hexahedra with straight edges; see `CellMap`."""

    def __init__(self, mesh: SkfemMesh) -> None:
        self._corners = cell_corners(mesh)
        self._shape = ShapeTable(mesh.elem())

    def invert(self, cells: Ints, points: Points) -> Points:
        """See `CellMap`; NaN where no reference point is found (far outside the cell)."""
        corners = self._corners[cells]
        size = np.max(np.ptp(corners, axis=1), axis=1, initial=0.0)
        local = np.full_like(points, 0.5)
        with np.errstate(invalid="ignore", over="ignore"):
            for _ in range(NEWTON_STEPS):
                at = np.clip(local, -2.0, 3.0)
                miss = points - np.einsum("nk,nkd->nd", self._shape(at), corners)
                if np.all(np.abs(miss) <= 1e-14 * size[:, None]):
                    break
                step = self._newton_step(at, corners, miss)
                local = at + step
        lost = np.abs(miss).max(axis=1, initial=0.0) > 1e-9 * size
        local[lost] = np.nan
        return local

    def _newton_step(self, at: Points, corners: Floats, miss: Points) -> Points:
        slope = np.einsum("nkj,nkd->ndj", self._shape.gradients(at), corners)
        steep = np.abs(np.linalg.det(slope)) > 1e-12 * np.abs(slope).max() ** slope.shape[1]
        step = np.zeros_like(at)
        step[steep] = np.linalg.solve(slope[steep], miss[steep][:, :, None])[:, :, 0]
        return step

    def depth(self, local: Points) -> Floats:
        """See `CellMap`."""
        least: Floats = np.minimum(local, 1.0 - local).min(axis=1, initial=np.inf)
        return np.where(np.isnan(least), -np.inf, least)


def corner_jacobians(mesh: SkfemMesh) -> Floats:
    """Return the Jacobian's determinant at every corner, shape (ncells, corners).

    A cell is valid when they have one sign; a concave one has a corner of the other.
    """
    corners = cell_corners(mesh)
    slopes = ShapeTable(mesh.elem()).gradients(mesh.elem().doflocs)
    found: Floats = np.linalg.det(np.einsum("ckj,nkd->ncdj", slopes, corners))
    return found


def cell_measures(mesh: SkfemMesh) -> Floats:
    """Return the area (volume) of every cell, shape (ncells,), positive for valid cells."""
    jacobians = np.abs(corner_jacobians(mesh))
    measure = {3: 0.5, 4: 1.0 if mesh.dim() == 2 else 1.0 / 6.0, 8: 1.0}[mesh.t.shape[0]]
    found: Floats = measure * jacobians.mean(axis=1)
    return found


def refuse_bad_cells(mesh: SkfemMesh, key: str) -> None:
    """Raise a `CaseError` for flat, concave or crossed cells, with their numbers.

    scikit-fem takes the absolute value of the Jacobian: such cells pass it silently.
    """
    jacobians = corner_jacobians(mesh)
    scale = np.max(np.ptp(cell_corners(mesh), axis=1), axis=1) ** mesh.dim()
    sign = np.sign(jacobians.sum(axis=1))
    bad = np.min(jacobians * sign[:, None], axis=1) <= 1e-12 * scale
    if np.any(bad):
        numbers = ", ".join(map(str, np.flatnonzero(bad)[:5]))
        problem = f"{np.count_nonzero(bad)} cells are flat, concave or crossed (cell {numbers})"
        raise CaseError(key, problem, "correct the mesh there")
