"""Factorisations of the step operator behind one interface.

SuperLU comes with scipy and does everything. CHOLMOD (extra `cholmod`) halves the fill of definite
matrices and solves blocks several times faster; it is taken where it is installed and the matrix
is large enough to pay for its import (``needlefem bench solvers``).
"""

import functools
from importlib import import_module
from typing import Any, Protocol

import numpy as np
from scipy.sparse import csr_array, eye_array
from scipy.sparse.linalg import spilu, splu

from needlefem._arrays import Floats, Ints, Sparse
from needlefem._progress import doing
from needlefem.errors import SimulationError

PIVOT = 0.1
"""Least size of a pivot on the diagonal, relative to its column, in indefinite matrices."""
FEWEST_FOR_CHOLMOD = 5_000
"""Unknowns below which both cost the same and SuperLU needs no import."""
FEWEST_FOR_GROUPS = 50_000
"""Unknowns from which on ordering nodes is cheaper than ordering unknowns."""
WEAK = 1e-3
"""Couplings of nodes as they are ordered: their number counts, not their size."""


class Factor(Protocol):
    """A factorised matrix."""

    @property
    def name(self) -> str:
        """Who factorised it, and how."""
        ...

    def solve(self, rhs: Floats) -> Floats:
        """Return the solution for one right-hand side (n,) or a block of them (n, k)."""
        ...


def factorise(
    matrix: Sparse, *, definite: bool = True, backend: str = "auto", groups: Ints | None = None
) -> Factor:
    """Factorise a symmetric sparse matrix, positive definite unless said otherwise.

    Parameters
    ----------
    matrix : sparse
        Rows should be alike in size.
    definite : bool
    backend : str
        ``"superlu"``, ``"cholmod"`` (definite matrices only), or the cheaper of those installed.
    groups : array, shape (n,), optional
        Number of the node, or of what else couples as one, that every unknown belongs to.

    Raises
    ------
    SimulationError
        The matrix is singular (for CHOLMOD: not positive definite), or has entries that are not
        finite.
    """
    doing(f"factorising {matrix.shape[0]:,} unknowns")
    if not np.all(np.isfinite(matrix.data)):
        raise SimulationError("the system matrix has entries that are not finite")
    large = matrix.shape[0] >= FEWEST_FOR_CHOLMOD
    if backend == "cholmod" or (backend == "auto" and definite and large and cholmod()):
        return CholmodFactor(matrix)
    if groups is not None and matrix.shape[0] >= FEWEST_FOR_GROUPS:
        return GroupedFactor(matrix, groups, definite=definite)
    return SuperLUFactor(matrix, definite=definite)


class SuperLUFactor:
    """SuperLU in the minimum-degree order of A + A^T; see `Factor`.

    Half the fill of its default for definite matrices, without pivots, and a third for indefinite
    ones with a pivot off the diagonal where that is less than a tenth of its column.
    """

    name = "SuperLU, symmetric, minimum degree"

    def __init__(self, matrix: Sparse, *, definite: bool = True, ordered: bool = False) -> None:
        try:
            self._factor = splu(
                matrix.tocsc(),
                permc_spec="NATURAL" if ordered else "MMD_AT_PLUS_A",
                diag_pivot_thresh=0.0 if definite else PIVOT,
                options={"SymmetricMode": True},
            )
        except RuntimeError as error:
            raise SimulationError(f"the system matrix can't be factorised: {error}") from error
        self.solve = self._factor.solve

    @property
    def entries(self) -> int:
        """Entries of both factors."""
        return int(self._factor.L.nnz + self._factor.U.nnz)


class GroupedFactor:
    """SuperLU, for which nodes are ordered and not their unknowns; see `Factor`.

    The order is of the same kind, but SuperLU spends most of its time on it where there are many
    unknowns: nodes are half as many, with a quarter of the couplings.
    """

    name = "SuperLU, symmetric, minimum degree of nodes"

    def __init__(self, matrix: Sparse, groups: Ints, *, definite: bool = True) -> None:
        self._order = _order(matrix, groups)
        ordered = matrix.tocsr()[self._order][:, self._order]
        self._factor = SuperLUFactor(ordered, definite=definite, ordered=True)

    def solve(self, rhs: Floats) -> Floats:
        """See `Factor`."""
        found = np.empty_like(rhs)
        found[self._order] = self._factor.solve(rhs[self._order])
        return found

    @property
    def entries(self) -> int:
        """Entries of both factors."""
        return self._factor.entries


def _order(matrix: Sparse, groups: Ints) -> Ints:
    """Return the unknowns of a symmetric matrix group by group, groups by minimum degree."""
    size, count = matrix.shape[0], int(groups.max()) + 1
    gather = csr_array((np.ones(size), (groups, np.arange(size))), shape=(count, size))
    rows = matrix.tocsr()
    pattern = csr_array((np.ones(rows.nnz), rows.indices, rows.indptr), shape=rows.shape)
    coupled = (gather @ pattern @ gather.T).tocsc()
    coupled.data[:] = WEAK
    # an incomplete factorisation that keeps next to nothing tells SuperLU's order
    told = spilu(
        (coupled + eye_array(count)).tocsc(),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        drop_tol=0.9,
        fill_factor=1.0,
        options={"SymmetricMode": True},
    )
    found: Ints = np.argsort(told.perm_c[groups], kind="stable")
    return found


class CholmodFactor:
    """CHOLMOD's Cholesky factor, supernodal where that is faster; see `Factor`."""

    name = "CHOLMOD"

    def __init__(self, matrix: Sparse) -> None:
        found = cholmod()
        if found is None:
            remedy = "install the extra 'cholmod' (Debian: libsuitesparse-dev)"
            raise SimulationError(f"CHOLMOD is not installed: {remedy}")
        try:
            self._factor = found.cholesky(matrix.tocsc())
        except found.CholmodNotPositiveDefiniteError as error:
            raise SimulationError(f"the system matrix can't be factorised: {error}") from error
        self.solve = self._factor.solve_A

    @property
    def entries(self) -> int:
        """Entries of the factor, twice: forwards and backwards."""
        return 2 * int(self._factor.L().nnz)


@functools.cache
def cholmod() -> Any:
    """Return scikit-sparse's interface to CHOLMOD, or None where it is not installed."""
    try:
        return import_module("sksparse.cholmod")
    except ModuleNotFoundError:
        return None
