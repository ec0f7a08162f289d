"""Eigenfrequencies of a tissue."""

import numpy as np
from scipy.sparse.linalg import eigsh

from needlefem.arrays import Floats
from needlefem.fem.model import Model


def eigenfrequencies(model: Model, count: int) -> Floats:
    """Return the lowest angular frequencies of the supported tissue, shape (count,), 1/s.

    Consistent mass; shift-invert Lanczos about zero.
    """
    stiffness = model.free_block(model.stiffness).tocsc()
    mass = model.free_block(model.mass).tocsc()
    start = np.ones(stiffness.shape[0])  # fixed, so that the record is reproducible
    squares = eigsh(
        stiffness, count, mass, sigma=0.0, which="LM", v0=start, return_eigenvectors=False
    )
    frequencies: Floats = np.sqrt(np.sort(squares))
    return frequencies
