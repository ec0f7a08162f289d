"""Compliance of the tissue at the nodes that the needle touches.

The needle touches nodes in a narrow corridor only. Let i be the equations inside of this corridor
and b the equations outside of it that couple to i. By static condensation (R. J. Guyan, AIAA
Journal 3, 1965) the blocks of A^-1 follow from the compliance of b and from the corridor's own
matrix::

    (A^-1)_ii = A_ii^-1 + G (A^-1)_bb G',   G = A_ii^-1 A_ib

The factor of the whole operator is needed for the few columns b only. Their number does not depend
on the number of nodes that the needle touches, on its radius or on its friction. The formula
contains no difference of large numbers, so that no digits are lost.

Two operators return the same numbers. `CachedCompliance` stores the dense compliance matrix between
all nodes that needles have touched so far; its cost is low if these nodes are few, and insertions
share it. `DirectCompliance` makes one back-substitution for each load; its cost is lower if the
nodes are many.
"""

from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np

from needlefem._arrays import Bools, Floats, Ints, Points, Vector
from needlefem.fem.factorization import Factor, factorise
from needlefem.fem.function_space import NodalFrames
from needlefem.fem.tissue_model import TissueModel

BLOCK = 64
"""Right-hand sides solved at once. Larger blocks are not faster and need more memory."""


class InverseColumns(Protocol):
    """Computes columns of A^-1.

    Attributes
    ----------
    way : str
        Name of the method.
    """

    way: str

    @property
    def solves(self) -> int:
        """Number of back-substitutions with the factor of the whole operator so far."""
        ...

    def between(self, rows: Ints, columns: Ints) -> Floats:
        """Return A^-1 between equations, shape (len(rows), len(columns)), m/N."""
        ...


class InverseColumnsOnDemand:
    """Columns by one back-substitution each with the whole factor; see `InverseColumns`."""

    way = "columns for all nodes touched"

    def __init__(self, factor: Factor, unknowns: int) -> None:
        self._factor, self._unknowns = factor, unknowns
        self._solved = 0

    @property
    def solves(self) -> int:
        """See `InverseColumns`."""
        return self._solved

    def between(self, rows: Ints, columns: Ints) -> Floats:
        """See `InverseColumns`."""
        found = np.zeros((len(rows), len(columns)))
        for start in range(0, len(columns), BLOCK):
            some = columns[start : start + BLOCK]
            rhs = np.zeros((self._unknowns, len(some)), order="F")
            rhs[some, np.arange(len(some))] = 1.0
            found[:, start : start + BLOCK] = self._factor.solve(rhs)[rows]
        self._solved += len(columns)
        return found


class Corridor(NamedTuple):
    """The region of the expected needles: all points near a line segment.

    Parameters
    ----------
    begin, end : array, shape (dim,), m
    halfwidth : float, m
    """

    begin: Vector
    end: Vector
    halfwidth: float

    def places(self, points: Points) -> Points:
        """Return coordinates along the line and the vectors across it, shape (n, 1 + dim), m."""
        line = self.end - self.begin
        direction = line / np.linalg.norm(line)
        along = points @ direction
        return np.column_stack([along, points - along[:, None] * direction])


def coupled_equations(model: TissueModel, inner: Bools) -> Bools:
    """Return whether equations outside couple to inner ones, shape (nequations,).

    Parameters
    ----------
    model : TissueModel
    inner : array, shape (nequations,)
        Whether an equation is an inner one.
    """
    rows = model.local_matrix(model.stiffness.matrix.tocsr())[model.free_dofs[inner]]
    found: Bools = np.isin(model.free_dofs, rows.indices) & ~inner
    return found


# Kernel: inverse of the operator within a corridor.
#     (A^-1)_ii = A_ii^-1 + G (A^-1)_bb G^T,    G = A_ii^-1 A_ib
# i, b  equations inside of the corridor, and those coupled to them from outside
# A     operator of the tissue, N/m (Pa in 2D)
# Source: static condensation, R. J. Guyan, AIAA Journal 3 (1965) 380.
class StaticCondensation:
    """Inverse of the operator on some equations by static condensation of all others.

    Parameters
    ----------
    model : TissueModel
        With a positive definite element; the operator is its K.
    whole : InverseColumnsOnDemand
        Columns of the inverse of the whole operator.
    inner : array, shape (nequations,)
        Whether an equation is an inner one.
    """

    def __init__(self, model: TissueModel, whole: InverseColumnsOnDemand, inner: Bools) -> None:
        self.inner = inner
        own = model.free_dofs[inner]
        self._place: Ints = np.cumsum(inner) - 1
        rows = model.local_matrix(model.stiffness.matrix.tocsr())[own]
        coupled = coupled_equations(model, inner)
        link = rows[:, model.free_dofs[coupled]].toarray(order="F")
        self._factor = factorise(rows[:, own])
        self._reach: Floats = self._factor.solve(link)
        around = np.flatnonzero(coupled)
        compliance = whole.between(around, around)
        self._beyond: Floats = self._reach @ (0.5 * (compliance + compliance.T))

    def between(self, rows: Ints, columns: Ints) -> Floats:
        """Return A^-1 between inner equations, shape (len(rows), len(columns)), m/N."""
        own, others = self._place[rows], self._place[columns]
        near = InverseColumnsOnDemand(self._factor, len(self._reach)).between(own, others)
        found: Floats = near + self._beyond[own] @ self._reach[others].T
        return found


class CondensedCorridor:
    """Columns from a condensed corridor, which is enlarged if a needle leaves it.

    Parameters
    ----------
    model : TissueModel
        With a positive definite element; the operator is its K.
    corridor : Corridor
    """

    way = "a condensed corridor"

    def __init__(self, model: TissueModel, corridor: Corridor) -> None:
        self._model, self._room = model, corridor.halfwidth
        self._node: Ints = model.node_of[model.free_dofs]
        self._places: Floats = corridor.places(model.nodes)
        ends = corridor.places(np.array([corridor.begin, corridor.end]))
        self._low = ends.min(axis=0) - self._room
        self._high = ends.max(axis=0) + self._room
        self._condensed: StaticCondensation | None = None

    @cached_property
    def _whole(self) -> InverseColumnsOnDemand:
        return InverseColumnsOnDemand(self._model.factor, len(self._model.free_dofs))

    @property
    def solves(self) -> int:
        """See `InverseColumns`."""
        return self._whole.solves

    def between(self, rows: Ints, columns: Ints) -> Floats:
        """See `InverseColumns`."""
        equations = np.concatenate([rows, columns])
        if self._condensed is None or not np.all(self._condensed.inner[equations]):
            self._widen(equations)
            self._condensed = StaticCondensation(self._model, self._whole, self.inner())
        return self._condensed.between(rows, columns)

    def inner(self) -> Bools:
        """Return whether equations are inside of the corridor, shape (nequations,)."""
        inside = np.all((self._places >= self._low) & (self._places <= self._high), axis=1)
        found: Bools = inside[self._node]
        return found

    def _widen(self, equations: Ints) -> None:
        places = self._places[self._node[equations]]
        outside = np.any((places < self._low) | (places > self._high), axis=1)
        if np.any(outside):
            self._low = np.minimum(self._low, places[outside].min(axis=0) - self._room)
            self._high = np.maximum(self._high, places[outside].max(axis=0) + self._room)


ALL = slice(None)
AHEAD = 2.0
"""Distance ahead of a needle that is solved for in one block, in half-widths of the corridor."""


class ComplianceColumns(Protocol):
    """Displacement for given loads."""

    def at(self, rows: Ints) -> Floats:
        """Return the displacement of rows, shape (nrows, nloads), m."""
        ...

    def after(self, start: int, some: slice = ALL) -> Floats:
        """Return it for some loads on the rows from `start` on, shape (size - start, nsome), m."""
        ...


class ComplianceOperator(Protocol):
    """Displacement of touched nodes under loads for one operator A; shared by insertions.

    Attributes
    ----------
    size : int
        Number of rows so far. It may grow; existing rows keep their numbers.
    way : str
        Name of the method.
    frames : NodalFrames or None
        Frames in which the rows of some nodes are components; all others are along the axes.
    """

    size: int
    way: str
    frames: NodalFrames | None

    @property
    def solves(self) -> int:
        """Number of right-hand sides that were solved with the whole factor so far."""
        ...

    def rows(self, nodes: Ints) -> Ints:
        """Return the rows of nodes, ordered by node, shape (len(nodes) dim,)."""
        ...

    def respond(self, rows: Ints, loads: Floats) -> ComplianceColumns:
        """Return the displacement for loads, shape (nloads, len(rows)), on given rows."""
        ...


class _Equations:
    """Equation (row of A) of the dofs of each node; -1 for a fixed dof."""

    def __init__(self, model: TissueModel) -> None:
        equation = np.full(model.ndofs, -1)
        equation[model.free_dofs] = np.arange(len(model.free_dofs))
        self._table: Ints = equation[model.node_dofs]

    def of(self, nodes: Ints) -> Ints:
        found: Ints = self._table[nodes].ravel()
        return found


# Kernel: compliance between the nodes that the needle touches.
#     W = B A^-1 B^T,    A^-1 by columns of the factorised operator
# A  operator of the tissue on its free equations: K, or that of a time step, N/m (Pa in 2D)
# B  rows of weights of the functionals over the nodes
# Source: M. Bro-Nielsen, S. Cotin, Computer Graphics Forum 15 (1996) 57 (condensation);
# S. P. DiMaio, S. E. Salcudean, IEEE Trans. Robot. Autom. 19 (2003) 864 (needle insertion).
class CachedCompliance:
    """Dense compliance between all nodes that were touched so far; it grows on demand.

    Parameters
    ----------
    model : TissueModel
        The tissue.
    factor : Factor, optional
        Factorisation of the operator A on the free dofs; the factor of K by default.
    columns : InverseColumns, optional
        Source of the columns of A^-1; the factor by default.
    corridor : Corridor, optional
        Region of the needles. Nodes ahead of a needle in it are solved for in blocks.
    """

    def __init__(
        self,
        model: TissueModel,
        factor: Factor | None = None,
        columns: InverseColumns | None = None,
        corridor: Corridor | None = None,
    ) -> None:
        if columns is None:
            columns = InverseColumnsOnDemand(factor or model.factor, len(model.free_dofs))
        self._columns, self._dim = columns, model.dim
        self._ahead = 0.0 if corridor is None else AHEAD * corridor.halfwidth
        self._places: Floats = model.nodes if corridor is None else corridor.places(model.nodes)
        self.way, self.frames = columns.way, model.frames
        self._equations = _Equations(model)
        self._slot: Ints = np.full(model.nnodes, -1)
        self._nodes: Ints = np.zeros(0, dtype=np.intp)
        self._store = np.zeros((0, 0))
        self.size = 0
        # consecutive requests often concern the same nodes around the tip
        self._asked = self._rows = self._among = self._nodes
        self._block = self._store

    @property
    def solves(self) -> int:
        """See `ComplianceOperator`."""
        return self._columns.solves

    @property
    def compliance(self) -> Floats:
        """Displacement for unit forces between all rows, shape (size, size), m/N.

        Rows and columns of fixed dofs are zero.
        """
        return self._store[: self.size, : self.size]

    def rows(self, nodes: Ints) -> Ints:
        """See `ComplianceOperator`; the columns of new nodes are computed."""
        if nodes is not self._asked:
            slots = self._slot[nodes]
            if slots.min(initial=0) < 0:
                self._touch(self._foreseen(nodes))
                slots = self._slot[nodes]
            self._asked = nodes
            self._rows = (slots[:, None] * self._dim + np.arange(self._dim)).ravel()
        return self._rows

    def among(self, rows: Ints) -> Floats:
        """Return the compliance between rows, shape (len(rows), len(rows)), m/N."""
        if rows is not self._among:
            self._among, self._block = rows, self.compliance[rows[:, None], rows]
        return self._block

    def respond(self, rows: Ints, loads: Floats) -> ComplianceColumns:
        """See `ComplianceOperator`."""
        return _CachedColumns(self, rows, loads)

    def _foreseen(self, nodes: Ints) -> Ints:
        """Return those of the nodes, and of the nodes ahead of them, that are not cached yet."""
        if not self._ahead:
            return nodes[self._slot[nodes] < 0]
        near = self._places[nodes]
        low, high = near.min(axis=0), near.max(axis=0)
        high[0] += self._ahead
        wanted = np.all((self._places >= low) & (self._places <= high), axis=1)
        return np.flatnonzero(wanted & (self._slot < 0))

    def _touch(self, new: Ints) -> None:
        before = self.size
        self._slot[new] = len(self._nodes) + np.arange(len(new))
        self._nodes = np.concatenate([self._nodes, new])
        self.size = len(self._nodes) * self._dim
        self._reserve()
        known = self._equations.of(self._nodes)
        rows = np.flatnonzero(known >= 0)
        columns = rows[np.searchsorted(rows, before) :]
        self._store[rows[:, None], columns] = self._columns.between(known[rows], known[columns])
        fresh = self._store[before : self.size, before : self.size]
        fresh[:] = 0.5 * (fresh + fresh.T)
        self._store[before : self.size, :before] = self._store[:before, before : self.size].T

    def _reserve(self) -> None:
        if self.size > len(self._store):
            old = self._store
            self._store = np.zeros((int(1.5 * self.size), int(1.5 * self.size)))
            self._store[: len(old), : len(old)] = old


class _CachedColumns:
    def __init__(self, shared: CachedCompliance, rows: Ints, loads: Floats) -> None:
        self._shared, self._rows, self._loads = shared, rows, loads

    def at(self, rows: Ints) -> Floats:
        if rows is self._rows:
            return self._shared.among(rows) @ self._loads.T
        return self._shared.compliance[rows[:, None], self._rows] @ self._loads.T

    def after(self, start: int, some: slice = ALL) -> Floats:
        loads = self._loads[some]
        used = np.flatnonzero(np.any(loads, axis=0))
        # the matrix is symmetric: reading rows is faster, because they are contiguous in memory
        found: Floats = loads[:, used] @ self._shared.compliance[self._rows[used], start:]
        return found.T


class DirectCompliance:
    """One back-substitution per load on all equations; parameters as for `CachedCompliance`."""

    way = "one back-substitution a load"

    def __init__(self, model: TissueModel, factor: Factor | None = None) -> None:
        self._factor = factor if factor is not None else model.factor
        self._equations, self.frames = _Equations(model), model.frames
        self.size = len(model.free_dofs) + 1  # the last row represents all fixed dofs
        self._solved = 0

    @property
    def solves(self) -> int:
        """See `ComplianceOperator`."""
        return self._solved

    def rows(self, nodes: Ints) -> Ints:
        """See `ComplianceOperator`."""
        return self._equations.of(nodes) % self.size

    def respond(self, rows: Ints, loads: Floats) -> ComplianceColumns:
        """See `ComplianceOperator`."""
        rhs = np.zeros((self.size, len(loads)), order="F")
        rhs[rows] = loads.T
        rhs[-1] = 0.0
        rhs[:-1] = self._factor.solve(rhs[:-1])
        self._solved += len(loads)
        return _DirectColumns(rhs)


class _DirectColumns:
    def __init__(self, field: Floats) -> None:
        self._field = field

    def at(self, rows: Ints) -> Floats:
        found: Floats = self._field[rows]
        return found

    def after(self, start: int, some: slice = ALL) -> Floats:
        return self._field[start:, some]
