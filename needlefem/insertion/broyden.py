"""Roots: Broyden's method for the place of the tip, Brent's for one unknown in an interval."""

from collections.abc import Callable

import numpy as np
from scipy.optimize import brentq

from needlefem._arrays import Floats
from needlefem.insertion.step_equations import TOLERANCE, StepSolution

SMALLEST_CHANGE = 1e-15
"""Change of the unknowns below which iterating is in vain, m."""
FLAT = 1e-8
"""Determinant of the errors' derivatives that is none."""
MOST_BROYDEN_ITERATIONS = 60

Evaluate = Callable[[Floats], tuple[StepSolution, Floats]]
Limit = Callable[[Floats, Floats], Floats]


def broyden(
    evaluate: Evaluate, unknown: Floats, jacobian: Floats, limit: Limit
) -> StepSolution | None:
    """Return the solution without an error (C. G. Broyden 1965), or None: not found.

    Parameters
    ----------
    evaluate : callable
        Takes unknowns, shape (n,), m; returns solution and errors, shape (n,), m.
    unknown : array, shape (n,), m
        Guess.
    jacobian : array, shape (n, n)
        Of the errors, about.
    limit : callable
        Takes unknowns and their change; returns the change that is allowed.
    """
    jacobian, (solution, error) = jacobian.copy(), evaluate(unknown)
    for _ in range(MOST_BROYDEN_ITERATIONS):
        if np.max(np.abs(error)) <= TOLERANCE:
            return solution
        if abs(np.linalg.det(jacobian)) < FLAT:
            return None
        newton: Floats = -np.linalg.solve(jacobian, error).astype(float)
        change = limit(unknown, newton)
        if np.linalg.norm(change) < SMALLEST_CHANGE:
            return None
        solution, reached = evaluate(unknown + change)
        wrong = reached - error - jacobian @ change
        jacobian += np.outer(wrong, change) / (change @ change)
        unknown, error = unknown + change, reached
    return None


def root_between(function: Callable[[float], float], low: float, high: float, xtol: float) -> float:
    """Return where a function that changes sign between `low` and `high` vanishes (R. P. Brent).

    scipy wraps what it is given in a function that refers to itself. It is given `_value`, so
    that it does not keep `function`, and the tissue in it, until the next garbage collection.
    """
    return float(brentq(_value, low, high, args=(function,), xtol=xtol))


def _value(unknown: float, function: Callable[[float], float]) -> float:
    return function(unknown)
