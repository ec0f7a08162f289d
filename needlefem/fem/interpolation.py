"""Interpolation of nodal fields: weights of the shape functions at arbitrary points."""

from functools import cached_property
from typing import NamedTuple

import numpy as np

from needlefem._arrays import Floats, Ints, Points, SkfemMesh
from needlefem.elements import ElementType
from needlefem.elements.shape_functions import shape_table
from needlefem.fem.factorization import Lasting
from needlefem.mesh.cell_map import Inverse, Locator
from needlefem.mesh.surface import Surface


class LinearFunctionals(NamedTuple):
    """Linear functionals of a nodal field: one row of weights each over common nodes.

    Parameters
    ----------
    nodes : array, shape (k,)
        Node numbers without repetition.
    rows : array, shape (nrows, k)
        Weights of each functional at the nodes; the sum of each row is 1.
    """

    nodes: Ints
    rows: Floats

    def of(self, field: Floats) -> Floats:
        """Return the functionals' values for a nodal field, shape (nnodes, ...)."""
        applied: Floats = np.tensordot(self.rows, field[self.nodes], axes=1)
        return applied


class OutsideError(Exception):
    """All points of a functional lie outside the tissue."""


class Interpolation(Lasting):
    """Means of nodal fields over quadrature points at arbitrary positions in the tissue.

    Parameters
    ----------
    mesh : skfem.Mesh
        With straight edges.
    element : ElementType
        Element of the field.
    cell_nodes : array, shape (ncells, nodes a cell)
        Node numbers of each cell in the element's local order.
    locator : Locator, optional
        An existing point search for the mesh.
    """

    def __init__(
        self,
        mesh: SkfemMesh,
        element: ElementType,
        cell_nodes: Ints,
        locator: Locator | None = None,
    ) -> None:
        self.locator = locator or Locator(mesh)
        self.shape = shape_table(element.skfem_element)
        self._mesh, self._cell_nodes = mesh, cell_nodes
        self._nnodes = int(cell_nodes.max()) + 1

    @cached_property
    def surface(self) -> Surface:
        """Surface of the mesh."""
        return Surface(self._mesh, self.locator.inside)

    def means(self, points: Points, weights: Floats, row: Ints, nrows: int) -> LinearFunctionals:
        """Return weighted means of a field over points, as functionals.

        Points outside of the tissue are omitted, and the remaining weights are renormalised.

        Parameters
        ----------
        points : array, shape (n, dim), m
        weights : array, shape (n,)
            Quadrature weights; they need not be normalised.
        row : array, shape (n,)
            The functional to which each point belongs.
        nrows : int
            Number of functionals.

        Raises
        ------
        OutsideError
            All points of a functional are outside of the tissue.
        """
        cells, reference = self.locator.find(points)
        if cells.min() < 0:
            weights = np.where(cells < 0, 0.0, weights)
        total = np.bincount(row, weights, minlength=nrows)
        if total.min() <= 0.0:
            raise OutsideError
        values = self.shape(reference) * (weights / total[row])[:, None]
        nodes, _, slot = self.slots(cells, row)
        return LinearFunctionals(nodes, gathered(slot, values, (nrows, len(nodes))))

    def nodes_of(self, cells: Ints) -> Ints:
        """Return the nodes of cells, shape (n, nodes a cell)."""
        found: Ints = self._cell_nodes[cells]
        return found

    def slots(self, cells: Ints, row: Ints) -> tuple[Ints, Ints, Ints]:
        """Return the positions to which the shape functions of points contribute.

        Parameters
        ----------
        cells : array, shape (n,)
        row : array, shape (n,)
            The row to which each point belongs.

        Returns
        -------
        nodes : array, shape (k,)
            Nodes of the cells without repetition.
        place : array, shape (nnodes,)
            Position of each node of the mesh in `nodes`; -1 for all others.
        slot : array, shape (n nodes a cell,)
            Position in the flattened rows, for each point and each node of its cell.
        """
        own = self.nodes_of(cells)
        place: Ints = np.full(self._nnodes, -1)
        place[own] = 0  # marking is faster than sorting
        nodes = (place == 0).nonzero()[0]
        place[nodes] = np.arange(len(nodes))
        return nodes, place, (row[:, None] * len(nodes) + place[own]).ravel()

    def at(self, points: Points) -> LinearFunctionals:
        """Return the functionals 'value at each point'; see `means`."""
        n = len(points)
        return self.means(points, np.ones(n), np.arange(n), n)


class Follower:
    """Means over points that move by small distances between calls.

    The cell of each point is stored. Only points that leave their cell are searched for.

    Parameters
    ----------
    interpolation : Interpolation
    row : array, shape (n,)
        The functional to which each point belongs.
    nrows : int
        Number of functionals.
    """

    def __init__(self, interpolation: Interpolation, row: Ints, nrows: int) -> None:
        self._interpolation, self._row, self._nrows = interpolation, row, nrows
        self._cells: Ints = np.full(len(row), -1)
        self._nodes: Ints
        self._place: Ints
        self._slot: Ints
        self._inverse: Inverse

    def means(self, points: Points, weights: Floats) -> LinearFunctionals:
        """Return weighted means of a field; `nodes` is the same object while no cell changes.

        Parameters
        ----------
        points : array, shape (n, dim), m
        weights : array, shape (n,)
            Weights; the sum for each functional is 1 if all its points are in the tissue.

        Raises
        ------
        OutsideError
            All points of a functional are outside of the tissue.
        """
        local = self._follow(points)
        if local is None:
            return self._interpolation.means(points, weights, self._row, self._nrows)
        values = self._interpolation.shape(local) * weights[:, None]
        return LinearFunctionals(
            self._nodes, gathered(self._slot, values, (self._nrows, len(self._nodes)))
        )

    def _follow(self, points: Points) -> Points | None:
        """Return the points in their reference cells, or None if some are outside of the tissue."""
        locator = self._interpolation.locator
        known = self._cells[0] >= 0
        local = self._inverse(points) if known else points
        gone = (locator.map.depth(local) < 0.0).nonzero()[0] if known else np.arange(len(points))
        if gone.size:
            found, reference = locator.find(points[gone])
            if found.min() < 0:
                self._cells[0] = -1
                return None
            if not known or (found != self._cells[gone]).any():
                self._cells[gone] = found
                self._inverse = locator.map.inverse(self._cells)
                if known:
                    self._slot_again()
                else:
                    self._slots_anew()
            if not known:
                return reference
            local[gone] = reference
        return local

    def _slot_again(self) -> None:
        """Update the slots if the new cells have no nodes outside of the present set."""
        place = self._place[self._interpolation.nodes_of(self._cells)]
        if place.min() >= 0:
            self._slot = (self._row[:, None] * len(self._nodes) + place).ravel()
        else:
            self._slots_anew()

    def _slots_anew(self) -> None:
        found = self._interpolation.slots(self._cells, self._row)
        self._nodes, self._place, self._slot = found


def gathered(slot: Ints, values: Floats, shape: tuple[int, int]) -> Floats:
    """Return the sums of the values with equal slots, as an array of a given shape."""
    rows: Floats = np.bincount(slot, values.ravel(), shape[0] * shape[1]).astype(float, copy=False)
    return rows.reshape(shape)
