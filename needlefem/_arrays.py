"""Array types used in signatures."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Ints = NDArray[np.intp]
Bools = NDArray[np.bool_]
Points = Floats
"""Points as rows, shape (n, dim), m."""
Vector = Floats
"""A vector, shape (dim,)."""
Sparse = Any
"""A scipy.sparse array or matrix (scipy ships no types)."""
SkfemMesh = Any
"""A scikit-fem mesh (scikit-fem ships no types)."""


def enlarged(array: Floats, rows: int, columns: int) -> Floats:
    """Return an array with at least as many rows and columns; its size is doubled if needed."""
    have = array.shape
    if have[0] >= rows and have[1] >= columns:
        return array
    shape = tuple(
        h if h >= n else max(2 * n, 64) for h, n in zip(have, (rows, columns), strict=True)
    )
    grown = np.zeros(shape)
    grown[: have[0], : have[1]] = array
    return grown
