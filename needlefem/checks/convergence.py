"""Errors on finer and finer meshes."""

import statistics
import time
from collections.abc import Callable, Sequence

from needlefem.checks.reference_problem import Curve, Quantity
from needlefem.fem.boundary_value_problem import StaticSolution

LONG_ENOUGH = 0.03
"""Seconds from which on one timing is taken as it is."""


def convergence_study(
    element: str,
    divisions: Sequence[int],
    solve: Callable[[int], StaticSolution],
    errors: Callable[[StaticSolution], dict[str, float]],
    orders: dict[str, float] | None = None,
) -> tuple[dict[str, Curve], StaticSolution]:
    """Solve on meshes of several divisions and return a curve for every error.

    Parameters
    ----------
    element : str
    divisions : sequence of int
        Rising; the element size is its reciprocal.
    solve : callable
        Returns the solution on a mesh of so many divisions; it is timed.
    errors : callable
        Returns the errors of a solution by the name of what is wrong.
    orders : dict, optional
        Order of every error in theory.

    Returns
    -------
    Curves by the name of their error, and the finest solution.
    """
    rows: list[tuple[int, float, dict[str, float]]] = []
    for count in divisions:
        solved, seconds = _timed(solve, count)
        rows.append((solved.free, seconds, errors(solved)))
    curves = {
        quantity: Curve(
            element=element,
            quantity=quantity,
            sizes=tuple(1.0 / count for count in divisions),
            dofs=tuple(row[0] for row in rows),
            seconds=tuple(row[1] for row in rows),
            errors=tuple(row[2][quantity] for row in rows),
            order=(orders or {}).get(quantity),
        )
        for quantity in rows[0][2]
    }
    return curves, solved


def _timed(solve: Callable[[int], StaticSolution], count: int) -> tuple[StaticSolution, float]:
    """Return a solution and its seconds: the median of three where one is too short to time."""
    spent: list[float] = []
    while len(spent) < 3:
        start = time.perf_counter()
        solved = solve(count)
        spent.append(time.perf_counter() - start)
        if spent[0] > LONG_ENOUGH:
            break
    return solved, statistics.median(spent)


def order_answer(curve: Curve, within: float = 0.15) -> Quantity:
    """Return the answer that a curve converges as theory says."""
    order = 0.0 if curve.order is None else curve.order
    return Quantity(
        label=f"{curve.element}: order of {curve.quantity}",
        value=curve.observed,
        reference=order,
        tolerance=within / order,
        recorded=False,
    )


def order_at_least(curve: Curve, within: float = 0.15) -> Quantity:
    """Return the answer that a curve converges at least as fast as theory says.

    For problems where coarse meshes are more than proportionally bad, so that errors fall faster
    at first.
    """
    order = 0.0 if curve.order is None else curve.order
    return Quantity(
        label=f"{curve.element}: order of {curve.quantity}, no less",
        value=curve.observed,
        reference=order - within,
        at_least=True,
        recorded=False,
    )
