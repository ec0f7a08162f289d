"""Factorisations of the step operator behind one interface."""

from typing import Any, Protocol

import numpy as np
from scipy.sparse.linalg import splu

from needlefem.arrays import Floats, Sparse
from needlefem.errors import SimulationError


class Factor(Protocol):
    """A factorised matrix."""

    def solve(self, rhs: Floats) -> Floats:
        """Return the solution for one right-hand side (n,) or a block of them (n, k)."""
        ...


def factorise(matrix: Sparse, *, definite: bool = True) -> Factor:
    """Factorise a symmetric sparse matrix, positive definite unless said otherwise.

    A definite matrix: SuperLU without pivoting, in the minimum-degree order of A + A^T, half the
    fill of its default. An indefinite one needs pivots, and its default order: the other fills
    five times as much there (both measured in docs/performance.md).

    Raises
    ------
    SimulationError
        The matrix is singular, or has entries that are not finite.
    """
    if not np.all(np.isfinite(matrix.data)):
        raise SimulationError("the system matrix has entries that are not finite")
    symmetric: dict[str, Any] = {
        "permc_spec": "MMD_AT_PLUS_A",
        "diag_pivot_thresh": 0.0,
        "options": {"SymmetricMode": True},
    }
    try:
        found: Factor = splu(matrix.tocsc(), **(symmetric if definite else {}))
    except RuntimeError as error:
        raise SimulationError(f"the system matrix can't be factorised: {error}") from error
    return found
