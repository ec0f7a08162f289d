"""The tip's kernel: the disc (ball) over which the tip's force is spread.

A point force has an unbounded displacement, so that every answer would drift with refinement.
Spread over a disc of the needle's own size, with the work-conjugate mean displacement over the
same disc, tip force and tip displacement are finite and converge.
"""

from typing import Protocol

import numpy as np

from needlefem._arrays import Floats, Points, Vector
from needlefem.elements.shape_functions import gauss_legendre


class Kernel(Protocol):
    """A way to spread the tip's force."""

    def rule(self, centre: Vector) -> tuple[Points, Floats]:
        """Return offsets from the centre, and weights, as `quadrature` does with points.

        Deep in the tissue, where they do not depend on the centre, always the same objects.
        """
        ...

    def quadrature(self, centre: Vector) -> tuple[Points, Floats]:
        """Return points, shape (n, dim), and weights, shape (n,), that sum to 1."""
        ...


class PointKernel:
    """A point force. It never converges under refinement and is kept to show just that."""

    def __init__(self, dim: int) -> None:
        self._point = np.zeros((1, dim)), np.ones(1)

    def rule(self, centre: Vector) -> tuple[Points, Floats]:  # noqa: ARG002
        """See `Kernel`."""
        return self._point

    def quadrature(self, centre: Vector) -> tuple[Points, Floats]:
        """See `Kernel`."""
        return centre[None], self._point[1]


# Kernel: mean over the disc (in 3D the ball) of the tip.
#     u(X) = (1 / |D|) integral over D(X) of u dV
# D(X)  disc of the needle's radius a around X, cut off at the skin, m^2 (m^3 in 3D)
# Force and displacement are conjugate: a force R on the tip is spread as R / |D| over D.
# Source: docs/theory.md, section on the needle.
class TipKernel:
    """A disc (2D) or ball (3D) of uniform weight, cut off at the skin.

    The rule is a product of one along the skin's inward normal and one across it. Where the
    disc reaches out of the skin only the part inside counts, renormalised; its points move
    smoothly with the centre, so that the needle's answer has no jumps there.

    Parameters
    ----------
    radius : float, m
    points : int
        Wanted number of quadrature points; the rule takes the nearest product.
    skin : array, shape (dim,), m
        A point of the skin, taken as plane within a radius of the needle.
    inward : array, shape (dim,)
        Unit normal of the skin that points into the tissue.
    """

    def __init__(self, radius: float, points: int, skin: Vector, inward: Vector) -> None:
        self.radius, self._skin, self._inward = radius, skin, inward
        dim = len(inward)
        along, across = _split(points, dim)
        nodes, self._along_weights = gauss_legendre(along)
        self._angle = 0.5 * np.pi * nodes
        self._across, self._across_weights = _unit_ball_rule(dim - 1, across)
        self._plane = np.linalg.svd(inward[None])[2][1:]
        self._power = dim - 1
        self._whole = self._rule(-radius)

    def rule(self, centre: Vector) -> tuple[Points, Floats]:
        """See `Kernel`."""
        under = float(self._inward @ (centre - self._skin))
        return self._whole if under >= self.radius else self._rule(-under)

    def quadrature(self, centre: Vector) -> tuple[Points, Floats]:
        """See `Kernel`."""
        offsets, weights = self.rule(centre)
        return centre + offsets, weights

    def _rule(self, low: float) -> tuple[Points, Floats]:
        """Return offsets from the centre, and weights, of the disc above a height in it."""
        radius = self.radius
        height = low + 0.5 * (radius - low) * (1.0 + np.sin(self._angle))
        half = np.sqrt(np.maximum(radius**2 - height**2, 0.0))
        slab = self._along_weights * np.cos(self._angle) * half**self._power
        across = half[:, None, None] * (self._across @ self._plane)
        offsets = height[:, None, None] * self._inward + across
        weights = (slab[:, None] * self._across_weights).ravel()
        return offsets.reshape(-1, len(self._inward)), weights / weights.sum()


def cross_section(radius: float, points: int, dim: int) -> tuple[Points, Floats]:
    """Return a rule over a shaft's cross-section, uniform; weights sum to 1.

    Parameters
    ----------
    radius : float, m
    points : int
        Points of the tip's kernel; the section is resolved as the kernel is.
    dim : int
        Dimensions of the space.

    Returns
    -------
    Offsets along the needle's lateral directions, shape (n, dim - 1), m, and weights, shape (n,).
    """
    offsets, weights = _unit_ball_rule(dim - 1, _split(points, dim)[1])
    return radius * offsets, weights / weights.sum()


def _split(points: int, dim: int) -> tuple[int, int]:
    """Return how many points go along the skin's normal, and how many across it."""
    along = max(2, round((1.5 ** (dim - 1) * points) ** (1.0 / dim)))
    return along, max(1, round((points / along) ** (1.0 / (dim - 1))))


def _unit_ball_rule(dim: int, n: int) -> tuple[Points, Floats]:
    """Return a rule on the unit interval [-1, 1] (dim 1, n points) or disc (dim 2, n x 2n)."""
    nodes, weights = gauss_legendre(n)
    if dim == 1:
        return nodes[:, None], weights
    radius = np.sqrt(0.5 * (1.0 + nodes))
    turn = 2.0 * np.pi * (np.arange(2 * n) + 0.5) / (2 * n)
    circle = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    points = radius[:, None, None] * circle
    return points.reshape(-1, 2), np.repeat(weights, 2 * n)
