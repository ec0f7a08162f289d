"""Factorisations of the step operator behind one interface."""

from typing import Protocol

import numpy as np
from scipy.sparse.linalg import splu

from needlefem.arrays import Floats, Sparse
from needlefem.errors import SimulationError

PIVOT = 0.1
"""Least size of a pivot on the diagonal, relative to its column, in indefinite matrices."""


class Factor(Protocol):
    """A factorised matrix."""

    def solve(self, rhs: Floats) -> Floats:
        """Return the solution for one right-hand side (n,) or a block of them (n, k)."""
        ...


def factorise(matrix: Sparse, *, definite: bool = True) -> Factor:
    """Factorise a symmetric sparse matrix, positive definite unless said otherwise.

    SuperLU in the minimum-degree order of A + A^T: half the fill of its default, for definite
    matrices without pivots, and a third for indefinite ones with a pivot off the diagonal where
    that is less than a tenth of its column (``needlefem bench solvers``). It takes a matrix whose
    rows are alike in size.

    Raises
    ------
    SimulationError
        The matrix is singular, or has entries that are not finite.
    """
    if not np.all(np.isfinite(matrix.data)):
        raise SimulationError("the system matrix has entries that are not finite")
    try:
        found: Factor = splu(
            matrix.tocsc(),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0 if definite else PIVOT,
            options={"SymmetricMode": True},
        )
    except RuntimeError as error:
        raise SimulationError(f"the system matrix can't be factorised: {error}") from error
    return found
