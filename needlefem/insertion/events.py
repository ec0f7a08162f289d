"""Log of the events of a motion, and the time within a step at which the tip crosses the skin."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from needlefem._arrays import Points, Vector
from needlefem._root_finding import root_between
from needlefem.fem.interpolation import LinearFunctionals
from needlefem.insertion.cut_path import CutPath
from needlefem.insertion.motion_schedule import TimeStep
from needlefem.insertion.result import Event, Seed
from needlefem.insertion.state import State, TipPhase
from needlefem.insertion.step_equations import Field
from needlefem.insertion.tip_phase import fixed_point_forces, trial_step

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
"""Kind of the event for a change of the tip phase."""


class EventLog:
    """Events and seeds of one motion.

    Parameters
    ----------
    cut_path : CutPath
    rate_independent : bool
        Whether a step ends where an event occurs.

    Attributes
    ----------
    events : list of Event
        A reader may remove the events that it has read.
    seeds : list of Seed
    count : int
        Number of events that were recorded.
    """

    def __init__(self, cut_path: CutPath, *, rate_independent: bool) -> None:
        self.events: list[Event] = []
        self.seeds: list[Seed] = []
        self.count = 0
        self._cut_path, self._rate_independent = cut_path, rate_independent
        self._push = [(0.0, cut_path.instrument.axis.entry)]
        self._sticking = False

    def record(self, kind: str, energy: float, at: State, name: str = "") -> None:
        """Append an event."""
        self.events.append(Event(kind, at.time, at.depth, at.tip, energy, name))
        self.count += 1

    def record_deepest(self, state: State) -> None:
        """Store the material point at the tip if the depth is the largest so far."""
        if state.depth > self._push[-1][0] and state.tip_phase is not TipPhase.OUTSIDE:
            self._push.append((state.depth, state.tip))

    def record_transitions(self, old: State, new: State, dissipated: tuple[float, float]) -> None:
        """Append the events of a step from one state to the next.

        Parameters
        ----------
        old, new : State
        dissipated : (float, float)
            Energy dissipated in the step by friction, and at the tip, J (J/m in 2D).
        """
        friction, tip = dissipated
        if (old.tip_phase, new.tip_phase) in CHANGES and (
            len(old.friction_force) or len(new.friction_force)
        ):
            # a step ends before the tip leaves the crack front, and after it has reached it
            arrived = (
                new.tip_phase in (TipPhase.OUTSIDE, TipPhase.LOADING, TipPhase.CUTTING)
                or not self._rate_independent
            )
            energy = tip + (friction if new.tip_phase is TipPhase.OUTSIDE else 0.0)
            self.record(CHANGES[old.tip_phase, new.tip_phase], energy, new if arrived else old)
        if len(new.friction_force) < 2 or new.slipping is None:
            return
        slipping = np.count_nonzero(new.slipping[1:])
        if self._sticking and slipping == len(new.friction_force) - 1:
            self._sticking = False
            self.record("full_slip", friction, new)
        elif not self._sticking and slipping == 0:
            self._sticking = True
            self.record("full_stick", friction, new)

    def release(self, name: str, state: State, position: Vector) -> None:
        """Release a seed at the tip.

        Parameters
        ----------
        name : str
        state : State
        position : array, shape (dim,), m
            Position of the tip in space.
        """
        weights = LinearFunctionals(state.tip_nodes, state.tip_weights[None])
        self.seeds.append(
            Seed(
                name=name,
                time=state.time,
                released_at=position,
                point=state.tip,
                elastic_prediction=self._elastic_prediction(state),
                weights=weights,
                inside=len(state.friction_force) > 0,
            )
        )
        self.record("release", 0.0, state, name)

    def _elastic_prediction(self, state: State) -> Vector:
        """Return the material point that was at the tip at the same depth during the push."""
        depths = np.array([depth for depth, _ in self._push])
        if state.depth >= depths[-1]:
            return state.tip
        tips = np.array([tip for _, tip in self._push])
        return np.array([np.interp(state.depth, depths, component) for component in tips.T])

    def seed_positions(self, field: Field) -> Points:
        """Return the positions of the seeds in space under a displacement field, m.

        Shape (nseeds, dim).
        """
        frame = self._cut_path.instrument.axis.frame
        found = [seed.point + field.means(seed.weights)[0] @ frame for seed in self.seeds]
        return np.array(found).reshape(-1, len(frame))


# Time within a step at which the needle crosses the skin, in tissue that depends on time.
#
# The time is found by shorter steps from the same start. The needle is inside of uncut skin if the
# tip force is positive, and inside of cut skin if the tip is ahead of the entry point. A step that
# ends at the crossing has contact during all of its duration or not at all, so that friction and
# cutting do no work over a gap.


FINE = 1e-4
"""Tolerance of the time of a crossing, relative to the duration of the step."""
SHORTEST = 1e-3
"""Shortest part of a divided step, relative to its duration."""
BISECTIONS = 8
"""Bisections of a step that ends outside although the tip is inside at the entry point."""


def crossing_of_uncut_skin(progress: "Progress", time_step: TimeStep) -> float:
    """Return when the tip begins or loses contact with uncut skin, as a share of the step.

    1 if this does not happen within the step. Afterwards a step of the full duration has begun.
    """
    weights, now = progress.tip_at_entry, progress.state

    def force(depth: float) -> float:
        contact = progress.contact
        return float(fixed_point_forces(contact, contact.trial(weights), depth)[0])

    if now.tip_phase is TipPhase.OUTSIDE:
        trial = progress.contact.trial(weights)
        first = -_gap_to_skin(now) / float(trial.bare[0, 0])
    else:
        first = now.tip_force
    return _crossing(progress, time_step, first, force)


def crossing_on_path(progress: "Progress", time_step: TimeStep) -> float:
    """Return when the tip passes the skin on its cut path, as a share of the step.

    1 if this does not happen within the step. Afterwards a step of the full duration has begun.
    """
    now, arc = progress.state, progress.arc

    def gap(depth: float) -> float:
        equations = progress.equations()
        return equations.solve(equations.at_arc(0.0), depth, 0.0, 0.0).axial_gap

    first = _gap_to_skin(now) if now.tip_phase is TipPhase.OUTSIDE else -now.inserted_length
    share = _crossing(progress, time_step, first, gap)
    if now.tip_phase is TipPhase.OUTSIDE or share >= 1.0:
        return share
    low, high = share, 1.0  # friction may drag the tissue along with the needle beyond the skin
    for _ in range(BISECTIONS):
        depth = _begin_part(progress, time_step, share)
        if trial_step(progress.equations(), now.tip_phase, arc, depth).phase is TipPhase.OUTSIDE:
            high = share
            if share == low:
                break
        else:
            low = share
        share = 0.5 * (low + high)
    _begin_part(progress, time_step, 1.0)
    return high if high < 1.0 - SHORTEST else 1.0


def _gap_to_skin(state: State) -> float:
    """Return the distance of a tip outside of the tissue from the entry point, m."""
    return state.tip_displacement - state.depth


def _begin_part(progress: "Progress", time_step: TimeStep, share: float) -> float:
    """Begin a step of a share of the duration of the time step; return the depth at its end, m."""
    now = progress.state
    progress.begin(time_step.duration if share == 1.0 else share * (time_step.time - now.time))
    return now.depth + share * (time_step.depth - now.depth)


def _crossing(
    progress: "Progress", time_step: TimeStep, first: float, measure: Callable[[float], float]
) -> float:
    """Return the share of a time step at which a function of the depth changes its sign.

    Parameters
    ----------
    progress : Progress
    time_step : TimeStep
    first : float
        Value at the start of the step.
    measure : callable
        Function of the depth (m), evaluated with a step that ends at this depth.
    """

    def value(share: float) -> float:
        return first if share == 0.0 else measure(_begin_part(progress, time_step, share))

    last = value(1.0)
    if first * last >= 0.0 or abs(first) <= FINE * abs(last):
        return 1.0
    share = root_between(value, 0.0, 1.0, FINE)
    _begin_part(progress, time_step, 1.0)
    return 1.0 if share > 1.0 - SHORTEST else max(share, SHORTEST)
