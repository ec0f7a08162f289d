"""Voigt notation: stresses and strains as six numbers, in the order 11, 22, 33, 23, 13, 12.

Shear strains are engineering strains (twice the tensor components), so that the product of stress
and strain is an energy density.
"""

import numpy as np

from needlefem._arrays import Floats

PAIRS = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))
IN_PLANE = (0, 1, 5)
"""The components of a plane problem."""


def volumetric(dim: int = 3) -> Floats:
    """Return the vector whose product with a Voigt strain is the dilatation."""
    return np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0] if dim == 3 else [1.0, 1.0, 0.0])


def strain(gradient: Floats) -> Floats:
    """Return Voigt strains (..., 6) of displacement gradients (..., 3, 3)."""
    symmetric = 0.5 * (gradient + np.swapaxes(gradient, -1, -2))
    parts = [(1.0 if i == j else 2.0) * symmetric[..., i, j] for i, j in PAIRS]
    return np.stack(parts, axis=-1)


def tensor(voigt: Floats) -> Floats:
    """Return symmetric tensors (..., 3, 3) of Voigt stresses (..., 6)."""
    found = np.empty((*voigt.shape[:-1], 3, 3))
    for number, (i, j) in enumerate(PAIRS):
        found[..., i, j] = found[..., j, i] = voigt[..., number]
    return found


def tangent_tensor(stiffness: Floats) -> Floats:
    """Return the fourth-order tensor (3, 3, 3, 3) of a Voigt stiffness (6, 6)."""
    number = np.empty((3, 3), dtype=np.intp)
    for position, (i, j) in enumerate(PAIRS):
        number[i, j] = number[j, i] = position
    found: Floats = stiffness[number[:, :, None, None], number[None, None]]
    return found


def tangent_matrix(tangent: Floats) -> Floats:
    """Return the Voigt stiffness (6, 6) of a tangent tensor (3, 3, 3, 3), made minor-symmetric."""
    tangent = 0.5 * (tangent + np.swapaxes(tangent, 0, 1))
    tangent = 0.5 * (tangent + np.swapaxes(tangent, 2, 3))
    return np.array([[tangent[i, j, k, m] for k, m in PAIRS] for i, j in PAIRS])


def rotation(axes: Floats) -> Floats:
    """Return T, shape (6, 6): Voigt stress in local axes (rows, shape (3, 3)) is ``T stress``."""
    found = np.empty((6, 6))
    for column, (k, m) in enumerate(PAIRS):
        unit = np.zeros((3, 3))
        unit[k, m] = unit[m, k] = 1.0
        local = axes @ unit @ axes.T
        found[:, column] = [local[i, j] for i, j in PAIRS]
    return found
