"""Maps between cells and the reference cell, validity of cells, and search for points."""

from collections.abc import Callable
from typing import Protocol

import numpy as np

from needlefem._arrays import Bools, Floats, Ints, Points, SkfemMesh
from needlefem.elements.shape_functions import shape_table
from needlefem.errors import CaseError

Inverse = Callable[[Points], Points]
"""Takes one point per cell, shape (n, dim), m; returns them in the reference cell."""


class CellMap(Protocol):
    """The map between cells of a mesh and the reference cell."""

    def inverse(self, cells: Ints) -> Inverse:
        """Return the inverse maps of cells, with one cell per point."""
        ...

    def invert(self, cells: Ints, points: Points) -> Points:
        """Return reference points, shape (n, dim), of points in given cells."""
        ...

    def depth(self, local: Points) -> Floats:
        """Return the distance of points inside the reference cell, shape (n,); else negative."""
        ...


def cell_corners(mesh: SkfemMesh) -> Floats:
    """Return the corners of every cell, shape (ncells, corners, dim), m."""
    return np.ascontiguousarray(np.moveaxis(mesh.p[:, mesh.t], 0, 2).swapaxes(0, 1))


def is_simplicial(mesh: SkfemMesh) -> bool:
    """Return whether the cells are triangles (tetrahedra)."""
    return bool(mesh.t.shape[0] == mesh.dim() + 1)


def cell_map(mesh: SkfemMesh) -> CellMap:
    """Return the map of a mesh with straight edges; raise a `CaseError` for curved ones."""
    if mesh.p.shape[1] != len(np.unique(mesh.t)):
        remedy = "use a mesh with straight edges"
        raise CaseError("mesh", "points cannot be located in cells with curved edges", remedy)
    return AffineMap(mesh) if is_simplicial(mesh) else BilinearMap(mesh)


class AffineMap:
    """The map of triangles and tetrahedra; see `CellMap`."""

    def __init__(self, mesh: SkfemMesh) -> None:
        corners = cell_corners(mesh)
        self._base = np.ascontiguousarray(corners[:, 0])
        self._forward = np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2).copy()
        self._inverse = np.linalg.inv(self._forward)

    def inverse(self, cells: Ints) -> Inverse:
        """See `CellMap`."""
        inverse, base = self._inverse[cells], self._base[cells]

        def invert(points: Points) -> Points:
            local: Points = np.einsum("nij,nj->ni", inverse, points - base)
            return local

        return invert

    def invert(self, cells: Ints, points: Points) -> Points:
        """See `CellMap`."""
        return self.inverse(cells)(points)

    def depth(self, local: Points) -> Floats:
        """See `CellMap`."""
        least = total = local[:, 0]
        for axis in range(
            1, local.shape[1]
        ):  # column by column: reductions over short rows are slow
            least = np.minimum(least, local[:, axis])
            total = total + local[:, axis]
        found: Floats = np.minimum(least, 1.0 - total)
        return found


class BilinearMap:
    """The map of quadrilaterals with straight edges; see `CellMap`.

    ``x = a + b xi + c eta + d xi eta``: eliminating xi gives a quadratic equation for eta,
    ``square eta^2 + one eta + zero = 0``. Its derivative at a solution, ``2 square eta + one``, is
    the Jacobian of the map there. In a convex cell the Jacobian has the same sign everywhere. The
    sign at a corner therefore selects the solution inside of the cell. (The sign of ``one``, the
    derivative at eta = 0, may differ: the line of constant xi through the point may leave the
    region in which the map is one-to-one before it reaches eta = 0.)
    """

    def __init__(self, mesh: SkfemMesh) -> None:
        first, second, third, fourth = np.moveaxis(cell_corners(mesh), 1, 0)
        self._a, self._b, self._c = first, second - first, fourth - first
        self._d = third - second - fourth + first

    def inverse(self, cells: Ints) -> Inverse:
        """See `CellMap`; far outside of a cell a solution may not exist: NaN."""
        a, b, c, d = self._a[cells], self._b[cells], self._c[cells], self._d[cells]
        return lambda points: _bilinear_inverse(b, c, d, points - a)

    def invert(self, cells: Ints, points: Points) -> Points:
        """See `CellMap` and `inverse`."""
        return self.inverse(cells)(points)

    def depth(self, local: Points) -> Floats:
        """See `CellMap`."""
        least: Floats = np.minimum(local, 1.0 - local).min(axis=1, initial=np.inf)
        return np.where(np.isnan(least), -np.inf, least)


def _bilinear_inverse(b: Points, c: Points, d: Points, apart: Points) -> Points:
    jacobian = _cross(b, c)
    square, one, zero = -_cross(c, d), _cross(apart, d) + jacobian, _cross(apart, b)
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.copysign(np.sqrt(one**2 - 4.0 * square * zero), jacobian)
        # of two equal forms of the solution, the one without cancellation
        alike = one * jacobian >= 0.0
        eta = np.where(alike, -2.0 * zero / (one + root), 0.5 * (root - one) / square)
        along = b + eta[:, None] * d
        xi = _dot(apart - eta[:, None] * c, along) / _dot(along, along)
        # one Newton step removes the round-off of a small square term
        miss = apart - xi[:, None] * along - eta[:, None] * c
        across = c + xi[:, None] * d
        jacobian = _cross(along, across)
        xi = xi + _cross(miss, across) / jacobian
        eta = eta + _cross(along, miss) / jacobian
    return np.stack([xi, eta], axis=1)


def _cross(u: Points, v: Points) -> Floats:
    found: Floats = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    return found


def _dot(u: Points, v: Points) -> Floats:
    found: Floats = u[:, 0] * v[:, 0] + u[:, 1] * v[:, 1]
    return found


def corner_jacobians(mesh: SkfemMesh) -> Floats:
    """Return the Jacobian's determinant at every corner, shape (ncells, corners).

    A cell is valid if all have the same sign; a concave cell has a corner with the other sign.
    """
    corners = cell_corners(mesh)
    slopes = shape_table(mesh.elem).gradients(mesh.elem().doflocs)
    maps: Floats = np.tensordot(corners, slopes, axes=(1, 1)).swapaxes(1, 2)  # one product
    if mesh.dim() == 2:  # for many small determinants LAPACK is ten times slower
        found: Floats = maps[..., 0, 0] * maps[..., 1, 1] - maps[..., 0, 1] * maps[..., 1, 0]
    else:
        found = np.linalg.det(maps)
    return found


def cell_measures(mesh: SkfemMesh) -> Floats:
    """Return the area (volume) of every cell, shape (ncells,), positive for valid cells."""
    jacobians = np.abs(corner_jacobians(mesh))
    measure = (1.0 / mesh.dim()) / (mesh.dim() - 1) if is_simplicial(mesh) else 1.0
    found: Floats = measure * jacobians.mean(axis=1)
    return found


def refuse_bad_cells(mesh: SkfemMesh, key: str) -> None:
    """Raise a `CaseError` for flat, concave or crossed cells, with their numbers.

    scikit-fem uses the absolute value of the Jacobian and would accept such cells.
    """
    jacobians = corner_jacobians(mesh)
    scale = np.max(np.ptp(cell_corners(mesh), axis=1), axis=1) ** mesh.dim()
    sign = np.sign(jacobians.sum(axis=1))
    bad = np.min(jacobians * sign[:, None], axis=1) <= 1e-12 * scale
    if np.any(bad):
        numbers = ", ".join(map(str, np.flatnonzero(bad)[:5]))
        problem = f"{np.count_nonzero(bad)} cells are flat, concave or crossed (cell {numbers})"
        raise CaseError(key, problem, "correct the mesh there")


# Search for the cells that contain points.


INSIDE = 1e-9
"""Largest distance outside of the reference cell at which a point counts as inside."""


class Locator:
    """Search for the cells of points in a mesh with straight edges.

    A uniform grid over the bounding box contains the cells that may intersect each bin. A point on
    a common vertex, edge or face belongs to the cell with the lowest number.
    """

    def __init__(self, mesh: SkfemMesh) -> None:
        self.map = cell_map(mesh)
        corners = cell_corners(mesh)
        self._low = mesh.p.min(axis=1)
        ncells, _, dim = corners.shape
        self._bins = int(np.ceil((4 * ncells) ** (1 / dim)))
        self._width = (mesh.p.max(axis=1) - self._low) / self._bins
        margin = 1e-6 * self._width
        first = self._bin(corners.min(axis=1) - margin)
        last = self._bin(corners.max(axis=1) + margin)
        number, cell = _boxes(first, last, self._bins)
        order = np.lexsort((cell, number))
        self._cells = cell[order]
        self._start = np.searchsorted(number[order], np.arange(self._bins**dim + 1))

    def _bin(self, points: Points) -> Ints:
        index = ((points - self._low) / self._width).astype(np.intp)
        clipped: Ints = np.minimum(np.maximum(index, 0), self._bins - 1)
        return clipped

    def find(self, points: Points) -> tuple[Ints, Points]:
        """Return the cell of each point, shape (n,), -1 if outside, and the reference points.

        Parameters
        ----------
        points : array, shape (n, dim), m
        """
        index = self._bin(points)
        number = index[:, 0]
        for axis in range(1, points.shape[1]):
            number = number * self._bins + index[:, axis]
        start = self._start[number]
        count = self._start[number + 1] - start
        owner = np.repeat(np.arange(len(points)), count)
        last = np.cumsum(count)
        place = np.arange(len(owner)) - np.repeat(last - count - start, count)
        cells = self._cells[place]
        local = self.map.invert(cells, points[owner])
        inside = np.flatnonzero(self.map.depth(local) >= -INSIDE)
        hit = inside[::-1]  # in reverse order, so that the lowest cell number remains
        found = np.full(len(points), -1)
        reference = np.zeros_like(points)
        found[owner[hit]] = cells[hit]
        reference[owner[hit]] = local[hit]
        return found, reference

    def inside(self, points: Points) -> Bools:
        """Return whether points, shape (n, dim), m, lie in the mesh, shape (n,)."""
        found: Bools = self.find(points)[0] >= 0
        return found


def _boxes(first: Ints, last: Ints, bins: int) -> tuple[Ints, Ints]:
    """Return (bin number, cell) for every bin of every cell's box of bins."""
    span = last - first + 1
    count = np.prod(span, axis=1)
    cell = np.repeat(np.arange(len(first)), count)
    rest = np.arange(len(cell)) - np.repeat(np.cumsum(count) - count, count)
    number = np.zeros(len(cell), dtype=np.intp)
    for axis in range(first.shape[1]):
        number = number * bins + first[cell, axis] + rest % span[cell, axis]
        rest = rest // span[cell, axis]
    return number, cell
