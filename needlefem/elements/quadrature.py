"""Quadrature rules on reference cells, always given explicitly.

scikit-fem chooses rules by polynomial degree, and never one point: ``intorder=1`` on
quadrilaterals is four of them, so that reduced integration would silently do nothing.
"""

import math
from collections.abc import Callable
from functools import cache, partial

import numpy as np
from skfem.quadrature import get_quadrature
from skfem.refdom import RefTet, RefTri

from needlefem._arrays import Floats

Rule = Callable[[], tuple[Floats, Floats]]
"""Returns points (dim, n) in the reference cell and weights (n,) that sum to its measure."""


def gauss(points: int, dim: int = 2) -> Rule:
    """Return the product rule of `points` Gauss points an axis on the unit square (cube)."""
    return partial(_gauss, points, dim)


def simplex(order: int, dim: int = 2) -> Rule:
    """Return a rule on the triangle (tetrahedron) that integrates degree `order` exactly.

    Order 1 is the point in the middle.
    """
    return partial(_simplex, order, dim)


@cache
def gauss_legendre(points: int) -> tuple[Floats, Floats]:
    """Return nodes on [-1, 1] and weights (sum 2), both of shape (points,) and read-only."""
    nodes, weights = np.polynomial.legendre.leggauss(points)
    for shared in (nodes, weights):
        shared.flags.writeable = False
    return nodes, weights


def _gauss(points: int, dim: int) -> tuple[Floats, Floats]:
    nodes, weights = gauss_legendre(points)
    grid = np.meshgrid(*[0.5 * (1.0 + nodes)] * dim, indexing="ij")
    product = np.ones(points**dim)
    for axis in np.meshgrid(*[0.5 * weights] * dim, indexing="ij"):
        product *= axis.ravel()
    return np.stack([axis.ravel() for axis in grid]), product


def _simplex(order: int, dim: int) -> tuple[Floats, Floats]:
    if order == 1:
        return np.full((dim, 1), 1.0 / (dim + 1)), np.array([1.0 / math.factorial(dim)])
    points, weights = get_quadrature(RefTri if dim == 2 else RefTet, order)
    return points, weights
