"""Roots of a few equations and minima along a line, for functions that are costly to evaluate.

Broyden's method, Brent's method (of scipy) and golden section. The systems have as many unknowns as
there are lateral directions, and one more: arrays would cost more than the arithmetic of one
unknown, which therefore has its own branch.
"""

import math
import operator
from collections.abc import Callable, Sequence
from typing import Generic, NamedTuple, TypeVar

import numpy as np
import scipy  # its module of root finding is imported when it is first used

from needlefem._arrays import Floats

Solution = TypeVar("Solution")
"""What an evaluation returns beside its residual."""

SINGULAR = 1e-8
"""Determinant of the Jacobian below which it is singular."""


class Root(NamedTuple, Generic[Solution]):
    """Result of `broyden`.

    Parameters
    ----------
    solution
        What the last evaluation returned beside its residual.
    unknowns : array, shape (n,)
    jacobian : array, shape (n, n)
        Approximate derivatives of the residual there.
    """

    solution: Solution
    unknowns: Floats
    jacobian: Floats


# Kernel: Broyden's method for a system of equations.
#     x_new = x - J^-1 r,    J_new = J + (r_new - r - J dx) dx^T / (dx . dx)
# x, dx  unknowns and their change
# r, J   residual and its approximate Jacobian
# Source: C. G. Broyden, Math. Comp. 19 (1965) 577.
def broyden(
    evaluate: Callable[[Floats], tuple[Solution, Floats] | None],
    unknowns: Floats,
    jacobian: Floats,
    *,
    tolerance: float | Sequence[float],
    smallest_change: float,
    iterations: int,
    limit: Callable[[Floats, Floats], Floats] | None = None,
) -> Root[Solution] | None:
    """Return the root of a system of equations, or None if the method does not converge.

    Parameters
    ----------
    evaluate : callable
        Takes the unknowns, shape (n,); returns a solution and its residual, shape (n,), or None
        outside of the domain, where the method ends.
    unknowns : array, shape (n,)
        Initial guess.
    jacobian : array, shape (n, n)
        Approximate derivatives of the residual there.
    tolerance : float or sequence of n floats
        Largest magnitude of the residual, or of each component, at a root.
    smallest_change : float
        Norm of the change of the unknowns below which the method ends.
    iterations : int
        Largest number of evaluations.
    limit : callable, optional
        Takes the unknowns and their change; returns the admissible change.
    """
    bounds = (tolerance,) * len(unknowns) if isinstance(tolerance, float) else tolerance
    reached = evaluate(unknowns)
    for _ in range(iterations):
        if reached is None:
            return None
        solution, residual = reached
        if all(abs(r) <= bound for r, bound in zip(residual.tolist(), bounds, strict=True)):
            return Root(solution, unknowns, jacobian)
        if _determinant(jacobian) < SINGULAR:
            return None
        change = -solve_small(jacobian, residual)
        if limit is not None:
            change = limit(unknowns, change)
        if math.hypot(*change.tolist()) <= smallest_change:
            return None
        unknowns = unknowns + change
        reached = evaluate(unknowns)
        if reached is not None:
            jacobian = updated_jacobian(jacobian, change, residual, reached[1])
    return None


def updated_jacobian(jacobian: Floats, change: Floats, before: Floats, after: Floats) -> Floats:
    """Return the Jacobian after Broyden's update, which agrees with the last change of residuals.

    Parameters
    ----------
    jacobian : array, shape (n, n)
    change : array, shape (n,)
        Change of the unknowns.
    before, after : array, shape (n,)
        Residuals.
    """
    if len(change) == 1:  # the secant method
        known, moved = float(jacobian[0, 0]), float(change[0])
        error = float(after[0]) - float(before[0]) - known * moved
        return np.array([[known + error * (moved / (moved * moved))]])
    errors = after - before - jacobian @ change
    updated: Floats = jacobian + errors[:, None] * (change / (change @ change))
    return updated


def solve_small(matrix: Floats, rhs: Floats) -> Floats:
    """Return the solution of a system of one or a few equations."""
    if len(matrix) == 1:
        return rhs / float(matrix[0, 0])
    return np.linalg.solve(matrix, rhs).astype(float)


def _determinant(matrix: Floats) -> float:
    """Return the magnitude of the determinant of a small matrix."""
    if len(matrix) == 1:
        return abs(float(matrix[0, 0]))
    return abs(float(np.linalg.det(matrix)))


def root_between(function: Callable[[float], float], low: float, high: float, xtol: float) -> float:
    """Return the root of a function whose sign differs at `low` and `high` (R. P. Brent 1973).

    scipy wraps what it is given in a function that refers to itself. It is given `_value`, so
    that it does not keep `function`, and the tissue in it, until the next garbage collection.
    """
    return float(scipy.optimize.brentq(_value, low, high, args=(function,), xtol=xtol))


def _value(unknown: float, function: Callable[[float], float]) -> float:
    return function(unknown)


def golden_section(
    function: Callable[[float], float],
    low: float,
    high: float,
    tolerance: float,
    less: Callable[[float, float], bool] = operator.lt,
) -> list[tuple[float, float]]:
    """Search the minimum of a function with one minimum by golden section (J. Kiefer 1953).

    Parameters
    ----------
    function : callable
    low, high : float
        Interval that contains the minimum.
    tolerance : float
        Width of the interval at which the search ends.
    less : callable
        Compares two values; by default without a margin for round-off.

    Returns
    -------
    list of (place, value)
        All evaluations in their order.
    """
    ratio = 0.5 * (math.sqrt(5.0) - 1.0)
    tried: list[tuple[float, float]] = []

    def evaluate(place: float) -> float:
        tried.append((place, function(place)))
        return tried[-1][1]

    inner, outer = high - ratio * (high - low), low + ratio * (high - low)
    at_inner, at_outer = evaluate(inner), evaluate(outer)
    while high - low > tolerance:
        if less(at_inner, at_outer):
            high, outer, at_outer = outer, inner, at_inner
            inner = high - ratio * (high - low)
            at_inner = evaluate(inner)
        else:
            low, inner, at_inner = inner, outer, at_outer
            outer = low + ratio * (high - low)
            at_outer = evaluate(outer)
    return tried
