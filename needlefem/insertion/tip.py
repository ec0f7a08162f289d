"""Where the tip goes in a step: on the crack front, ahead of it, or back on its path."""

from collections.abc import Callable

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from needlefem.arrays import Floats
from needlefem.errors import SimulationError
from needlefem.fem.interpolation import OutsideError
from needlefem.insertion.equations import TOLERANCE, Solution, StepEquations

STALLED = 1e-15
"""Change of the unknowns below which iterating is in vain, m."""
FLAT = 1e-8
"""Determinant of the errors' derivatives that is none."""
MOST_ITERATIONS = 60
PEAK = 1e-3
"""Part of a piece to which the path's largest depth is found."""
GAIN = 1e-9
"""Depth to be gained on the way to it that is worth a step, m."""

Evaluate = Callable[[Floats], tuple[Solution, Floats]]
Limit = Callable[[Floats, Floats], Floats]


def press(equations: StepEquations, depth: float) -> Solution:
    """Return the forces with the tip at the crack front, pressing from nothing to cutting."""
    position = equations.front()
    return equations.solve(position, depth, 0.0, position.cutting_force)


def draw(equations: StepEquations, depth: float, start: float) -> tuple[float, Solution] | None:
    """Return where on its path a tip without force is, and the forces.

    Parameters
    ----------
    equations : StepEquations
    depth : float, m
    start : float, m
        Path length at which it was.

    Returns
    -------
    Path length, m, and solution; None: the tip is beyond the crack front. With a gap at length 0
    the needle is out.
    """
    low, high = 0.0, equations.track.length
    last = high
    arc = min(max(start + depth - equations.depth, 0.0), last)
    before: tuple[float, float] | None = None
    for _ in range(MOST_ITERATIONS):
        solution = equations.solve(equations.at_arc(arc), depth, 0.0, 0.0)
        gap = solution.gap
        if abs(gap) <= TOLERANCE or (gap > 0.0 and arc <= 0.0):
            return arc, solution
        if gap < 0.0 and arc >= last:
            return None
        low, high = (arc, high) if gap < 0.0 else (low, arc)
        slope = 1.0
        if before is not None and before[1] != gap:
            slope = (gap - before[1]) / (arc - before[0])
        before, wanted = (arc, gap), arc - gap / slope if slope > 0.0 else np.nan
        inside = low < wanted < high
        at_end = (wanted <= 0.0 == low) or (wanted >= last == high)
        arc = min(max(wanted, 0.0), last) if inside or at_end else 0.5 * (low + high)
    raise SimulationError(f"no place of the tip found on its path at depth {depth:.4g} m")


def cut(equations: StepEquations, depth: float, ahead: float) -> Solution | None:
    """Return the forces with a tip that has cut on to a depth, or None: not found.

    Parameters
    ----------
    equations : StepEquations
    depth : float, m
    ahead : float, m
        How far about.
    """
    axis, front = equations.instrument.axis, equations.track.front

    def evaluate(moved: Floats) -> tuple[Solution, Floats]:
        position = equations.at_point(front + moved, equations.track.count)
        force = position.cutting_force
        solution = equations.solve(position, depth, force, force)
        return solution, np.append(solution.gap, solution.beside) @ axis.frame

    def forward(moved: Floats, change: Floats) -> Floats:
        """Let a tip that would go back go half way towards where it was."""
        reach, more = float(axis.direction @ moved), float(axis.direction @ change)
        return change * (-0.5 * reach / more) if reach + more <= 0.0 else change

    try:
        return _broyden(evaluate, ahead * axis.direction, np.eye(len(front)), forward)
    except OutsideError:
        return None


def cut_to(equations: StepEquations, distance: float, depth: float) -> Solution | None:
    """Return the forces with a tip that has cut a distance, at whatever depth, or None.

    Parameters
    ----------
    equations : StepEquations
    distance : float, m
        From the crack front.
    depth : float, m
        Guess.
    """

    def evaluate(unknown: Floats) -> tuple[Solution, Floats]:
        tip = _ahead(equations, distance, unknown[1:])
        position = equations.at_point(tip, equations.track.count)
        force = position.cutting_force
        solution = equations.solve(position, depth + unknown[0], force, force)
        return solution, np.append(solution.gap, solution.beside)

    def near(unknown: Floats, change: Floats) -> Floats:
        return np.append(change[:1], _within(unknown[1:], change[1:], distance))

    sideways = len(equations.instrument.axis.laterals)
    jacobian = np.diag([-1.0, *np.ones(sideways)])
    return _broyden(evaluate, np.zeros(1 + sideways), jacobian, near)


def run_ahead(equations: StepEquations, distance: float, depth: float) -> Solution:
    """Return the forces, whatever the tip's is, with a tip that ran ahead of the crack front.

    Parameters
    ----------
    equations : StepEquations
    distance : float, m
        From the crack front.
    depth : float, m
    """

    def evaluate(sideways: Floats) -> tuple[Solution, Floats]:
        position = equations.at_point(_ahead(equations, distance, sideways), equations.track.count)
        solution = equations.solve(position, depth, -np.inf, np.inf)
        return solution, solution.beside

    def near(sideways: Floats, change: Floats) -> Floats:
        return _within(sideways, change, distance)

    count = len(equations.instrument.axis.laterals)
    found = _broyden(evaluate, np.zeros(count), np.eye(count), near)
    if found is None:
        front = equations.track.front
        raise SimulationError(f"no equilibrium found {distance:.3g} m ahead of {front} m")
    return found


def climb(equations: StepEquations, whole: float, depth: float) -> Solution | None:
    """Return the forces with a tip that has cut up to a distance and up to a depth.

    The path's length is the unknown's place in which all is smooth, also where the tip all but
    runs ahead.

    Parameters
    ----------
    equations : StepEquations
    whole : float, m
        Largest distance from the crack front.
    depth : float, m
        Largest depth.

    Returns
    -------
    Solution, or None: the tip runs ahead at once.
    """
    start = equations.depth
    step = cut_to(equations, whole, depth)
    if step is None or step.depth <= start + GAIN:
        step = _peak(equations, whole, depth)
        if step is None or step.depth <= start + GAIN:
            return None
        whole = float(np.linalg.norm(step.position.tip - equations.track.front))
    if step.depth <= depth:
        return step

    def beyond(share: float) -> float:
        if share == 0.0:
            return start - depth
        found = cut_to(equations, share * whole, depth)
        if found is None:
            raise SimulationError(f"no equilibrium found {share * whole:.3g} m ahead of the tip")
        return found.depth - depth

    share = float(brentq(beyond, 0.0, 1.0, xtol=1e-12))
    return cut_to(equations, share * whole, depth)


def _peak(equations: StepEquations, whole: float, depth: float) -> Solution | None:
    """Return the solution at the largest depth within a distance."""
    found: list[Solution] = []

    def below(distance: float) -> float:
        step = cut_to(equations, distance, depth)
        if step is None:
            return whole - equations.depth
        found.append(step)
        return -step.depth

    minimize_scalar(below, bounds=(0.0, whole), method="bounded", options={"xatol": PEAK * whole})
    return max(found, key=lambda step: step.depth, default=None)


def _ahead(equations: StepEquations, distance: float, sideways: Floats) -> Floats:
    axis = equations.instrument.axis
    forward = np.sqrt(np.maximum(distance**2 - sideways @ sideways, 0.0))
    found: Floats = equations.track.front + forward * axis.direction + sideways @ axis.laterals
    return found


def _within(sideways: Floats, change: Floats, distance: float) -> Floats:
    """Keep the tip's advance shorter than it is sideways."""
    wanted = sideways + change
    size = float(np.linalg.norm(wanted))
    return wanted * min(1.0, 0.9 * distance / size) - sideways if size > 0.0 else change


def _broyden(
    evaluate: Evaluate, unknown: Floats, jacobian: Floats, limit: Limit
) -> Solution | None:
    """Return the solution without an error (C. G. Broyden 1965), or None: not found."""
    jacobian, (solution, error) = jacobian.copy(), evaluate(unknown)
    for _ in range(MOST_ITERATIONS):
        if np.max(np.abs(error)) <= TOLERANCE:
            return solution
        if abs(np.linalg.det(jacobian)) < FLAT:
            return None
        newton: Floats = -np.linalg.solve(jacobian, error).astype(float)
        change = limit(unknown, newton)
        if np.linalg.norm(change) < STALLED:
            return None
        solution, reached = evaluate(unknown + change)
        wrong = reached - error - jacobian @ change
        jacobian += np.outer(wrong, change) / (change @ change)
        unknown, error = unknown + change, reached
    return None
