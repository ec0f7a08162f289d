"""Columns of the tissue's compliance: from the whole factor, or from a condensed corridor.

A needle touches a corridor alone. With the corridor's inner equations i, those around them b and
everything else, the blocks of A^-1 that it needs follow from the compliance of b and from the
corridor's own matrix (static condensation; R. J. Guyan, AIAA Journal 3, 1965)::

    (A^-1)_ii = A_ii^-1 + G (A^-1)_bb G',   G = A_ii^-1 A_ib

The whole factor is asked for the few columns b only, however many nodes the needle touches in
the corridor and whatever its radius or friction; nothing is subtracted, so no digits are lost.
"""

from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np

from needlefem._arrays import Bools, Floats, Ints, Points, Vector
from needlefem.fem.factorization import Factor, factorise
from needlefem.fem.tissue_model import TissueModel

BLOCK = 64
"""Right-hand sides solved at once: larger blocks gain nothing and cost memory."""


class InverseColumns(Protocol):
    """A way to columns of A^-1.

    Attributes
    ----------
    way : str
        What it is called.
    """

    way: str

    @property
    def solves(self) -> int:
        """Back-substitutions with the whole factor so far."""
        ...

    def between(self, rows: Ints, columns: Ints) -> Floats:
        """Return A^-1 between equations, shape (len(rows), len(columns)), m/N."""
        ...


class InverseColumnsOnDemand:
    """Columns from the whole factor, one back-substitution each; see `InverseColumns`."""

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
    """Where needles are expected: around a line.

    Parameters
    ----------
    begin, end : array, shape (dim,), m
    halfwidth : float, m
    """

    begin: Vector
    end: Vector
    halfwidth: float

    def places(self, points: Points) -> Points:
        """Return coordinates along the line, and what is left across it, shape (n, 1 + dim), m."""
        line = self.end - self.begin
        direction = line / np.linalg.norm(line)
        along = points @ direction
        return np.column_stack([along, points - along[:, None] * direction])


def coupled_equations(model: TissueModel, inner: Bools) -> Bools:
    """Return whether equations couple to inner ones from outside, shape (nequations,).

    Parameters
    ----------
    model : TissueModel
    inner : array, shape (nequations,)
        Whether an equation is an inner one.
    """
    rows = model.stiffness.matrix.tocsr()[model.free_dofs[inner]]
    found: Bools = np.isin(model.free_dofs, rows.indices) & ~inner
    return found


# Kernel: inverse of the operator within a corridor.
#     (A^-1)_ii = A_ii^-1 + G (A^-1)_bb G^T,    G = A_ii^-1 A_ib
# i, b  equations inside of the corridor, and those coupled to them from outside
# A     operator of the tissue, N/m (Pa in 2D)
# Source: static condensation, R. J. Guyan, AIAA Journal 3 (1965) 380.
class StaticCondensation:
    """Some equations, condensed: the rest is seen through what lies around them.

    Parameters
    ----------
    model : TissueModel
        With a definite element; its K is the operator.
    whole : InverseColumnsOnDemand
    inner : array, shape (nequations,)
        Whether an equation is among them.
    """

    def __init__(self, model: TissueModel, whole: InverseColumnsOnDemand, inner: Bools) -> None:
        self.inner = inner
        own = model.free_dofs[inner]
        self._place: Ints = np.cumsum(inner) - 1
        rows = model.stiffness.matrix.tocsr()[own]
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
    """Columns from a corridor that is condensed, and anew when a needle leaves it.

    Parameters
    ----------
    model : TissueModel
        With a definite element; its K is the operator.
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
        """Return whether equations belong to the corridor, shape (nequations,)."""
        inside = np.all((self._places >= self._low) & (self._places <= self._high), axis=1)
        found: Bools = inside[self._node]
        return found

    def _widen(self, equations: Ints) -> None:
        places = self._places[self._node[equations]]
        outside = np.any((places < self._low) | (places > self._high), axis=1)
        if np.any(outside):
            self._low = np.minimum(self._low, places[outside].min(axis=0) - self._room)
            self._high = np.maximum(self._high, places[outside].max(axis=0) + self._room)
