"""Where points lie in the mesh, and what shape functions weigh there."""

import dataclasses
from itertools import product

import numpy as np

from needlefem.arrays import Floats, Ints, Points, SkfemMesh
from needlefem.elements import ElementRow

INSIDE = 1e-9
"""A point counts as inside a cell when no barycentric coordinate lies below minus this."""


class Locator:
    """Finds the cell of points in an affine simplicial mesh.

    A uniform grid over the bounding box lists the cells that each bin may meet. A point on a
    shared vertex, edge or face belongs to the cell with the lowest number.
    """

    def __init__(self, mesh: SkfemMesh) -> None:
        vertices = np.moveaxis(mesh.p[:, mesh.t], 2, 0)  # (ncells, dim, corners)
        self._base = np.ascontiguousarray(vertices[:, :, 0])
        self._inverse = np.linalg.inv(vertices[:, :, 1:] - vertices[:, :, :1])
        self._low = mesh.p.min(axis=1)
        dim, ncells = mesh.p.shape[0], len(vertices)
        self._bins = int(np.ceil((4 * ncells) ** (1 / dim)))
        self._width = (mesh.p.max(axis=1) - self._low) / self._bins
        margin = 1e-6 * self._width
        first = self._bin(vertices.min(axis=2) - margin)
        last = self._bin(vertices.max(axis=2) + margin)
        number, cell = _boxes(first, last, self._bins)
        order = np.lexsort((cell, number))
        self._cells = cell[order]
        self._start = np.searchsorted(number[order], np.arange(self._bins**dim + 1))

    def _bin(self, points: Points) -> Ints:
        index = ((points - self._low) / self._width).astype(np.intp)
        clipped: Ints = np.minimum(np.maximum(index, 0), self._bins - 1)
        return clipped

    def find(self, points: Points) -> tuple[Ints, Points]:
        """Return the cell of every point, shape (n,), -1 outside, and its reference point.

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
        local = np.einsum("nij,nj->ni", self._inverse[cells], points[owner] - self._base[cells])
        least = np.minimum(local.min(axis=1, initial=np.inf), 1.0 - local.sum(axis=1))
        hit = np.flatnonzero(least >= -INSIDE)[::-1]  # reversed: the lowest cell is written last
        found = np.full(len(points), -1)
        reference = np.zeros_like(points)
        found[owner[hit]] = cells[hit]
        reference[owner[hit]] = local[hit]
        return found, reference


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


class ShapeTable:
    """Shape functions of a Lagrange element as polynomials, many points in one product.

    The coefficients are read off scikit-fem's own shape functions.
    """

    def __init__(self, element: ElementRow) -> None:
        lagrange = element.make()
        nodes = lagrange.doflocs
        degree, dim = element.degree, nodes.shape[1]
        powers = [p for p in product(range(degree + 1), repeat=dim) if sum(p) <= degree]
        self._powers = sorted(powers, key=sum)
        values = np.array([lagrange.lbasis(nodes.T, i)[0] for i in range(len(nodes))])
        self._coefficients = np.linalg.solve(self._monomials(nodes), values.T)

    def _monomials(self, points: Points) -> Floats:
        columns = [np.ones(len(points))]
        known = {self._powers[0]: columns[0]}
        for power in self._powers[1:]:
            axis = next(i for i, p in enumerate(power) if p)
            lower = tuple(p - (i == axis) for i, p in enumerate(power))
            known[power] = known[lower] * points[:, axis]
            columns.append(known[power])
        return np.stack(columns, axis=1)

    def __call__(self, reference: Points) -> Floats:
        """Return all shape functions at reference points (n, dim), shape (n, nodes)."""
        values: Floats = self._monomials(reference) @ self._coefficients
        return values


@dataclasses.dataclass(frozen=True)
class Weights:
    """Linear functionals of a nodal field: rows of weights over common nodes.

    Parameters
    ----------
    nodes : array, shape (k,)
        Node numbers, each once.
    rows : array, shape (nrows, k)
        Every functional's weight at the nodes; each row sums to 1.
    """

    nodes: Ints
    rows: Floats

    def of(self, field: Floats) -> Floats:
        """Apply the functionals to a nodal field, shape (nnodes, ...)."""
        applied: Floats = np.tensordot(self.rows, field[self.nodes], axes=1)
        return applied


class OutsideError(Exception):
    """All points of a functional lie outside the tissue."""


class Interpolation:
    """Means of nodal fields over quadrature points anywhere in the tissue.

    Parameters
    ----------
    mesh : skfem.Mesh
        An affine simplicial mesh.
    element : ElementRow
        Element of the field.
    cell_nodes : array, shape (ncells, nodes a cell)
        Node numbers of every cell, in the element's local order.
    """

    def __init__(self, mesh: SkfemMesh, element: ElementRow, cell_nodes: Ints) -> None:
        self.locator = Locator(mesh)
        self._shape = ShapeTable(element)
        self._cell_nodes = cell_nodes

    def means(self, points: Points, weights: Floats, row: Ints, nrows: int) -> Weights:
        """Return weighted means of a field over points, as functionals.

        Points outside the tissue are left out and the rest renormalised.

        Parameters
        ----------
        points : array, shape (n, dim), m
        weights : array, shape (n,)
            Quadrature weights; they need not be normalised.
        row : array, shape (n,)
            The functional to which each point belongs.
        nrows : int
            How many functionals there are.

        Raises
        ------
        OutsideError
            A functional has no point inside the tissue.
        """
        cells, reference = self.locator.find(points)
        if cells.min() < 0:
            weights = np.where(cells < 0, 0.0, weights)
        total = np.bincount(row, weights, minlength=nrows)
        if total.min() <= 0.0:
            raise OutsideError
        values = self._shape(reference) * (weights / total[row])[:, None]
        nodes, position = np.unique(self._cell_nodes[cells], return_inverse=True)
        slot = row[:, None] * len(nodes) + position.reshape(values.shape)
        rows = np.bincount(slot.ravel(), values.ravel(), nrows * len(nodes)).astype(float)
        return Weights(nodes, rows.reshape(nrows, len(nodes)))

    def at(self, points: Points) -> Weights:
        """Return the functionals 'value at each point'; see `means`."""
        n = len(points)
        return self.means(points, np.ones(n), np.arange(n), n)
