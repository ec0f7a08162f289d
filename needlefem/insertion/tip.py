"""Where the tip goes in a step: it stays on the crack front, cuts on, or is drawn back."""

import numpy as np

from needlefem._arrays import Floats
from needlefem.errors import SimulationError
from needlefem.fem.interpolation import OutsideError
from needlefem.insertion.broyden import MOST_BROYDEN_ITERATIONS, broyden
from needlefem.insertion.step_equations import TOLERANCE, StepEquations, StepSolution


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
        f"{MOST_BROYDEN_ITERATIONS} iterations; shorten discretisation.time_step or path_spacing"
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
