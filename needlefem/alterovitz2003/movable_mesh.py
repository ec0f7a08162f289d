"""Linear triangles whose nodes can be moved in the undeformed mesh, with their element matrices.

The mesh moves, not the tissue: a law belongs to a cell and follows its corners.
"""

import numpy as np

from needlefem._arrays import Bools, Floats, Ints, Points
from needlefem.errors import CaseError
from needlefem.fem.tissue_model import TissueModel

INSIDE = 1e-9
"""Smallest area coordinate of a point that counts as inside a cell."""


class MovableMesh:
    """Linear triangles of a tissue with moved nodes.

    Parameters
    ----------
    model : TissueModel
        Model with P1 triangles; it is not changed.

    Attributes
    ----------
    points : array, shape (nnodes, 2), m
        Present positions of the nodes.
    home : array, shape (nnodes, 2), m
    cells : array, shape (ncells, 3)
        Node numbers.
    stiffness : array, shape (ncells, 6, 6), N/m^2
        Element matrices; unknowns are ordered by node.
    mass : array, shape (ncells,), kg/m
        Row-sum mass of each corner of a cell.
    fixed : array, shape (nnodes,)
        Nodes of the outer boundary, which can't be moved.

    Raises
    ------
    CaseError
        The tissue has another element.
    """

    def __init__(self, model: TissueModel) -> None:
        if model.element.name != "P1":
            problem = f"'{model.element.name}', but only nodes of P1 triangles can be moved"
            raise CaseError("discretization.element", problem, "set it to 'P1'")
        self.home: Points = model.nodes
        self.points: Points = model.nodes.copy()
        self.cells: Ints = model.cell_nodes
        self._law: Floats = np.moveaxis(model.stiffness.law, 2, 0)
        self._density: Floats = model.density
        owner = np.argsort(self.cells.ravel(), kind="stable") // 3
        count = np.bincount(self.cells.ravel(), minlength=model.nnodes)
        self._around: list[Ints] = np.split(owner, np.cumsum(count)[:-1])
        self.fixed: Bools = np.zeros(model.nnodes, dtype=bool)
        self.fixed[_outer_nodes(self.cells)] = True
        every = np.arange(len(self.cells))
        self._areas = self._signed(self.corners(every))
        self.stiffness, self.mass = self.matrices(every, self.corners(every))
        self._home_stiffness, self._home_mass = self.stiffness.copy(), self.mass.copy()
        self._moved: dict[int, None] = {}

    def around(self, nodes: Ints) -> Ints:
        """Return the cells with at least one of the given nodes, without repetition."""
        return np.unique(np.concatenate([self._around[int(node)] for node in nodes]))

    def corners(self, cells: Ints) -> Floats:
        """Return the corners of cells, shape (n, 3, 2), m."""
        found: Floats = self.points[self.cells[cells]]
        return found

    @staticmethod
    def _signed(corners: Floats) -> Floats:
        a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        areas: Floats = 0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
        return areas

    def ratios(self, cells: Ints, corners: Floats) -> Floats:
        """Return areas relative to the original ones; negative if a cell is inverted."""
        found: Floats = self._signed(corners) / self._areas[cells]
        return found

    def matrices(self, cells: Ints, corners: Floats) -> tuple[Floats, Floats]:
        """Return element matrices, shape (n, 6, 6), and nodal masses, shape (n,).

        Parameters
        ----------
        cells : array, shape (n,)
        corners : array, shape (n, 3, 2), m
            Positions of the corners.
        """
        area = self._signed(corners)
        edge = corners[:, [2, 0, 1]] - corners[:, [1, 2, 0]]  # opposite to each corner
        gradient = np.stack([-edge[:, :, 1], edge[:, :, 0]], axis=2) / (2.0 * area)[:, None, None]
        strain = np.zeros((len(cells), 3, 6))
        strain[:, 0, 0::2] = strain[:, 2, 1::2] = gradient[:, :, 0]
        strain[:, 1, 1::2] = strain[:, 2, 0::2] = gradient[:, :, 1]
        size = np.abs(area)
        stress = self._law[cells] @ strain
        found: Floats = size[:, None, None] * (strain.transpose(0, 2, 1) @ stress)
        return found, self._density[cells] * size / 3.0

    def place(self, node: int, point: Floats) -> None:
        """Move a node and update the matrices of its cells; the original position restores them."""
        self.points[node] = point
        self._moved[node] = None
        cells = self._around[node]
        self.stiffness[cells], self.mass[cells] = self.matrices(cells, self.corners(cells))

    def restore(self, node: int) -> None:
        """Move a node back to its original position."""
        self.points[node] = self.home[node]
        self._moved.pop(node, None)
        cells = self._around[node]
        self.stiffness[cells], self.mass[cells] = self.matrices(cells, self.corners(cells))

    @property
    def moved(self) -> Ints:
        """Nodes that are not at their original positions."""
        return np.fromiter(self._moved, dtype=np.intp)

    def change(self) -> tuple[Ints, Floats, Floats]:
        """Return the changes of the matrices due to moved nodes.

        Returns
        -------
        nodes : array, shape (k,)
            All nodes of changed cells.
        stiffness : array, shape (2 k, 2 k), N/m^2
            K minus the original K, ordered by node.
        mass : array, shape (2 k,), kg/m
            The lumped M minus the original one.
        """
        if not self._moved:
            return np.zeros(0, dtype=np.intp), np.zeros((0, 0)), np.zeros(0)
        cells = self.around(self.moved)
        nodes, local = np.unique(self.cells[cells], return_inverse=True)
        local = local.reshape(-1, 3)
        stiffness = self.stiffness[cells] - self._home_stiffness[cells]
        return nodes, *gathered(local, stiffness, self.mass[cells] - self._home_mass[cells])

    def find(self, points: Points, among: Ints) -> tuple[Ints, Floats]:
        """Return the cell of each point, shape (n,), -1 outside, and its area coordinates.

        Parameters
        ----------
        points : array, shape (n, 2), m
        among : array
            Cells to be searched.
        """
        a, b, c = np.moveaxis(self.corners(among), 1, 0)
        twice = 2.0 * self._signed(self.corners(among))
        x, y = points[:, 0, None], points[:, 1, None]
        second = ((x - a[:, 0]) * (c - a)[:, 1] - (y - a[:, 1]) * (c - a)[:, 0]) / twice
        third = ((b - a)[:, 0] * (y - a[:, 1]) - (b - a)[:, 1] * (x - a[:, 0])) / twice
        least = np.minimum(np.minimum(second, third), 1.0 - second - third)
        best = np.argmax(least, axis=1)
        row = np.arange(len(points))
        second, third = second[row, best], third[row, best]
        found = np.where(least[row, best] >= -INSIDE, among[best], -1)
        return found, np.stack([1.0 - second - third, second, third], axis=1)


def gathered(local: Ints, stiffness: Floats, mass: Floats) -> tuple[Floats, Floats]:
    """Assemble element matrices densely.

    Parameters
    ----------
    local : array, shape (n, 3)
        Numbers of the cells' nodes, from 0 without gaps.
    stiffness : array, shape (n, 6, 6)
    mass : array, shape (n,)

    Returns
    -------
    Matrix, shape (2 k, 2 k), and diagonal, shape (2 k,).
    """
    return spread(dense_places(local), stiffness, mass)


def dense_places(local: Ints) -> tuple[Ints, Ints, int]:
    """Return the positions of matrix entries and masses, and the number of unknowns."""
    size = 2 * (int(local.max()) + 1)
    dofs = (2 * local[:, :, None] + np.arange(2)).reshape(-1, 6)
    return (dofs[:, :, None] * size + dofs[:, None, :]).ravel(), dofs.ravel(), size


def spread(
    places: tuple[Ints, Ints, int], stiffness: Floats, mass: Floats
) -> tuple[Floats, Floats]:
    """Assemble densely at places found before; see `gathered`."""
    entries, dofs, size = places
    matrix = np.bincount(entries, stiffness.ravel(), size * size).astype(float, copy=False)
    diagonal = np.bincount(dofs, np.repeat(mass, 6), size).astype(float, copy=False)
    return matrix.reshape(size, size), diagonal


def _outer_nodes(cells: Ints) -> Ints:
    edges = np.sort(np.concatenate([cells[:, [0, 1]], cells[:, [1, 2]], cells[:, [2, 0]]]), axis=1)
    once, count = np.unique(edges, axis=0, return_counts=True)
    return np.unique(once[count == 1])
