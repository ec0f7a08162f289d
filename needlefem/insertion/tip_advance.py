"""Position of the tip in one step: loading, cutting or retraction, and growth of the cut path."""

import numpy as np
import scipy  # its module of minimisation is imported when it is first used

from needlefem._arrays import Floats
from needlefem.errors import SimulationError
from needlefem.fem.interpolation import OutsideError
from needlefem.insertion.step_equations import (
    MOST_BROYDEN_ITERATIONS,
    TOLERANCE,
    StepEquations,
    StepSolution,
    broyden,
    root_between,
)
from needlefem.insertion.tip_solver import not_found, smallest_turning


def solve_loading(equations: StepEquations, depth: float) -> StepSolution:
    """Return the forces with the tip at the crack front, pressing from nothing to cutting."""
    position = equations.front()
    return equations.solve(position, depth, 0.0, position.cutting_force)


def solve_retraction(
    equations: StepEquations, depth: float, start: float
) -> tuple[float, StepSolution] | None:
    """Return where on its path a tip without force is, and the forces.

    Of several places the first on the way from where it was: friction may drag tissue along so
    far that the tip has two; the one between them can't be held, and where they meet the tissue
    springs off the needle.

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
    last, travel = equations.track.length, depth - equations.depth
    longest = 0.25 * equations.instrument.spacing
    near, far, before = start, np.nan, None
    pace = equations.track.pace * travel
    arc = min(max(start + min(max(pace, -longest), longest), 0.0), last)
    ahead = travel > 0.0
    if start <= 0.0 or not travel or equations.contact.background is not None:
        arc = start  # out, or the tissue moves by itself: it says which way to look
        ahead = equations.solve(equations.at_arc(arc), depth, 0.0, 0.0).axial_gap < 0.0
    for _ in range(MOST_BROYDEN_ITERATIONS):
        solution = equations.solve(equations.at_arc(arc), depth, 0.0, 0.0)
        gap = solution.axial_gap
        if abs(gap) <= TOLERANCE or (gap > 0.0 and arc <= 0.0):
            if travel and arc != start:
                equations.track.pace = (arc - start) / travel
            return arc, solution
        if gap < 0.0 and arc >= last:
            return None
        near, far = (arc, far) if (gap < 0.0) is ahead else (near, arc)
        slope = equations.track.slope
        if before is not None and arc != before[0]:
            slope = (gap - before[1]) / (arc - before[0])
        if slope > 0.0:
            equations.track.slope = slope
        wanted = arc - gap / slope if slope > 0.0 else np.nan
        before = (arc, gap)
        if np.isnan(far):
            bound = near + longest if ahead else near - longest
            wanted = wanted if min(near, bound) < wanted < max(near, bound) else bound
            arc = min(max(wanted, 0.0), last)
        else:
            inside = min(near, far) < wanted < max(near, far)
            arc = wanted if inside else 0.5 * (near + far)
    raise SimulationError(
        f"where the retracted tip is on its cut path was not found at {100.0 * depth:.4g} cm in "
        f"{MOST_BROYDEN_ITERATIONS} iterations; shorten discretization.time_step or path_spacing"
    )


def solve_cutting(equations: StepEquations, depth: float, ahead: float) -> StepSolution | None:
    """Return the forces with a tip that has cut on to a depth, or None: not found.

    Parameters
    ----------
    equations : StepEquations
    depth : float, m
    ahead : float, m
        How far about.
    """
    axis, front = equations.instrument.axis, equations.track.crack_front

    def evaluate(moved: Floats) -> tuple[StepSolution, Floats]:
        position = equations.at_point(front + moved, equations.track.count)
        force = position.cutting_force
        solution = equations.solve(position, depth, force, force)
        return solution, np.append(solution.axial_gap, solution.lateral_gap) @ axis.frame

    def forward(moved: Floats, change: Floats) -> Floats:
        """Let a tip that would go back go half way towards where it was."""
        reach, more = float(axis.direction @ moved), float(axis.direction @ change)
        return change * (-0.5 * reach / more) if reach + more <= 0.0 else change

    try:
        return broyden(evaluate, ahead * axis.direction, np.eye(len(front)), forward)
    except OutsideError:
        return None


# Growth of the cut path by length instead of depth; this includes advance at fixed depth.


PEAK = 1e-4
"""Part of a piece to which the path's largest depth is found."""
NEAREST = 1e-3
"""Part of the way to a landing at which the tip is looked at first."""
CLOSER, CLOSEST = 0.1, 1e-9
"""How much nearer a tip that is beyond its landing is looked for, and the least such part."""
LEAST = 0.01
"""Smallest first advance of the tip at fixed depth, over the length of a contact segment."""
LITTLE = 0.25
"""Depth gained in half of a piece, over that in the half before, below which it may fall."""
GAIN = 1e-9
"""Depth to be gained on the way to the largest that is worth a step, m."""


class _NotCutError(Exception):
    """No equilibrium at the cutting force was found at a length of the growing piece (m)."""

    def __init__(self, length: float) -> None:
        self.length = length


def extend_to_length(equations: StepEquations, length: float, depth: float) -> StepSolution | None:
    """Return the forces with a tip that has cut on until its piece has a length, or None.

    The depth is what it takes. None: not found, or no tissue is around the tip.

    Parameters
    ----------
    equations : StepEquations
    length : float, m
        Of the growing piece.
    depth : float, m
        Guess.
    """
    begin = _sideways(equations, length)

    def evaluate(unknown: Floats) -> tuple[StepSolution, Floats]:
        tip = _ahead(equations, length, unknown[1:])
        position = equations.at_point(tip, equations.track.count)
        force = position.cutting_force
        solution = equations.solve(position, depth + unknown[0], force, force)
        return solution, np.append(solution.axial_gap, solution.lateral_gap)

    def near(unknown: Floats, change: Floats) -> Floats:
        return np.append(change[:1], _within(unknown[1:], change[1:], length))

    jacobian = np.diag([-1.0, *np.ones(len(begin))])
    try:
        return broyden(evaluate, np.append(0.0, begin), jacobian, near)
    except OutsideError:
        return None


# Kernel: advance of the tip at a fixed depth (rupture).
#     n.(X + u(X)) = 0,    e.(X + u(X)) = s,    unknown: direction of the step and tip force R
# R  axial force of the tip, N (N/m in 2D); the tip stops where R is back at the cutting force f_c
# Source: limit of a rate-dependent resistance f_c + eta dl/dt for eta to zero; docs/theory.md.
def advance_at_fixed_depth(equations: StepEquations, length: float, depth: float) -> StepSolution:
    """Return the forces, whatever the tip's is, with a tip that ran ahead at a depth.

    Parameters
    ----------
    equations : StepEquations
    length : float, m
        Of the growing piece.
    depth : float, m
    """
    begin = _sideways(equations, length)

    def evaluate(sideways: Floats) -> tuple[StepSolution, Floats]:
        position = equations.at_point(_ahead(equations, length, sideways), equations.track.count)
        solution = equations.solve(position, depth, -np.inf, np.inf)
        return solution, solution.lateral_gap

    def near(sideways: Floats, change: Floats) -> Floats:
        return _within(sideways, change, length)

    found = broyden(evaluate, begin, np.eye(len(begin)), near)
    if found is None:
        raise _not_found(equations, length, depth)
    return found


def _not_found(equations: StepEquations, length: float, depth: float) -> SimulationError:
    """Return the error of a piece of which no length is in equilibrium at a depth."""
    begin, count = _sideways(equations, length), equations.track.count

    def solved(sideways: Floats) -> StepSolution:
        position = equations.at_point(_ahead(equations, length, sideways), count)
        return equations.solve(position, depth, -np.inf, np.inf)

    turning = smallest_turning(lambda sideways: solved(sideways).lateral_gap, begin, length)
    limit = equations.front().cutting_force
    return SimulationError(not_found(length, equations.track.vertices[-1], turning, limit))


def find_arrest(
    equations: StepEquations, high: float, depth: float, low: float | None = None
) -> StepSolution:
    """Return where a tip that ran ahead stops: its force is back at that of cutting.

    Parameters
    ----------
    equations : StepEquations
    high : float, m
        Length of the growing piece at which the force is below.
    depth : float, m
    low : float, m, optional
        Length at which it is known to be above.
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
    """Return a length ahead that is below that of landing, and the solution there.

    A front beside the axis can't be on it with a tip that is nearer than that: then it is the
    least length, of those tried, at which there is an equilibrium, and may be beyond the landing.
    """
    start = equations.track.length - equations.track.arcs[-1]
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
    """Return the length to which the growing piece grows, m: whole, and not all but reached."""
    spacing, track = equations.instrument.spacing, equations.track
    return max(spacing, track.length - track.arcs[-1] + LEAST * spacing)


def extend_until_segment_full(
    equations: StepEquations, depth: float, room: float = np.inf
) -> StepSolution | None:
    """Return the forces with a tip that has cut on, up to a depth or until its piece is whole.

    The path's length is the unknown's place in which all is smooth, also where the tip all but
    runs ahead.

    Parameters
    ----------
    equations : StepEquations
    depth : float, m
        Largest depth.
    room : float, m
        How far the tip may cut on at most.

    Returns
    -------
    Solution, or None: the tip runs ahead at once.
    """
    start, track = equations.depth, equations.track
    if depth <= start:  # a needle that goes back does not cut
        return None
    low = track.length - track.arcs[-1]
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
    """Return the forces with a tip that has cut on to a depth, on its way beyond it.

    Parameters
    ----------
    equations : StepEquations
    beyond : StepSolution
        With the tip beyond the depth.
    depth : float, m

    Returns
    -------
    Solution, or None: the tip runs ahead at once, for its force would be beyond that of cutting if
    the path were longer at the depth of now.
    """
    start, track = equations.depth, equations.track
    low, high = track.length - track.arcs[-1], beyond.position.length

    def missed(length: float) -> float:
        if length == low:
            return start - depth
        found = extend_to_length(equations, length, depth)
        if found is None:
            raise _NotCutError(length)
        return found.depth - depth

    try:
        return extend_to_length(equations, root_between(missed, low, high, 1e-12 * high), depth)
    except _NotCutError as error:
        if advance_at_fixed_depth(equations, error.length, start).excess_cutting_force > 0.0:
            return None
        raise _not_found(equations, error.length, depth) from error


def _may_fall(equations: StepEquations, step: StepSolution, low: float, high: float) -> bool:
    """Say whether depth may have a maximum within a piece: its second half gains little."""
    middle = extend_to_length(equations, 0.5 * (low + high), step.depth)
    return middle is None or step.depth - middle.depth < LITTLE * (middle.depth - equations.depth)


def _peak(equations: StepEquations, low: float, high: float, depth: float) -> StepSolution | None:
    """Return the solution at the largest depth within lengths of the growing piece."""
    found: list[StepSolution] = []

    def below(length: float) -> float:
        step = extend_to_length(equations, length, depth)
        if step is None:
            return high - equations.depth
        found.append(step)
        return -step.depth

    options = {"xatol": PEAK * (high - low)}
    scipy.optimize.minimize_scalar(below, bounds=(low, high), method="bounded", options=options)
    return max(found, key=lambda step: step.depth, default=None)


def _sideways(equations: StepEquations, length: float) -> Floats:
    """Return where across the axis a tip at a length is expected, from the piece's vertex."""
    track = equations.track
    grown = track.crack_front - track.vertices[-1]
    size = float(np.linalg.norm(grown))
    lean = equations.instrument.axis.lateral_directions @ grown
    found: Floats = lean * (length / size) if size > 0.0 else lean
    return found


def _ahead(equations: StepEquations, length: float, sideways: Floats) -> Floats:
    """Return the point at a distance from the growing piece's vertex."""
    axis = equations.instrument.axis
    forward = np.sqrt(np.maximum(length**2 - sideways @ sideways, 0.0))
    found: Floats = (
        equations.track.vertices[-1] + forward * axis.direction + sideways @ axis.lateral_directions
    )
    return found


def _within(sideways: Floats, change: Floats, length: float) -> Floats:
    """Keep the tip's advance shorter than it is sideways."""
    wanted = sideways + change
    size = float(np.linalg.norm(wanted))
    return wanted * min(1.0, 0.9 * length / size) - sideways if size > 0.0 else change
