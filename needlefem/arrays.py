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
"""One vector of the space, shape (dim,)."""
Sparse = Any
"""A scipy.sparse array or matrix (scipy ships no types)."""
SkfemMesh = Any
"""A scikit-fem mesh (scikit-fem ships no types)."""
