"""Events of a motion, and the time within a step at which the needle crosses the skin."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from needlefem._arrays import Points, Vector
from needlefem.fem.interpolation import LinearFunctionals
from needlefem.insertion.cut_path import CutPath
from needlefem.insertion.motion_schedule import TimeStep
from needlefem.insertion.result import Event, Seed
from needlefem.insertion.state import State, TipPhase
from needlefem.insertion.step_equations import Field, root_between
from needlefem.insertion.tip_phase import holding, trial_step

if TYPE_CHECKING:
    from needlefem.insertion.progress import Progress

CHANGES = {
    (TipPhase.LOADING, TipPhase.RETRACTED): "retraction_start",
    (TipPhase.CUTTING, TipPhase.RETRACTED): "retraction_start",
    (TipPhase.RETRACTED, TipPhase.LOADING): "recontact",
    (TipPhase.RETRACTED, TipPhase.CUTTING): "recontact",
    (TipPhase.RETRACTED, TipPhase.OUTSIDE): "exit",
    (TipPhase.OUTSIDE, TipPhase.RETRACTED): "entry",
}
"""What a change of the tip's way is called."""


class EventLog:
    """Events and seeds of one motion.

    Parameters
    ----------
    track : CutPath
    timeless : bool
        Whether steps are cut where something happens.

    Attributes
    ----------
    events : list of Event
        May be emptied by who has read them.
    seeds : list of Seed
    """

    def __init__(self, track: CutPath, *, timeless: bool) -> None:
        self.events: list[Event] = []
        self.seeds: list[Seed] = []
        self._track, self._timeless = track, timeless
        self._way_in = [(0.0, track.instrument.axis.entry)]
        self._sticking = False

    def record(self, kind: str, energy: float, at: State, name: str = "") -> None:
        """Note an event."""
        self.events.append(Event(kind, at.time, at.depth, at.tip, energy, name))

    def record_deepest(self, state: State) -> None:
        """Remember the tip's material if the needle was never deeper."""
        if state.depth > self._way_in[-1][0] and state.tip_phase is not TipPhase.OUTSIDE:
            self._way_in.append((state.depth, state.tip))

    def record_transitions(self, old: State, new: State, spent: tuple[float, float]) -> None:
        """Note what changed from one state to the next.

        Parameters
        ----------
        old, new : State
        spent : (float, float)
            What friction, and what the tip took in the step, J (J/m in 2D).
        """
        friction, tip = spent
        if (old.tip_phase, new.tip_phase) in CHANGES and (
            len(old.friction_force) or len(new.friction_force)
        ):
            # a step is cut before the tip leaves and after it arrives
            arrived = (
                new.tip_phase in (TipPhase.OUTSIDE, TipPhase.LOADING, TipPhase.CUTTING)
                or not self._timeless
            )
            took = tip + (friction if new.tip_phase is TipPhase.OUTSIDE else 0.0)
            self.record(CHANGES[old.tip_phase, new.tip_phase], took, new if arrived else old)
        if len(new.friction_force) < 2 or new.slipping is None:
            return
        slipping = np.count_nonzero(new.slipping[1:])
        if self._sticking and slipping == len(new.friction_force) - 1:
            self._sticking = False
            self.record("full_slip", friction, new)
        elif not self._sticking and slipping == 0:
            self._sticking = True
            self.record("full_stick", friction, new)

    def release(self, name: str, state: State, world: Vector) -> None:
        """Let the tip, at a point of the world, let go of something."""
        weights = LinearFunctionals(state.tip_nodes, state.tip_weights[None])
        self.seeds.append(
            Seed(
                name=name,
                time=state.time,
                released_at=world,
                point=state.tip,
                elastic_prediction=self._shortcut(state),
                weights=weights,
                inside=len(state.friction_force) > 0,
            )
        )
        self.record("release", 0.0, state, name)

    def _shortcut(self, state: State) -> Vector:
        """Return the material that was at the tip at this depth on the way in."""
        depths = np.array([depth for depth, _ in self._way_in])
        if state.depth >= depths[-1]:
            return state.tip
        tips = np.array([tip for _, tip in self._way_in])
        return np.array([np.interp(state.depth, depths, along) for along in tips.T])

    def seed_positions(self, field: Field) -> Points:
        """Return where the seeds are in the world under a field, shape (nseeds, dim), m."""
        frame = self._track.instrument.axis.frame
        found = [seed.point + field.means(seed.weights)[0] @ frame for seed in self.seeds]
        return np.array(found).reshape(-1, len(frame))


# Time within a step at which the needle crosses the skin, in tissue that depends on time.
#
# The time is found by shorter steps from the same start. For uncut skin the sign of the tip force
# shows on which side of the skin the needle is; for cut skin, the distance of the tip from the
# entry point of a needle without force. A step that ends at the crossing has contact during all of
# its duration or not at all, so that friction and cutting do no work over a gap.


FINE = 1e-4
"""Part of a step to which the time of a crossing is found."""
SHORTEST = 1e-3
"""Part of a step that what is cut off, or left, of it lasts at least."""
BISECTIONS = 8
"""Of a step at whose end tissue that friction dragged along has sprung off the needle."""


def crossing_of_uncut_skin(progress: "Progress", tick: TimeStep) -> float:
    """Return when in a step the tip leaves or meets the uncut skin, as a share of the step.

    1: not before its end. A step of all its duration has begun, also afterwards.
    """
    weights, now = progress.tip_at_entry, progress.state

    def force(depth: float) -> float:
        contact = progress.contact
        return float(holding(contact, contact.trial(weights), depth)[0])

    if now.tip_phase is TipPhase.OUTSIDE:
        trial = progress.contact.trial(weights)
        first = -_outside(now) / float(trial.bare[0, 0])
    else:
        first = now.tip_force
    return _crossing(progress, tick, first, force)


def crossing_on_path(progress: "Progress", tick: TimeStep) -> float:
    """Return when in a step the tip leaves its path at the skin or enters it, as a share of it.

    1: not before its end. A step of all its duration has begun, also afterwards.
    """
    now, arc = progress.state, progress.arc

    def gap(depth: float) -> float:
        equations = progress.equations()
        return equations.solve(equations.at_arc(0.0), depth, 0.0, 0.0).axial_gap

    first = _outside(now) if now.tip_phase is TipPhase.OUTSIDE else -now.inserted_length
    share = _crossing(progress, tick, first, gap)
    if now.tip_phase is TipPhase.OUTSIDE or share >= 1.0:
        return share
    low, high = share, 1.0  # is it out there, or held on to by tissue that it drags along?
    for _ in range(BISECTIONS):
        depth = _begun(progress, tick, share)
        if trial_step(progress.equations(), now.tip_phase, arc, depth).phase is TipPhase.OUTSIDE:
            high = share
            if share == low:
                break
        else:
            low = share
        share = 0.5 * (low + high)
    _begun(progress, tick, 1.0)
    return high if high < 1.0 - SHORTEST else 1.0


def _outside(state: State) -> float:
    """Return how far outside the entry point a tip is that touches nothing, m."""
    return state.tip_displacement - state.depth


def _begun(progress: "Progress", tick: TimeStep, share: float) -> float:
    """Begin a step of a share of the tick's duration; return the depth at its end, m."""
    now = progress.state
    progress.begin(tick.duration if share == 1.0 else share * (tick.time - now.time))
    return now.depth + share * (tick.depth - now.depth)


def _crossing(
    progress: "Progress", tick: TimeStep, first: float, measure: Callable[[float], float]
) -> float:
    """Return the share of a step at which a measure of depth, in a step as long, changes sign."""

    def value(share: float) -> float:
        return first if share == 0.0 else measure(_begun(progress, tick, share))

    last = value(1.0)
    if first * last >= 0.0 or abs(first) <= FINE * abs(last):
        return 1.0
    share = root_between(value, 0.0, 1.0, FINE)
    _begun(progress, tick, 1.0)
    return 1.0 if share > 1.0 - SHORTEST else max(share, SHORTEST)
