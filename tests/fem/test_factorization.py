"""What a factorisation says of itself."""

import numpy as np
import pytest
from scipy.sparse import csc_array

from needlefem.fem import SuperLUFactor


def test_entries_are_those_of_both_factors() -> None:
    """A tridiagonal matrix fills nothing in: a diagonal and one beside it in either factor."""
    size = 7
    matrix = csc_array(2.5 * np.eye(size) - np.eye(size, k=1) - np.eye(size, k=-1))
    factor = SuperLUFactor(matrix)
    assert factor.entries == 2 * (2 * size - 1)
    rhs = np.arange(1.0, size + 1.0)
    assert matrix @ factor.solve(rhs) == pytest.approx(rhs)


def test_a_diagonal_matrix_has_two_diagonal_factors() -> None:
    assert SuperLUFactor(csc_array(np.diag([1.0, 2.0, 3.0]))).entries == 6
