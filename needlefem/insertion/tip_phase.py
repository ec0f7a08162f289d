"""Phase of the tip in one step, and the point within a step at which the phase changes."""

import dataclasses
from collections.abc import Callable

import numpy as np

from needlefem._arrays import Floats
from needlefem.contact.condensed_contact import CondensedContact, ContactTrial
from needlefem.fem.interpolation import LinearFunctionals
from needlefem.insertion.state import State, TipPhase
from needlefem.insertion.step_equations import TOLERANCE, StepEquations, StepSolution, root_between
from needlefem.insertion.tip_advance import (
    extend_to_length,
    extend_until_segment_full,
    solve_cutting,
    solve_loading,
    solve_retraction,
)

FAR = 4.0
"""Advance over the needle's travel from which on a tip has run ahead."""
NEAR = 0.02
"""Advance over the spacing up to which it has not."""
FINE = 1e-10
"""Part of a step to which the depth of a change is found."""
SPRING, SHORTEST = 1e-6, 1e-10
"""Part of a step, and length (m), to which the depth is found at which tissue springs off."""
CLOSE = 1e-9
"""What changes at the step's end, to this part of the change, needs no cut of the step."""


AT_FRONT = (TipPhase.LOADING, TipPhase.CUTTING, TipPhase.RUPTURE)


@dataclasses.dataclass(frozen=True, eq=False)
class TipTrial:
    """A way of the tip, with the forces at one depth.

    Parameters
    ----------
    way : TipPhase
    arc : float, m
        Path length at which the tip is.
    depth : float, m
    solution : StepSolution, optional
        None: the tip advances at fixed depth, or the needle is outside.
    whole : bool
        Whether the growing piece ends here, whatever its length: where the tip begins to run ahead
        and where it stops, as in path following.
    """

    phase: TipPhase
    arc: float
    depth: float
    solution: StepSolution | None
    segment_full: bool = False


def trial_step(equations: StepEquations, way: TipPhase, arc: float, depth: float) -> TipTrial:
    """Return what the tip does at a depth.

    Parameters
    ----------
    equations : StepEquations
    way : TipPhase
        At the step's start.
    arc : float, m
        Path length at which the tip was.
    depth : float, m
    """
    if way in (TipPhase.RETRACTED, TipPhase.OUTSIDE):
        drawn = _drawn(equations, arc, depth)
        if drawn is not None:
            return drawn
    pressed = solve_loading(equations, depth)
    if pressed.tip_force <= 0.0 and pressed.axial_gap > TOLERANCE:
        drawn = _drawn(equations, equations.track.length, depth)
        if drawn is not None:
            return drawn
    if pressed.excess_cutting_force >= 0.0 and pressed.axial_gap < -TOLERANCE:
        ahead = -pressed.axial_gap
        found = solve_cutting(equations, depth, ahead)
        reach = max(abs(depth - equations.depth), ahead)
        limit = FAR * reach + NEAR * equations.instrument.spacing
        track = equations.track
        if found is not None and np.linalg.norm(found.position.tip - track.crack_front) > limit:
            found = None
        return TipTrial(TipPhase.CUTTING, track.length, depth, found)
    return TipTrial(TipPhase.LOADING, equations.track.length, depth, pressed)


def _drawn(equations: StepEquations, arc: float, depth: float) -> TipTrial | None:
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
    """Return the moment at which the tip took the new way, if that is within the step.

    Parameters
    ----------
    equations : StepEquations
    state : State
        At the step's start.
    arc : float, m
        Path length at which the tip was then.
    new : TipTrial
        At its end.
    """
    start, end, length = equations.depth, new.depth, equations.track.length
    was_there, is_there = state.tip_phase in AT_FRONT, new.phase in AT_FRONT
    depth = None
    if was_there and not is_there and state.tip_force > 0.0:
        depth = _root(lambda s: _held(equations, s).tip_force, start, end)
    elif was_there and new.phase is TipPhase.CUTTING:
        if state.tip_force < (1.0 - CLOSE) * equations.front().cutting_force:
            depth = _root(lambda s: _held(equations, s).excess_cutting_force, start, end)
    elif is_there and not was_there:
        depth = _root(lambda s: _loose(equations, length, s).axial_gap, start, end)
        if depth is not None:
            return TipTrial(TipPhase.LOADING, length, depth, _loose(equations, length, depth))
    elif new.phase is TipPhase.OUTSIDE and state.tip_phase is not TipPhase.OUTSIDE:
        return _exit(equations, arc, new)
    elif state.tip_phase is TipPhase.OUTSIDE and new.phase is not TipPhase.OUTSIDE:
        depth = _root(lambda s: _loose(equations, 0.0, s).axial_gap, start, end)
        return None if depth is None else TipTrial(TipPhase.OUTSIDE, 0.0, depth, None)
    if depth is None:
        return None
    return TipTrial(TipPhase.LOADING, length, depth, _held(equations, depth))


def _exit(equations: StepEquations, arc: float, new: TipTrial) -> TipTrial | None:
    """Return the last moment of the tip in the tissue, or that of leaving it.

    Tissue that friction drags out of its skin springs off the needle beyond the skin's place.
    """
    low, high, last = equations.depth, new.depth, None
    skin = _root(lambda s: _loose(equations, 0.0, s).axial_gap, low, high)
    if skin is not None:
        at_skin = _drawn(equations, arc, skin)
        if at_skin is None or at_skin.phase is TipPhase.OUTSIDE:
            return TipTrial(TipPhase.OUTSIDE, 0.0, skin, None)
        low, last = skin, at_skin
    shortest = SPRING * abs(high - equations.depth)
    while abs(high - low) > max(shortest, SHORTEST):
        middle = 0.5 * (low + high)
        found = _drawn(equations, arc, middle)
        if found is None or found.phase is TipPhase.OUTSIDE:
            high = middle
        else:
            low, last = middle, found
    return last or TipTrial(TipPhase.OUTSIDE, 0.0, high, None)


def _held(equations: StepEquations, depth: float) -> StepSolution:
    """Return the forces with the tip held at the crack front, whatever force that takes."""
    return equations.solve(equations.front(), depth, -np.inf, np.inf)


def _loose(equations: StepEquations, arc: float, depth: float) -> StepSolution:
    return equations.solve(equations.at_arc(arc), depth, 0.0, 0.0)


def _root(function: Callable[[float], float], start: float, end: float) -> float | None:
    """Return where a function of depth vanishes within a step, or None: not before its end."""
    values = function(start), function(end)
    if min(map(abs, values)) <= CLOSE * max(map(abs, values)) or values[0] * values[1] > 0.0:
        return None
    return root_between(function, start, end, FINE * abs(end - start))


def limit_to_segment(equations: StepEquations, new: TipTrial, room: float = np.inf) -> TipTrial:
    """Return the moment in the step at which the growing piece is whole, if there is one.

    A tip that was not found where it should have cut to is looked for on the way there.

    Parameters
    ----------
    equations : StepEquations
    new : TipTrial
        At the step's end.
    room : float, m
        How far the tip may cut on at most.
    """
    if new.phase is not TipPhase.CUTTING:
        return new
    track, spacing = equations.track, equations.instrument.spacing
    if new.solution is None:
        found = extend_until_segment_full(equations, new.depth, room)
    elif new.solution.position.length <= (1.0 + 1e-9) * spacing:
        return new
    else:
        found = extend_to_length(equations, spacing, new.depth)
    if found is None or not equations.depth < found.depth <= new.depth + TOLERANCE:
        return new
    there = abs(found.depth - new.depth) <= TOLERANCE
    depth = new.depth if there else found.depth
    return TipTrial(TipPhase.CUTTING, track.length, depth, found, segment_full=not there)


# The tip on uncut skin.


NEGLIGIBLE_FORCE = 1e-9
"""Force at a step's end, to this part of that at its other end, that is none."""


@dataclasses.dataclass(frozen=True, eq=False)
class SkinContact:
    """The forces (N, N/m in 2D) of a tip that holds the entry point at a depth (m)."""

    trial: ContactTrial
    depth: float
    forces: Floats
    punctured: bool


def press_skin(
    contact: CondensedContact, weights: LinearFunctionals, limit: float, depths: tuple[float, float]
) -> SkinContact:
    """Press on the entry point, to a depth, or until the skin is cut, left or met.

    Parameters
    ----------
    contact : CondensedContact
        Without a path.
    weights : LinearFunctionals
        The tip's kernel at the entry point.
    limit : float, N (N/m in 2D)
        Force at which it cuts.
    depths : (float, float), m
        At the step's start, where the force is lower, and at its end; the same: the step can't
        be cut where the skin is.
    """
    trial, (start, depth) = contact.trial(weights), depths
    forces = holding(contact, trial, depth)
    if depth != start:
        first = holding(contact, trial, start)
        per_depth = (forces[0] - first[0]) / (depth - start)
        small = NEGLIGIBLE_FORCE * max(abs(forces[0]), abs(first[0]))
        if forces[0] > limit:
            depth -= float((forces[0] - limit) / per_depth)
            forces = holding(contact, trial, depth)
            forces[0] = limit
        elif first[0] * forces[0] < 0.0 and min(abs(first[0]), abs(forces[0])) > small:
            depth -= float(forces[0] / per_depth)
            forces = np.zeros_like(forces)
    return SkinContact(trial, depth, forces, bool(forces[0] >= limit))


def holding(contact: CondensedContact, trial: ContactTrial, depth: float) -> Floats:
    """Return the forces that hold the material of a trial at the tip, pulling or pushing.

    Shape (dim,), N (N/m in 2D).
    """
    wanted = np.zeros(contact.dim)
    wanted[0] = depth
    found: Floats = np.linalg.solve(trial.bare, wanted - trial.displacement).astype(float)
    return found
