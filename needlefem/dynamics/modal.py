"""Free vibration: frequencies and shapes of a tissue, held or free."""

import numpy as np
from scipy.sparse.linalg import LinearOperator, eigsh

from needlefem._arrays import Floats, Sparse
from needlefem.dynamics.system import TissueSystem


def modes(system: TissueSystem, count: int, near: float = 0.0) -> tuple[Floats, Floats]:
    """Return the modes whose frequencies are nearest to a value.

    Parameters
    ----------
    system : TissueSystem
        Its damping plays no part.
    count : int
    near : float, 1/s
        Angular frequency; 0 for the lowest.

    Returns
    -------
    Angular frequencies, shape (count,), 1/s, rising, and shapes, shape (size, count), with a
    modal mass of 1. Shift-invert Lanczos, which needs ``K - shift M`` by its factorisation alone.
    A free tissue has zero frequencies for its rigid motions.
    """
    mass: Sparse = system.mass.tocsc()
    # below zero the operator stays definite; the shift must only be small beside what is sought
    shift = near**2 if near else -1e-3 * _scale(system)
    factor = system.factor(-shift, 0.0, 1.0)
    inverse = LinearOperator(mass.shape, matvec=factor.solve, dtype=float)
    start = np.random.default_rng(1).normal(size=system.size)  # fixed: results are reproducible
    squares, shapes = eigsh(
        mass, count, mass, sigma=shift, OPinv=inverse, which="LM", v0=start
    )  # the first argument is not used when the inverse is given
    order = np.argsort(squares)
    frequencies = np.sqrt(np.maximum(squares[order], 0.0))
    return frequencies, shapes[:, order]


def _scale(system: TissueSystem) -> float:
    """Return the square of a frequency like the lowest: of a wave across the whole tissue."""
    model = system.model
    size = float(np.ptp(model.nodes))
    speeds = [part.shear / density for part, density in model.laws()]
    return min(speeds) * (np.pi / size) ** 2
