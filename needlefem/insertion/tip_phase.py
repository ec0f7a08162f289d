"""Which way the tip goes in a step, and where within the step it takes another."""

import dataclasses
from collections.abc import Callable

import numpy as np

from needlefem.insertion.broyden import root_between
from needlefem.insertion.growth import climb, cut_to
from needlefem.insertion.state import State, Way
from needlefem.insertion.step_equations import TOLERANCE, Solution, StepEquations
from needlefem.insertion.tip import cut, draw, press

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


AT_FRONT = (Way.PRESSING, Way.CUTTING, Way.JUMPING)


@dataclasses.dataclass(frozen=True, eq=False)
class Moment:
    """A way of the tip, with the forces at one depth.

    Parameters
    ----------
    way : Way
    arc : float, m
        Path length at which the tip is.
    depth : float, m
    solution : Solution, optional
        None: the tip runs ahead, or the needle is out.
    whole : bool
        Whether the growing piece ends here, whatever its length: where the tip begins to run ahead
        and where it stops, as in path following.
    """

    way: Way
    arc: float
    depth: float
    solution: Solution | None
    whole: bool = False


def attempt(equations: StepEquations, way: Way, arc: float, depth: float) -> Moment:
    """Return what the tip does at a depth.

    Parameters
    ----------
    equations : StepEquations
    way : Way
        At the step's start.
    arc : float, m
        Path length at which the tip was.
    depth : float, m
    """
    if way in (Way.WITHDRAWN, Way.OUT):
        drawn = _drawn(equations, arc, depth)
        if drawn is not None:
            return drawn
    pressed = press(equations, depth)
    if pressed.tip_force <= 0.0 and pressed.gap > TOLERANCE:
        drawn = _drawn(equations, equations.track.length, depth)
        if drawn is not None:
            return drawn
    if pressed.excess >= 0.0 and pressed.gap < -TOLERANCE:
        ahead = -pressed.gap
        found = cut(equations, depth, ahead)
        reach = max(abs(depth - equations.depth), ahead)
        limit = FAR * reach + NEAR * equations.instrument.spacing
        track = equations.track
        if found is not None and np.linalg.norm(found.position.tip - track.front) > limit:
            found = None
        return Moment(Way.CUTTING, track.length, depth, found)
    return Moment(Way.PRESSING, equations.track.length, depth, pressed)


def _drawn(equations: StepEquations, arc: float, depth: float) -> Moment | None:
    found = draw(equations, depth, arc)
    if found is None:
        return None
    arc, solution = found
    if solution.gap > TOLERANCE or arc <= TOLERANCE:
        return Moment(Way.OUT, 0.0, depth, None)
    return Moment(Way.WITHDRAWN, arc, depth, solution)


def first_change(equations: StepEquations, state: State, arc: float, new: Moment) -> Moment | None:
    """Return the moment at which the tip took the new way, if that is within the step.

    Parameters
    ----------
    equations : StepEquations
    state : State
        At the step's start.
    arc : float, m
        Path length at which the tip was then.
    new : Moment
        At its end.
    """
    start, end, length = equations.depth, new.depth, equations.track.length
    was_there, is_there = state.way in AT_FRONT, new.way in AT_FRONT
    depth = None
    if was_there and not is_there and state.tip_force > 0.0:
        depth = _root(lambda s: _held(equations, s).tip_force, start, end)
    elif was_there and new.way is Way.CUTTING:
        if state.tip_force < (1.0 - CLOSE) * equations.front().cutting_force:
            depth = _root(lambda s: _held(equations, s).excess, start, end)
    elif is_there and not was_there:
        depth = _root(lambda s: _loose(equations, length, s).gap, start, end)
        if depth is not None:
            return Moment(Way.PRESSING, length, depth, _loose(equations, length, depth))
    elif new.way is Way.OUT and state.way is not Way.OUT:
        return _exit(equations, arc, new)
    elif state.way is Way.OUT and new.way is not Way.OUT:
        depth = _root(lambda s: _loose(equations, 0.0, s).gap, start, end)
        return None if depth is None else Moment(Way.OUT, 0.0, depth, None)
    if depth is None:
        return None
    return Moment(Way.PRESSING, length, depth, _held(equations, depth))


def _exit(equations: StepEquations, arc: float, new: Moment) -> Moment | None:
    """Return the last moment of the tip in the tissue, or that of leaving it.

    Tissue that friction drags out of its skin springs off the needle beyond the skin's place.
    """
    low, high, last = equations.depth, new.depth, None
    skin = _root(lambda s: _loose(equations, 0.0, s).gap, low, high)
    if skin is not None:
        at_skin = _drawn(equations, arc, skin)
        if at_skin is None or at_skin.way is Way.OUT:
            return Moment(Way.OUT, 0.0, skin, None)
        low, last = skin, at_skin
    shortest = SPRING * abs(high - equations.depth)
    while abs(high - low) > max(shortest, SHORTEST):
        middle = 0.5 * (low + high)
        found = _drawn(equations, arc, middle)
        if found is None or found.way is Way.OUT:
            high = middle
        else:
            low, last = middle, found
    return last or Moment(Way.OUT, 0.0, high, None)


def _held(equations: StepEquations, depth: float) -> Solution:
    """Return the forces with the tip held at the crack front, whatever force that takes."""
    return equations.solve(equations.front(), depth, -np.inf, np.inf)


def _loose(equations: StepEquations, arc: float, depth: float) -> Solution:
    return equations.solve(equations.at_arc(arc), depth, 0.0, 0.0)


def _root(function: Callable[[float], float], start: float, end: float) -> float | None:
    """Return where a function of depth vanishes within a step, or None: not before its end."""
    values = function(start), function(end)
    if min(map(abs, values)) <= CLOSE * max(map(abs, values)) or values[0] * values[1] > 0.0:
        return None
    return root_between(function, start, end, FINE * abs(end - start))


def within_piece(equations: StepEquations, new: Moment, room: float = np.inf) -> Moment:
    """Return the moment in the step at which the growing piece is whole, if there is one.

    A tip that was not found where it should have cut to is looked for on the way there.

    Parameters
    ----------
    equations : StepEquations
    new : Moment
        At the step's end.
    room : float, m
        How far the tip may cut on at most.
    """
    if new.way is not Way.CUTTING:
        return new
    track, spacing = equations.track, equations.instrument.spacing
    if new.solution is None:
        found = climb(equations, new.depth, room)
    elif new.solution.position.length <= (1.0 + 1e-9) * spacing:
        return new
    else:
        found = cut_to(equations, spacing, new.depth)
    if found is None or not equations.depth < found.depth <= new.depth + TOLERANCE:
        return new
    there = abs(found.depth - new.depth) <= TOLERANCE
    depth = new.depth if there else found.depth
    return Moment(Way.CUTTING, track.length, depth, found, whole=not there)
