"""What shape functions weigh at points anywhere in the mesh."""

import dataclasses

import numpy as np

from needlefem.arrays import Floats, Ints, Points, SkfemMesh
from needlefem.elements import ElementRow
from needlefem.fem.locate import Locator
from needlefem.fem.shapes import ShapeTable


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
        With straight edges.
    element : ElementRow
        Element of the field.
    cell_nodes : array, shape (ncells, nodes a cell)
        Node numbers of every cell, in the element's local order.
    """

    def __init__(self, mesh: SkfemMesh, element: ElementRow, cell_nodes: Ints) -> None:
        self.locator = Locator(mesh)
        self._shape = ShapeTable(element.make())
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
