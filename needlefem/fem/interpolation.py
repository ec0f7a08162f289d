"""What shape functions weigh at points anywhere in the mesh."""

from functools import cached_property
from typing import NamedTuple

import numpy as np

from needlefem._arrays import Floats, Ints, Points, SkfemMesh
from needlefem._pickling import Lasting
from needlefem.elements import ElementType
from needlefem.elements.shape_functions import shape_table
from needlefem.mesh.cell_map import Inverse, Locator
from needlefem.mesh.surface import Surface


class LinearFunctionals(NamedTuple):
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


class Interpolation(Lasting):
    """Means of nodal fields over quadrature points anywhere in the tissue.

    Parameters
    ----------
    mesh : skfem.Mesh
        With straight edges.
    element : ElementType
        Element of the field.
    cell_nodes : array, shape (ncells, nodes a cell)
        Node numbers of every cell, in the element's local order.
    locator : Locator, optional
        Of the mesh, when it is there already.
    """

    def __init__(
        self,
        mesh: SkfemMesh,
        element: ElementType,
        cell_nodes: Ints,
        locator: Locator | None = None,
    ) -> None:
        self.locator = locator or Locator(mesh)
        self.shape = shape_table(element.make)
        self._mesh, self._cell_nodes = mesh, cell_nodes
        self._nnodes = int(cell_nodes.max()) + 1

    @cached_property
    def surface(self) -> Surface:
        """The surface of the tissue in which the field is."""
        return Surface(self._mesh, self.locator.inside)

    def means(self, points: Points, weights: Floats, row: Ints, nrows: int) -> LinearFunctionals:
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
        values = self.shape(reference) * (weights / total[row])[:, None]
        nodes, _, slot = self.slots(cells, row)
        return LinearFunctionals(nodes, gathered(slot, values, (nrows, len(nodes))))

    def nodes_of(self, cells: Ints) -> Ints:
        """Return the nodes of cells, shape (n, nodes a cell)."""
        found: Ints = self._cell_nodes[cells]
        return found

    def slots(self, cells: Ints, row: Ints) -> tuple[Ints, Ints, Ints]:
        """Return where points in cells add to rows over the cells' nodes.

        Parameters
        ----------
        cells : array, shape (n,)
        row : array, shape (n,)
            The row to which each point belongs.

        Returns
        -------
        nodes : array, shape (k,)
            Those of the cells, each once.
        place : array, shape (nnodes,)
            Of every node of the mesh among them; -1 for others.
        slot : array, shape (n nodes a cell,)
            Of every point and every node of its cell.
        """
        own = self.nodes_of(cells)
        place: Ints = np.full(self._nnodes, -1)
        place[own] = 0  # marks are cheaper than sorting
        nodes = (place == 0).nonzero()[0]
        place[nodes] = np.arange(len(nodes))
        return nodes, place, (row[:, None] * len(nodes) + place[own]).ravel()

    def at(self, points: Points) -> LinearFunctionals:
        """Return the functionals 'value at each point'; see `means`."""
        n = len(points)
        return self.means(points, np.ones(n), np.arange(n), n)


class Follower:
    """Means over points that move little from one call to the next.

    Most stay in their cells: these are remembered, and only what leaves its cell is looked for.

    Parameters
    ----------
    interpolation : Interpolation
    row : array, shape (n,)
        The functional to which each point belongs.
    nrows : int
        How many functionals there are.
    """

    def __init__(self, interpolation: Interpolation, row: Ints, nrows: int) -> None:
        self._interpolation, self._row, self._nrows = interpolation, row, nrows
        self._cells: Ints = np.full(len(row), -1)
        self._nodes: Ints
        self._place: Ints
        self._slot: Ints
        self._inverse: Inverse

    def means(self, points: Points, weights: Floats) -> LinearFunctionals:
        """Return weighted means of a field; the same `nodes` object while all cells are the same.

        Parameters
        ----------
        points : array, shape (n, dim), m
        weights : array, shape (n,)
            Those of every functional sum to 1, unless points lie outside (see `Interpolation`).

        Raises
        ------
        OutsideError
            A functional has no point inside the tissue.
        """
        local = self._follow(points)
        if local is None:
            return self._interpolation.means(points, weights, self._row, self._nrows)
        values = self._interpolation.shape(local) * weights[:, None]
        return LinearFunctionals(
            self._nodes, gathered(self._slot, values, (self._nrows, len(self._nodes)))
        )

    def _follow(self, points: Points) -> Points | None:
        """Return the points in their reference cells; None: some are outside the tissue."""
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
        """Find the slots over the same nodes, if the cells that are new have no others."""
        place = self._place[self._interpolation.nodes_of(self._cells)]
        if place.min() >= 0:
            self._slot = (self._row[:, None] * len(self._nodes) + place).ravel()
        else:
            self._slots_anew()

    def _slots_anew(self) -> None:
        found = self._interpolation.slots(self._cells, self._row)
        self._nodes, self._place, self._slot = found


def gathered(slot: Ints, values: Floats, shape: tuple[int, int]) -> Floats:
    """Return values added up by slot, as an array of a shape."""
    rows: Floats = np.bincount(slot, values.ravel(), shape[0] * shape[1]).astype(float, copy=False)
    return rows.reshape(shape)
