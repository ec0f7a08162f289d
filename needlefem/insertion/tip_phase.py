"""Phase of the tip in one step, and the point within a step at which the phase changes."""

import dataclasses
from collections.abc import Callable

import numpy as np

from needlefem._arrays import Floats
from needlefem._root_finding import root_between
from needlefem.contact.condensed_contact import CondensedContact, ContactTrial
from needlefem.fem.interpolation import LinearFunctionals
from needlefem.insertion.state import State, TipPhase
from needlefem.insertion.step_equations import TOLERANCE, StepEquations, StepSolution
from needlefem.insertion.tip_advance import (
    extend_to_length,
    extend_until_segment_full,
    solve_cutting,
    solve_loading,
    solve_retraction,
)

FAR = 4.0
"""Advance of the tip over the travel of the needle above which the step contains a rupture."""
NEAR = 0.02
"""Advance of the tip, over the path spacing, that is accepted without a rupture."""
FINE = 1e-10
"""Tolerance of the depth of an event, relative to the step."""
SPRING, SHORTEST = 1e-6, 1e-10
"""Tolerance of the depth of an exit: relative to the step, and absolute (m)."""
CLOSE = 1e-9
"""Relative distance from the end of the step within which an event does not divide the step."""


AT_FRONT = (TipPhase.LOADING, TipPhase.CUTTING, TipPhase.RUPTURE)


@dataclasses.dataclass(frozen=True, eq=False)
class TipTrial:
    """A phase of the tip, and the forces at one depth.

    Parameters
    ----------
    phase : TipPhase
    arc : float, m
        Path length at the tip.
    depth : float, m
    solution : StepSolution, optional
        None: the tip advances at fixed depth, or the needle is outside.
    segment_full : bool
        Whether the growing segment ends here, although it may be shorter than the path spacing: at
        the beginning and at the end of a rupture, as in path following.
    """

    phase: TipPhase
    arc: float
    depth: float
    solution: StepSolution | None
    segment_full: bool = False


def trial_step(equations: StepEquations, phase: TipPhase, arc: float, depth: float) -> TipTrial:
    """Return phase and forces of the tip at a depth.

    Parameters
    ----------
    equations : StepEquations
    phase : TipPhase
        Phase at the start of the step.
    arc : float, m
        Path length at the tip at the start of the step.
    depth : float, m
        Depth at the end of the step.
    """
    if phase in (TipPhase.RETRACTED, TipPhase.OUTSIDE):
        retracted = _retracted(equations, arc, depth)
        if retracted is not None:
            return retracted
    loading = solve_loading(equations, depth)
    if loading.tip_force <= 0.0 and loading.axial_gap > TOLERANCE:
        retracted = _retracted(equations, equations.cut_path.length, depth)
        if retracted is not None:
            return retracted
    if loading.excess_cutting_force >= 0.0 and loading.axial_gap < -TOLERANCE:
        ahead = -loading.axial_gap
        found = solve_cutting(equations, depth, ahead)
        reach = max(abs(depth - equations.depth), ahead)
        limit = FAR * reach + NEAR * equations.instrument.spacing
        cut_path = equations.cut_path
        if found is not None and np.linalg.norm(found.position.tip - cut_path.crack_front) > limit:
            found = None
        return TipTrial(TipPhase.CUTTING, cut_path.length, depth, found)
    return TipTrial(TipPhase.LOADING, equations.cut_path.length, depth, loading)


def _retracted(equations: StepEquations, arc: float, depth: float) -> TipTrial | None:
    """Return the trial of a retracted tip, or None if the tip is beyond the crack front."""
    found = solve_retraction(equations, depth, arc)
    if found is None:
        return None
    arc, solution = found
    if solution.axial_gap > TOLERANCE or arc <= TOLERANCE:
        return TipTrial(TipPhase.OUTSIDE, 0.0, depth, None)
    return TipTrial(TipPhase.RETRACTED, arc, depth, solution)


def first_event(
    equations: StepEquations, state: State, arc: float, new: TipTrial
) -> TipTrial | None:
    """Return the trial at the depth where the tip phase changes, or None if it is not in the step.

    Parameters
    ----------
    equations : StepEquations
    state : State
        State at the start of the step.
    arc : float, m
        Path length at the tip at the start of the step.
    new : TipTrial
        Trial at the end of the step.
    """
    start, end, length = equations.depth, new.depth, equations.cut_path.length
    was_at_front, is_at_front = state.tip_phase in AT_FRONT, new.phase in AT_FRONT
    depth = None
    if was_at_front and not is_at_front and state.tip_force > 0.0:
        depth = _root(lambda s: _fixed_tip(equations, s).tip_force, start, end)
    elif was_at_front and new.phase is TipPhase.CUTTING:
        if state.tip_force < (1.0 - CLOSE) * equations.front().cutting_force:
            depth = _root(lambda s: _fixed_tip(equations, s).excess_cutting_force, start, end)
    elif is_at_front and not was_at_front:
        depth = _root(lambda s: _free_tip(equations, length, s).axial_gap, start, end)
        if depth is not None:
            return TipTrial(TipPhase.LOADING, length, depth, _free_tip(equations, length, depth))
    elif new.phase is TipPhase.OUTSIDE and state.tip_phase is not TipPhase.OUTSIDE:
        return _exit(equations, arc, new)
    elif state.tip_phase is TipPhase.OUTSIDE and new.phase is not TipPhase.OUTSIDE:
        depth = _root(lambda s: _free_tip(equations, 0.0, s).axial_gap, start, end)
        return None if depth is None else TipTrial(TipPhase.OUTSIDE, 0.0, depth, None)
    if depth is None:
        return None
    return TipTrial(TipPhase.LOADING, length, depth, _fixed_tip(equations, depth))


def _exit(equations: StepEquations, arc: float, new: TipTrial) -> TipTrial | None:
    """Return the last trial with the tip in the tissue, or that of a needle outside.

    Friction drags tissue out of the skin. It separates from the needle when the tip is already
    beyond the undeformed skin.
    """
    low, high, last = equations.depth, new.depth, None
    skin = _root(lambda s: _free_tip(equations, 0.0, s).axial_gap, low, high)
    if skin is not None:
        at_skin = _retracted(equations, arc, skin)
        if at_skin is None or at_skin.phase is TipPhase.OUTSIDE:
            return TipTrial(TipPhase.OUTSIDE, 0.0, skin, None)
        low, last = skin, at_skin
    shortest = SPRING * abs(high - equations.depth)
    while abs(high - low) > max(shortest, SHORTEST):
        middle = 0.5 * (low + high)
        found = _retracted(equations, arc, middle)
        if found is None or found.phase is TipPhase.OUTSIDE:
            high = middle
        else:
            low, last = middle, found
    return last or TipTrial(TipPhase.OUTSIDE, 0.0, high, None)


def _fixed_tip(equations: StepEquations, depth: float) -> StepSolution:
    """Return the forces with the tip at the crack front; the tip force may have any value."""
    return equations.solve(equations.front(), depth, -np.inf, np.inf)


def _free_tip(equations: StepEquations, arc: float, depth: float) -> StepSolution:
    """Return the forces with a tip without force at a path length."""
    return equations.solve(equations.at_arc(arc), depth, 0.0, 0.0)


def _root(function: Callable[[float], float], start: float, end: float) -> float | None:
    """Return the depth within a step at which a function is zero, or None if there is none."""
    values = function(start), function(end)
    if min(map(abs, values)) <= CLOSE * max(map(abs, values)) or values[0] * values[1] > 0.0:
        return None
    return root_between(function, start, end, FINE * abs(end - start))


def limit_to_segment(equations: StepEquations, new: TipTrial, room: float = np.inf) -> TipTrial:
    """Return the trial at which the growing segment is full, if this happens within the step.

    If no solution was found at the end of the step, it is searched along the growing segment.

    Parameters
    ----------
    equations : StepEquations
    new : TipTrial
        Trial at the end of the step.
    room : float, m
        Largest length that the tip may cut.
    """
    if new.phase is not TipPhase.CUTTING:
        return new
    cut_path, spacing = equations.cut_path, equations.instrument.spacing
    if new.solution is None:
        found = extend_until_segment_full(equations, new.depth, room)
    elif new.solution.position.length <= (1.0 + 1e-9) * spacing:
        return new
    else:
        found = extend_to_length(equations, spacing, new.depth)
    if found is None or not equations.depth < found.depth <= new.depth + TOLERANCE:
        return new
    at_end = abs(found.depth - new.depth) <= TOLERANCE
    depth = new.depth if at_end else found.depth
    return TipTrial(TipPhase.CUTTING, cut_path.length, depth, found, segment_full=not at_end)


# Contact of the tip with uncut skin.


NEGLIGIBLE_FORCE = 1e-9
"""Force at one end of a step, relative to that at the other end, which is treated as zero."""


@dataclasses.dataclass(frozen=True, eq=False)
class SkinContact:
    """Forces (N, N/m in 2D) of a tip that loads the entry point at a depth (m)."""

    trial: ContactTrial
    depth: float
    forces: Floats
    punctured: bool


def press_skin(
    contact: CondensedContact, weights: LinearFunctionals, limit: float, depths: tuple[float, float]
) -> SkinContact:
    """Load the entry point up to a depth, or until the skin is cut or contact begins or ends.

    Parameters
    ----------
    contact : CondensedContact
        Without active segments.
    weights : LinearFunctionals
        Tip kernel at the entry point.
    limit : float, N (N/m in 2D)
        Cutting force.
    depths : (float, float), m
        At the start of the step and at its end. They are equal if the step cannot be divided.
    """
    trial, (start, depth) = contact.trial(weights), depths
    forces = fixed_point_forces(contact, trial, depth)
    if depth != start:
        first = fixed_point_forces(contact, trial, start)
        per_depth = (forces[0] - first[0]) / (depth - start)
        small = NEGLIGIBLE_FORCE * max(abs(forces[0]), abs(first[0]))
        if forces[0] > limit:
            depth -= float((forces[0] - limit) / per_depth)
            forces = fixed_point_forces(contact, trial, depth)
            forces[0] = limit
        elif first[0] * forces[0] < 0.0 and min(abs(first[0]), abs(forces[0])) > small:
            depth -= float(forces[0] / per_depth)
            forces = np.zeros_like(forces)
    return SkinContact(trial, depth, forces, bool(forces[0] >= limit))


def fixed_point_forces(contact: CondensedContact, trial: ContactTrial, depth: float) -> Floats:
    """Return the tip forces, of either sign, that keep a material point at the tip.

    Shape (dim,), N (N/m in 2D).
    """
    position = np.zeros(contact.dim)
    position[0] = depth
    found: Floats = np.linalg.solve(trial.bare, position - trial.displacement).astype(float)
    return found
