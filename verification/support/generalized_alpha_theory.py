"""Closed forms of the generalised-alpha family, independent of the steppers."""

import numpy as np

from needlefem._arrays import Complexes


def eigenvalues(mass: float, force: float, beta: float, gamma: float, step: float) -> Complexes:
    """Return the eigenvalues of a free step of an undamped oscillator, shape (3,).

    ``d' - d = v + (1/2 - beta) a + beta a'`` and ``v' - v = (1 - gamma) a + gamma a'``, in units
    of the step, with ``(1 - mass) a' + mass a + O^2 ((1 - force) d' + force d) = 0`` and
    ``x' = x z`` give a cubic equation in z (J. Chung, G. M. Hulbert 1993). `step` is ``O = w dt``.
    The spurious root is returned, too.
    """
    still = np.poly1d([1.0, -1.0]) ** 2
    moved = np.poly1d([beta, 0.5 + gamma - 2.0 * beta, 0.5 + beta - gamma])
    inertia = still * np.poly1d([1.0 - mass, mass])
    elastic = moved * np.poly1d([1.0 - force, force])
    return np.asarray(np.roots((inertia + step**2 * elastic).coeffs), dtype=complex)


def radius(mass: float, force: float, beta: float, gamma: float, step: float) -> float:
    """Return the spectral radius; see `eigenvalues`."""
    return float(np.abs(eigenvalues(mass, force, beta, gamma, step)).max())


def period(mass: float, force: float, beta: float, gamma: float, step: float) -> float:
    """Return the period relative to the exact one, from the root closest to the exact value."""
    values = eigenvalues(mass, force, beta, gamma, step)
    nearest = values[np.argmin(np.abs(values - np.exp(1j * step)))]
    return float(step / abs(np.angle(nearest)))
