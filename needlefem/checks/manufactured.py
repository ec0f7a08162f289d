"""Smooth displacements with known derivatives, to load a tissue with what they need.

Manufactured solutions (P. J. Roache 2002): any field is exact under the body force that its
stress leaves over.
"""

import dataclasses
from collections.abc import Callable

import numpy as np

from needlefem._arrays import Floats, Points

PI = np.pi


@dataclasses.dataclass(frozen=True)
class Manufactured:
    """A displacement of the unit square.

    Parameters
    ----------
    displacement : callable
        At points (n, 2), shape (n, 2).
    gradient : callable
        ``du_i / dx_j``, shape (n, 2, 2).
    hessian : callable
        ``d2u_i / dx_j dx_k``, shape (n, 2, 2, 2).
    """

    displacement: Callable[[Points], Floats]
    gradient: Callable[[Points], Floats]
    hessian: Callable[[Points], Floats]

    def body_force(self, stiffness: Floats) -> Callable[[Points], Floats]:
        """Return the body force that a Voigt stiffness (3, 3) needs, at points (n, 2)."""
        number = np.array([[0, 2], [2, 1]])
        tangent = stiffness[number[:, :, None, None], number[None, None]]

        def force(points: Points) -> Floats:
            found: Floats = -np.einsum("ijkl,nkjl->ni", tangent, self.hessian(points))
            return found

        return force


def _waves(points: Points) -> tuple[Floats, Floats, Floats, Floats, Floats, Floats]:
    x, y = points.T
    return x, y, np.sin(PI * x), np.cos(PI * x), np.sin(PI * y), np.cos(PI * y)


def _displacement(points: Points) -> Floats:
    x, y, sx, cx, sy, _ = _waves(points)
    return np.stack([sx * sy + x * y / 5.0, cx * y * (1.0 - y) + x**2 / 3.0], axis=1)


def _gradient(points: Points) -> Floats:
    x, y, sx, cx, sy, cy = _waves(points)
    first = np.stack([PI * cx * sy + y / 5.0, PI * sx * cy + x / 5.0], axis=1)
    second = np.stack([-PI * sx * y * (1.0 - y) + 2.0 * x / 3.0, cx * (1.0 - 2.0 * y)], axis=1)
    return np.stack([first, second], axis=1)


def _hessian(points: Points) -> Floats:
    _, y, sx, cx, sy, cy = _waves(points)
    one = PI**2 * cx * cy + 0.2
    two = -PI * sx * (1.0 - 2.0 * y)
    first = [[-(PI**2) * sx * sy, one], [one, -(PI**2) * sx * sy]]
    second = [[-(PI**2) * cx * y * (1.0 - y) + 2.0 / 3.0, two], [two, -2.0 * cx]]
    return np.moveaxis(np.array([first, second]), 3, 0)


GENERAL = Manufactured(_displacement, _gradient, _hessian)
"""``(sin pi x sin pi y + x y / 5, cos pi x y (1 - y) + x^2 / 3)``: all strains, and volume."""


def _turning(points: Points) -> Floats:
    _, _, sx, cx, sy, cy = _waves(points)
    return np.stack([sx * cy, -cx * sy], axis=1)


def _turning_gradient(points: Points) -> Floats:
    _, _, sx, cx, sy, cy = _waves(points)
    rows = [[cx * cy, -sx * sy], [sx * sy, -cx * cy]]
    return PI * np.moveaxis(np.array(rows), 2, 0)


def _turning_hessian(points: Points) -> Floats:
    _, _, sx, cx, sy, cy = _waves(points)
    first = [[-sx * cy, -cx * sy], [-cx * sy, -sx * cy]]
    second = [[cx * sy, sx * cy], [sx * cy, cx * sy]]
    return PI**2 * np.moveaxis(np.array([first, second]), 3, 0)


ISOCHORIC = Manufactured(_turning, _turning_gradient, _turning_hessian)
"""``(sin pi x cos pi y, -cos pi x sin pi y)``: no change of volume, to see locking with."""
