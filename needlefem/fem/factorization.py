"""Factorisations of sparse symmetric matrices behind one interface.

SuperLU is a part of scipy and is always available. CHOLMOD (extra `cholmod`) needs half the fill
for positive definite matrices and solves blocks several times faster. It is used if it is installed
and the matrix is large enough to compensate for its import (``needlefem bench solvers``).
"""

import functools
from importlib import import_module
from types import ModuleType
from typing import Protocol

import numpy as np
from scipy.sparse import csr_array, eye_array
from scipy.sparse.linalg import spilu, splu

from needlefem._arrays import Floats, Ints, Sparse
from needlefem._progress import doing
from needlefem.errors import SimulationError

PIVOT = 0.1
"""Least size of a pivot on the diagonal, relative to its column, in indefinite matrices."""
FEWEST_FOR_CHOLMOD = 5_000
"""Number of unknowns below which both have the same cost; SuperLU needs no further import."""
FEWEST_FOR_GROUPS = 50_000
"""Number of unknowns from which on ordering nodes is faster than ordering unknowns."""
WEAK = 1e-3
"""Value of the couplings between nodes during the ordering, where only the pattern matters."""


class Factor(Protocol):
    """A factorised matrix."""

    @property
    def name(self) -> str:
        """Name of the solver and of its ordering."""
        ...

    def solve(self, rhs: Floats) -> Floats:
        """Return the solution for one right-hand side (n,) or a block of them (n, k)."""
        ...


def factorise(
    matrix: Sparse, *, definite: bool = True, backend: str = "auto", groups: Ints | None = None
) -> Factor:
    """Return the factor of a symmetric sparse matrix.

    Parameters
    ----------
    matrix : sparse
        The entries of all rows should have a similar magnitude.
    definite : bool
        Whether the matrix is positive definite.
    backend : str
        ``"superlu"``, ``"cholmod"`` (positive definite matrices only), or the faster one.
    groups : array, shape (n,), optional
        Group of each unknown: its node, or another set of unknowns with the same couplings.

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

    Compared with the default of SuperLU, this halves the fill of positive definite matrices, which
    need no pivoting. The fill of indefinite matrices is a third of the default; an off-diagonal
    pivot is used where the diagonal is smaller than a tenth of the column's largest entry.
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
        """Number of entries of both factors."""
        return int(self._factor.L.nnz + self._factor.U.nnz)


class GroupedFactor:
    """SuperLU with an ordering of nodes instead of unknowns; see `Factor`.

    For large matrices SuperLU spends most of its time on the ordering. The graph of nodes has half
    as many vertices (in 2D) and a quarter of the couplings, and the ordering is as good.
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
        """Number of entries of both factors."""
        return self._factor.entries


def _order(matrix: Sparse, groups: Ints) -> Ints:
    """Return the unknowns ordered by group, with the groups in the order of minimum degree."""
    size, count = matrix.shape[0], int(groups.max()) + 1
    gather = csr_array((np.ones(size), (groups, np.arange(size))), shape=(count, size))
    rows = matrix.tocsr()
    pattern = csr_array((np.ones(rows.nnz), rows.indices, rows.indptr), shape=rows.shape)
    coupled = (gather @ pattern @ gather.T).tocsc()
    coupled.data[:] = WEAK
    # SuperLU has no function for the ordering alone: take it from a factorisation that drops
    # nearly all entries
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
        """Number of entries of the factor times two: for forward and backward substitution."""
        return 2 * int(self._factor.L().nnz)


@functools.cache
def cholmod() -> ModuleType | None:
    """Return scikit-sparse's interface to CHOLMOD, or None if it is not installed."""
    try:
        return import_module("sksparse.cholmod")
    except ModuleNotFoundError:
        return None


# Pickling of results without data that are computed on demand. Factorisations can't be copied.
# Matrices, tables and bases are larger than a result, and can be computed again from mesh and laws.
# Computed results (states, points, energies) are pickled.


def lasting_state(instance: object, *others: str) -> dict[str, object]:
    """Return the attributes of an instance for pickling and copying, without cached properties.

    Parameters
    ----------
    instance : object
    *others : str
        Further attributes that `__setstate__` computes again.
    """
    cached = {
        name
        for cls in type(instance).__mro__
        for name, attribute in vars(cls).items()
        if isinstance(attribute, functools.cached_property)
    }
    return {name: v for name, v in vars(instance).items() if name not in cached | set(others)}


class Lasting:
    """A class whose instances are pickled and copied without their cached properties."""

    def __getstate__(self) -> dict[str, object]:
        """Return the state for pickling."""
        return lasting_state(self)
