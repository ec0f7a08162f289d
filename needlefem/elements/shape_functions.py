"""Quadrature rules and shape functions on reference cells.

All quadrature rules are chosen explicitly. scikit-fem chooses a rule by its polynomial degree, and
``intorder=1`` on quadrilaterals has four points instead of one: reduced integration would have no
effect, and no message would say so.
"""

import math
from collections.abc import Callable
from functools import cache, lru_cache, partial
from itertools import product

import numpy as np
from skfem.quadrature import get_quadrature
from skfem.refdom import RefTet, RefTri

from needlefem._arrays import Floats, Ints, Points, SkfemElement

Rule = Callable[[], tuple[Floats, Floats]]
"""Returns points (dim, n) of the reference cell and weights (n,) whose sum is its measure."""


def gauss(points: int, dim: int = 2) -> Rule:
    """Return the product rule with `points` Gauss points per axis on the unit square (cube)."""
    return partial(_gauss, points, dim)


def simplex(order: int, dim: int = 2) -> Rule:
    """Return a rule on the triangle (tetrahedron) that is exact up to degree `order`.

    Order 1 is the rule with one point at the centre.
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


# Shape functions as polynomials: all points are evaluated in one matrix product.


ROUND_OFF = 1e-10
"""Tolerance for rounding coefficients to multiples of one half (those of Lagrange elements)."""


class ShapeTable:
    """Shape functions of a scikit-fem element as polynomials on the reference cell.

    The coefficients are computed from values of scikit-fem's shape functions.

    Parameters
    ----------
    element : skfem.Element
        A scalar element with polynomial shape functions.
    """

    def __init__(self, element: SkfemElement) -> None:
        dim, degree = element.doflocs.shape[1], element.maxdeg
        powers = [p for p in product(range(degree + 1), repeat=dim) if sum(p) <= degree]
        self._set_powers(sorted(powers, key=sum))
        ticks = (np.arange(degree + 1) + 0.5) / (degree + 2)
        samples = np.array(list(product(ticks, repeat=dim)))
        count = len(element.doflocs)
        values = np.stack([element.lbasis(samples.T, i)[0] for i in range(count)], axis=1)
        coefficients = _fitted(self._monomials(samples), values)
        used = self._needed(np.flatnonzero(np.any(coefficients, axis=1)))
        self._set_powers([self._powers[i] for i in used])
        self._coefficients: Floats = _fitted(self._monomials(samples), values)
        self._slopes = [self._derivative(axis) @ self._coefficients for axis in range(dim)]

    def _set_powers(self, powers: list[tuple[int, ...]]) -> None:
        """Store the monomials; each is the product of an earlier one and a coordinate."""
        self._powers, self._factors = powers, []
        for power in powers[1:]:
            axis = next(i for i, p in enumerate(power) if p)
            lower = tuple(p - (i == axis) for i, p in enumerate(power))
            self._factors.append((powers.index(lower), axis))

    def _needed(self, used: Ints) -> list[int]:
        """Return the indices of the used monomials and of all their factors."""
        wanted = [self._powers[i] for i in used]
        return [
            number
            for number, power in enumerate(self._powers)
            if any(all(p <= q for p, q in zip(power, other, strict=True)) for other in wanted)
        ]

    def _derivative(self, axis: int) -> Floats:
        place = {power: number for number, power in enumerate(self._powers)}
        matrix = np.zeros((len(place), len(place)))
        for power, number in place.items():
            if power[axis]:
                lower = tuple(p - (i == axis) for i, p in enumerate(power))
                matrix[place[lower], number] = power[axis]
        return matrix

    def _monomials(self, points: Points) -> Floats:
        columns = np.ones((len(self._factors) + 1, len(points)))
        for number, (lower, axis) in enumerate(self._factors, start=1):
            np.multiply(columns[lower], points[:, axis], out=columns[number])
        return columns.T

    def __call__(self, reference: Points) -> Floats:
        """Return all shape functions at reference points (n, dim), shape (n, nodes)."""
        values: Floats = self._monomials(reference) @ self._coefficients
        return values

    def gradients(self, reference: Points) -> Floats:
        """Return the gradients at reference points (n, dim), shape (n, nodes, dim)."""
        monomials = self._monomials(reference)
        return np.stack([monomials @ slope for slope in self._slopes], axis=2)


@lru_cache(maxsize=32)
def shape_table(make: Callable[[], SkfemElement]) -> ShapeTable:
    """Return the shape functions of the element that `make` returns; the result is cached."""
    return ShapeTable(make())


def _fitted(monomials: Floats, values: Floats) -> Floats:
    """Return the coefficients, rounded so that they are equal on all processors."""
    found = np.linalg.lstsq(monomials, values, rcond=None)[0]
    halves = 0.5 * np.round(2.0 * found)
    snapped: Floats = np.where(np.abs(found - halves) < ROUND_OFF, halves, found)
    return snapped
