"""An operator that changes in a few rows, ``A = A0 + S``, and its responses.

Two ways: a low-rank correction of the factor of A0 (K. Woodbury 1950) or a new factor. S is
dense on the unknowns of the nodes that changed.
"""

from typing import Protocol

import numpy as np
from scipy.sparse import csc_array

from needlefem._arrays import Floats, Ints, Sparse
from needlefem.fem.compliance import CachedCompliance
from needlefem.fem.factorization import Factor, factorise
from needlefem.fem.tissue_model import TissueModel


class Equations:
    """Values of unknowns at nodes and loads on them; zero where the tissue is held."""

    def __init__(self, model: TissueModel) -> None:
        number = np.full(model.ndofs, -1)
        number[model.free_dofs] = np.arange(len(model.free_dofs))
        self._table: Ints = number[model.node_dofs]
        self.size = len(model.free_dofs)

    def of(self, nodes: Ints) -> Ints:
        """Return the equations of nodes, node-major; -1 where held."""
        found: Ints = self._table[nodes].ravel()
        return found

    def at(self, x: Floats, nodes: Ints) -> Floats:
        """Return unknowns, shape (..., size), at nodes, shape (..., 2 k)."""
        equations = self.of(nodes)
        found: Floats = np.where(equations >= 0, x[..., equations], 0.0)
        return found

    def add(self, target: Floats, nodes: Ints, loads: Floats) -> None:
        """Add loads, shape (2 k,), on nodes (each once) to a vector of unknowns."""
        equations = self.of(nodes)
        free = equations >= 0
        target[equations[free]] += loads[free]


class Corrected(Protocol):
    """Responses of ``A0 + S`` at functionals; one solution at a time, begun and finished."""

    def correct(self, nodes: Ints, change: Floats) -> None:
        """Take another S, shape (2 k, 2 k), on these nodes."""
        ...

    def attach(self, nodes: Ints, loads: Floats) -> Floats:
        """Look at functionals, shape (r, 2 k), of nodes; return their compliance, (r, r)."""
        ...

    def start(self, rhs: Floats) -> Floats:
        """Return the functionals' values for a right-hand side, shape (r,)."""
        ...

    def finish(self, forces: Floats) -> Floats:
        """Return all unknowns for that right-hand side and forces on the functionals."""
        ...


class LowRank:
    """One factor of A0 for all corrections; see `Corrected`.

    ``inv(A) = inv(A0) - inv(A0) T inv(A0)`` with ``T = inv(I + S C) S``, where C is the
    compliance of A0 between the changed unknowns.

    Parameters
    ----------
    model : TissueModel
    factor : Factor
        Of A0.
    responses : CachedCompliance
        Of the same factor; shared by all that touch the same nodes.
    """

    def __init__(self, model: TissueModel, factor: Factor, responses: CachedCompliance) -> None:
        self._equations, self._factor, self._responses = Equations(model), factor, responses
        self._changed: Ints = np.zeros(0, dtype=np.intp)
        self._t: Floats = np.zeros((0, 0))

    def correct(self, nodes: Ints, change: Floats) -> None:
        """See `Corrected`."""
        self._changed = nodes
        rows = self._responses.rows(nodes)
        compliance = self._responses.compliance[np.ix_(rows, rows)]
        found: Floats = np.linalg.solve(np.eye(len(rows)) + change @ compliance, change).astype(
            float, copy=False
        )
        self._t = 0.5 * (found + found.T)

    def attach(self, nodes: Ints, loads: Floats) -> Floats:
        """See `Corrected`."""
        self._nodes, self._loads = nodes, loads
        mine, changed = self._responses.rows(nodes), self._responses.rows(self._changed)
        compliance = self._responses.compliance
        self._cross = loads @ compliance[np.ix_(mine, changed)]
        bare = loads @ compliance[np.ix_(mine, mine)] @ loads.T
        corrected: Floats = bare - self._cross @ self._t @ self._cross.T
        return corrected

    def start(self, rhs: Floats) -> Floats:
        """See `Corrected`."""
        self._bare = self._factor.solve(rhs)
        self._pull = self._t @ self._equations.at(self._bare, self._changed)
        values: Floats = self._loads @ self._equations.at(self._bare, self._nodes)
        return values - self._cross @ self._pull

    def finish(self, forces: Floats) -> Floats:
        """See `Corrected`."""
        load = np.zeros(self._equations.size)
        self._equations.add(load, self._nodes, self._loads.T @ forces)
        pull = self._pull + self._t @ (self._cross.T @ forces)
        self._equations.add(load, self._changed, -pull)
        return self._bare + self._factor.solve(load)


class Refactored:
    """A new factor for every correction; see `Corrected`.

    Parameters
    ----------
    model : TissueModel
    matrix : sparse matrix
        A0 on the free unknowns.
    """

    def __init__(self, model: TissueModel, matrix: Sparse) -> None:
        self._equations, self._matrix = Equations(model), csc_array(matrix)
        self._factor: Factor = factorise(self._matrix)

    def correct(self, nodes: Ints, change: Floats) -> None:
        """See `Corrected`."""
        equations = self._equations.of(nodes)
        free = np.flatnonzero(equations >= 0)
        rows, columns = np.repeat(equations[free], len(free)), np.tile(equations[free], len(free))
        entries = change[np.ix_(free, free)].ravel()
        shape = self._matrix.shape
        self._factor = factorise(self._matrix + csc_array((entries, (rows, columns)), shape=shape))

    def attach(self, nodes: Ints, loads: Floats) -> Floats:
        """See `Corrected`."""
        self._nodes, self._loads = nodes, loads
        columns = np.zeros((self._equations.size, len(loads)))
        for column, load in enumerate(loads):
            self._equations.add(columns[:, column], nodes, load)
        columns = self._factor.solve(columns)
        found: Floats = self._loads @ self._equations.at(columns.T, nodes).T
        return 0.5 * (found + found.T)

    def start(self, rhs: Floats) -> Floats:
        """See `Corrected`."""
        self._bare = self._factor.solve(rhs)
        values: Floats = self._loads @ self._equations.at(self._bare, self._nodes)
        return values

    def finish(self, forces: Floats) -> Floats:
        """See `Corrected`."""
        load = np.zeros(self._equations.size)
        self._equations.add(load, self._nodes, self._loads.T @ forces)
        return self._bare + self._factor.solve(load)
