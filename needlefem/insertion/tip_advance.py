"""Position of the tip in one step: loading, cutting or retraction, and growth of the cut path."""

from collections.abc import Callable

import numpy as np
import scipy  # its module of minimisation is imported when it is first used

from needlefem._arrays import Floats
from needlefem._root_finding import broyden, root_between
from needlefem.errors import SimulationError
from needlefem.fem.interpolation import OutsideError
from needlefem.insertion.step_equations import (
    TOLERANCE,
    StepEquations,
    StepSolution,
)
from needlefem.insertion.tip_solver import not_found, smallest_turning

SMALLEST_CHANGE = 1e-15
"""Change of the unknowns below which the iteration ends, m."""
MOST_ITERATIONS = 60

Evaluate = Callable[[Floats], tuple[StepSolution, Floats]]
Limit = Callable[[Floats, Floats], Floats]


def _solve(
    evaluate: Evaluate, unknowns: Floats, jacobian: Floats, limit: Limit
) -> StepSolution | None:
    """Return the solution whose residual (m) is zero, or None if it was not found."""
    root = broyden(
        evaluate,
        unknowns,
        jacobian,
        tolerance=TOLERANCE,
        smallest_change=SMALLEST_CHANGE,
        iterations=MOST_ITERATIONS,
        limit=limit,
    )
    return None if root is None else root.solution


def solve_loading(equations: StepEquations, depth: float) -> StepSolution:
    """Return the forces with the tip at the crack front, and a tip force from zero to cutting."""
    position = equations.front()
    return equations.solve(position, depth, 0.0, position.cutting_force)


def solve_retraction(
    equations: StepEquations, depth: float, start: float
) -> tuple[float, StepSolution] | None:
    """Return the position on the path of a tip without force, and the forces.

    If there are several positions, the first one in the direction of motion is returned. There may
    be two, since friction drags tissue along. The equilibrium between them is unstable; where the
    two meet, the tissue separates from the needle.

    Parameters
    ----------
    equations : StepEquations
    depth : float, m
    start : float, m
        Path length at the tip at the start of the step.

    Returns
    -------
    Path length, m, and solution; None if the tip is beyond the crack front. With a gap at path
    length 0 the needle is outside.
    """
    last, travel = equations.cut_path.length, depth - equations.depth
    longest = 0.25 * equations.instrument.spacing
    near, far, before = start, np.nan, None
    pace = equations.cut_path.pace * travel
    arc = min(max(start + min(max(pace, -longest), longest), 0.0), last)
    ahead = travel > 0.0
    if start <= 0.0 or not travel or equations.contact.free_displacement is not None:
        arc = start  # outside, or the tissue moves by itself: the gap gives the direction
        ahead = equations.solve(equations.at_arc(arc), depth, 0.0, 0.0).axial_gap < 0.0
    for _ in range(MOST_ITERATIONS):
        solution = equations.solve(equations.at_arc(arc), depth, 0.0, 0.0)
        gap = solution.axial_gap
        if abs(gap) <= TOLERANCE or (gap > 0.0 and arc <= 0.0):
            if travel and arc != start:
                equations.cut_path.pace = (arc - start) / travel
            return arc, solution
        if gap < 0.0 and arc >= last:
            return None
        near, far = (arc, far) if (gap < 0.0) is ahead else (near, arc)
        slope = equations.cut_path.slope
        if before is not None and arc != before[0]:
            slope = (gap - before[1]) / (arc - before[0])
        if slope > 0.0:
            equations.cut_path.slope = slope
        target = arc - gap / slope if slope > 0.0 else np.nan
        before = (arc, gap)
        if np.isnan(far):
            bound = near + longest if ahead else near - longest
            target = target if min(near, bound) < target < max(near, bound) else bound
            arc = min(max(target, 0.0), last)
        else:
            inside = min(near, far) < target < max(near, far)
            arc = target if inside else 0.5 * (near + far)
    raise SimulationError(
        f"the position of the retracted tip on its cut path was not found at a depth of "
        f"{100.0 * depth:.4g} cm in {MOST_ITERATIONS} iterations; shorten "
        "discretization.time_step or path_spacing"
    )


def solve_cutting(equations: StepEquations, depth: float, ahead: float) -> StepSolution | None:
    """Return the forces with a tip that has cut up to a depth; None if no solution was found.

    Parameters
    ----------
    equations : StepEquations
    depth : float, m
        Depth at the end of the step.
    ahead : float, m
        Approximate length that is cut.
    """
    axis, front = equations.instrument.axis, equations.cut_path.crack_front

    def evaluate(advance: Floats) -> tuple[StepSolution, Floats]:
        position = equations.at_point(front + advance, equations.cut_path.count)
        force = position.cutting_force
        solution = equations.solve(position, depth, force, force)
        return solution, np.append(solution.axial_gap, solution.lateral_gap) @ axis.frame

    def forward(advance: Floats, change: Floats) -> Floats:
        """Limit a change that would move the tip behind the front to half of the advance."""
        reached, more = float(axis.direction @ advance), float(axis.direction @ change)
        return change * (-0.5 * reached / more) if reached + more <= 0.0 else change

    try:
        return _solve(evaluate, ahead * axis.direction, np.eye(len(front)), forward)
    except OutsideError:
        return None


# Growth of the cut path to a given length instead of a depth, for instance at a fixed depth.


PEAK = 1e-4
"""Tolerance of the limit point of the depth, relative to a segment."""
NEAREST = 1e-3
"""First trial length of an arrest, over the largest length."""
CLOSER, CLOSEST = 0.1, 1e-9
"""Factor by which this length is reduced if it is beyond the arrest, and its smallest value."""
LEAST = 0.01
"""Smallest first advance of the tip at fixed depth, over the length of a contact segment."""
LITTLE = 0.25
"""Depth gained in the second half of a segment, over that in the first half, below which a limit
point is searched."""
GAIN = 1e-9
"""Smallest gain of depth for which a step to a limit point is taken, m."""


class _NotCutError(Exception):
    """No equilibrium at the cutting force was found at a length of the growing segment (m)."""

    def __init__(self, length: float) -> None:
        self.length = length


def extend_to_length(equations: StepEquations, length: float, depth: float) -> StepSolution | None:
    """Return the forces with a tip that has cut until the growing segment has a length.

    The depth is a result.

    Parameters
    ----------
    equations : StepEquations
    length : float, m
        Length of the growing segment.
    depth : float, m
        Initial value of the depth.

    Returns
    -------
    Solution; None if no solution was found, or if there is no tissue around the tip.
    """
    begin = _sideways(equations, length)

    def evaluate(unknown: Floats) -> tuple[StepSolution, Floats]:
        tip = _ahead(equations, length, unknown[1:])
        position = equations.at_point(tip, equations.cut_path.count)
        force = position.cutting_force
        solution = equations.solve(position, depth + unknown[0], force, force)
        return solution, np.append(solution.axial_gap, solution.lateral_gap)

    def near(unknown: Floats, change: Floats) -> Floats:
        return np.append(change[:1], _within(unknown[1:], change[1:], length))

    jacobian = np.diag([-1.0, *np.ones(len(begin))])
    try:
        return _solve(evaluate, np.append(0.0, begin), jacobian, near)
    except OutsideError:
        return None


# Kernel: advance of the tip at a fixed depth (rupture).
#     n.(X + u(X)) = 0,    e.(X + u(X)) = s,    unknown: direction of the step and tip force R
# R  axial force of the tip, N (N/m in 2D); the tip stops where R is back at the cutting force f_c
# Source: limit of a rate-dependent resistance f_c + eta dl/dt for eta to zero; docs/theory.md.
def advance_at_fixed_depth(equations: StepEquations, length: float, depth: float) -> StepSolution:
    """Return the forces with a tip that advances at a fixed depth; the tip force is a result.

    Parameters
    ----------
    equations : StepEquations
    length : float, m
        Length of the growing segment after the advance.
    depth : float, m

    Raises
    ------
    SimulationError
        No equilibrium was found.
    """
    begin = _sideways(equations, length)

    def evaluate(sideways: Floats) -> tuple[StepSolution, Floats]:
        position = equations.at_point(_ahead(equations, length, sideways), equations.cut_path.count)
        solution = equations.solve(position, depth, -np.inf, np.inf)
        return solution, solution.lateral_gap

    def near(sideways: Floats, change: Floats) -> Floats:
        return _within(sideways, change, length)

    found = _solve(evaluate, begin, np.eye(len(begin)), near)
    if found is None:
        raise _not_found(equations, length, depth)
    return found


def _not_found(equations: StepEquations, length: float, depth: float) -> SimulationError:
    """Return the error of a growing segment without equilibrium at a depth."""
    begin, count = _sideways(equations, length), equations.cut_path.count

    def solved(sideways: Floats) -> StepSolution:
        position = equations.at_point(_ahead(equations, length, sideways), count)
        return equations.solve(position, depth, -np.inf, np.inf)

    turning = smallest_turning(lambda sideways: solved(sideways).lateral_gap, begin, length)
    limit = equations.front().cutting_force
    return SimulationError(not_found(length, equations.cut_path.vertices[-1], turning, limit))


def find_arrest(
    equations: StepEquations, high: float, depth: float, low: float | None = None
) -> StepSolution:
    """Return the solution at which a rupture ends: the tip force is the cutting force again.

    Parameters
    ----------
    equations : StepEquations
    high : float, m
        Length of the growing segment at which the tip force is smaller than the cutting force.
    depth : float, m
    low : float, m, optional
        Length at which it is known to be larger.
    """
    if low is None:
        low, near = _near(equations, high, depth)
        if near.excess_cutting_force <= 0.0:
            return near
    length = root_between(
        lambda x: advance_at_fixed_depth(equations, x, depth).excess_cutting_force,
        low,
        high,
        1e-12 * high,
    )
    return advance_at_fixed_depth(equations, length, depth)


def _near(equations: StepEquations, high: float, depth: float) -> tuple[float, StepSolution]:
    """Return a length of the growing segment below that of the arrest, and the solution there.

    If the crack front is beside the axis, a tip that is very close to it cannot be on the axis.
    Then the smallest trial length with an equilibrium is returned, which may be beyond the arrest.
    """
    start = equations.cut_path.length - equations.cut_path.arcs[-1]
    share, found = NEAREST, None
    while share < 1.0:
        length = start + share * (high - start)
        try:
            found = length, advance_at_fixed_depth(equations, length, depth)
        except SimulationError:
            if found is not None:
                return found
            share *= 4.0
            continue
        if found[1].excess_cutting_force > 0.0 or share <= CLOSEST:
            return found
        share *= CLOSER
    return high, advance_at_fixed_depth(equations, high, depth)


def segment_target(equations: StepEquations) -> float:
    """Return the length to which the growing segment is extended, m.

    This is the path spacing, or slightly more than the present length if that is nearly reached.
    """
    spacing, cut_path = equations.instrument.spacing, equations.cut_path
    return max(spacing, cut_path.length - cut_path.arcs[-1] + LEAST * spacing)


def extend_until_segment_full(
    equations: StepEquations, depth: float, room: float = np.inf
) -> StepSolution | None:
    """Return the forces with a tip that has cut up to a depth or until its segment is full.

    The unknown is the length of the path, because depth and forces are smooth functions of it also
    at a limit point.

    Parameters
    ----------
    equations : StepEquations
    depth : float, m
        Largest depth.
    room : float, m
        Largest length that the tip may cut.

    Returns
    -------
    Solution; None if a rupture begins at once.
    """
    start, cut_path = equations.depth, equations.cut_path
    if depth <= start:  # a needle that is retracted does not cut
        return None
    low = cut_path.length - cut_path.arcs[-1]
    high = min(segment_target(equations), low + room)
    step = extend_to_length(equations, high, depth)
    if step is None or _may_fall(equations, step, low, high):
        peak = _peak(equations, low, high, depth)
        if step is None or (peak is not None and peak.depth > step.depth):
            step = peak
    if step is None or step.depth <= start + GAIN:
        return None
    return step if step.depth <= depth else _cut_to_depth(equations, step, depth)


def _cut_to_depth(
    equations: StepEquations, beyond: StepSolution, depth: float
) -> StepSolution | None:
    """Return the forces with a tip that has cut up to a depth.

    Parameters
    ----------
    equations : StepEquations
    beyond : StepSolution
        Solution at a larger depth.
    depth : float, m

    Returns
    -------
    Solution; None if a rupture begins at once: with a longer path at the present depth, the tip
    force would exceed the cutting force.
    """
    start, cut_path = equations.depth, equations.cut_path
    low, high = cut_path.length - cut_path.arcs[-1], beyond.position.length

    def excess_depth(length: float) -> float:
        if length == low:
            return start - depth
        found = extend_to_length(equations, length, depth)
        if found is None:
            raise _NotCutError(length)
        return found.depth - depth

    try:
        length = root_between(excess_depth, low, high, 1e-12 * high)
        return extend_to_length(equations, length, depth)
    except _NotCutError as error:
        if advance_at_fixed_depth(equations, error.length, start).excess_cutting_force > 0.0:
            return None
        raise _not_found(equations, error.length, depth) from error


def _may_fall(equations: StepEquations, step: StepSolution, low: float, high: float) -> bool:
    """Say whether the depth may have a maximum in a segment: its second half gains little depth."""
    middle = extend_to_length(equations, 0.5 * (low + high), step.depth)
    return middle is None or step.depth - middle.depth < LITTLE * (middle.depth - equations.depth)


def _peak(equations: StepEquations, low: float, high: float, depth: float) -> StepSolution | None:
    """Return the solution at the largest depth between two lengths of the growing segment."""
    found: list[StepSolution] = []

    def negative_depth(length: float) -> float:
        step = extend_to_length(equations, length, depth)
        if step is None:
            return high - equations.depth
        found.append(step)
        return -step.depth

    options = {"xatol": PEAK * (high - low)}
    scipy.optimize.minimize_scalar(
        negative_depth, bounds=(low, high), method="bounded", options=options
    )
    return max(found, key=lambda step: step.depth, default=None)


def _sideways(equations: StepEquations, length: float) -> Floats:
    """Return the expected lateral position of the tip relative to the last vertex, m.

    It is extrapolated from the part of the growing segment that is already cut.
    """
    cut_path = equations.cut_path
    grown = cut_path.crack_front - cut_path.vertices[-1]
    size = float(np.linalg.norm(grown))
    lateral = equations.instrument.axis.lateral_directions @ grown
    found: Floats = lateral * (length / size) if size > 0.0 else lateral
    return found


def _ahead(equations: StepEquations, length: float, sideways: Floats) -> Floats:
    """Return the material point at a distance from the last vertex, given its lateral component."""
    axis = equations.instrument.axis
    forward = np.sqrt(np.maximum(length**2 - sideways @ sideways, 0.0))
    found: Floats = (
        equations.cut_path.vertices[-1]
        + forward * axis.direction
        + sideways @ axis.lateral_directions
    )
    return found


def _within(sideways: Floats, change: Floats, length: float) -> Floats:
    """Limit a change so that the lateral component stays smaller than the length of the segment."""
    target = sideways + change
    size = float(np.linalg.norm(target))
    return target * min(1.0, 0.9 * length / size) - sideways if size > 0.0 else change
