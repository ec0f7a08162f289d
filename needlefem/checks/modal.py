"""Eigenfrequencies of a tissue."""

import numpy as np
from scipy.sparse.linalg import LinearOperator, eigsh

from needlefem.arrays import Floats
from needlefem.fem.model import Model


def eigenfrequencies(model: Model, count: int) -> Floats:
    """Return the lowest angular frequencies of the supported tissue, shape (count,), 1/s.

    Consistent mass; shift-invert Lanczos about zero, which needs K by its factorisation alone
    (the first argument of scipy's function is not used then).
    """
    mass = model.free_block(model.mass).tocsc()
    inverse = LinearOperator(mass.shape, matvec=model.factor.solve, dtype=float)
    start = np.ones(mass.shape[0])  # fixed, so that the record is reproducible
    squares = eigsh(
        mass, count, mass, sigma=0.0, OPinv=inverse, which="LM", v0=start,
        return_eigenvectors=False,
    )  # fmt: skip
    frequencies: Floats = np.sqrt(np.sort(squares))
    return frequencies
