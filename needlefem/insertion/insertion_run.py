"""One motion of a needle: path following as far as it is valid, then time stepping."""

import dataclasses
import itertools
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from needlefem.contact.condensed_contact import ContactSegment
from needlefem.fem.tissue_model import TissueModel
from needlefem.insertion.cut_path import CutPath
from needlefem.insertion.energy_balance import energy_terms, released
from needlefem.insertion.motion_schedule import motion_stages, time_steps
from needlefem.insertion.path_following import PathFollowing
from needlefem.insertion.result import Event, Insertion, Outcome, Status
from needlefem.insertion.state import ContactField, State
from needlefem.insertion.tip_solver import WarmStart
from needlefem.insertion.tissue_response import ElasticResponse, TissueResponse
from needlefem.needle.needle_interface import NeedleInterface
from needlefem.scene import Motion, Scene
from needlefem.scene.limits import check_steps

if TYPE_CHECKING:
    from needlefem.contact.friction import SlipWeakeningFriction
    from needlefem.insertion.time_stepping import TimeStepping


def hand_over(march: PathFollowing, track: CutPath, speed: float) -> tuple[State, ContactField]:
    """Return the last state of a march and its field; its path becomes the track's.

    Parameters
    ----------
    march : PathFollowing
        Has cut the skin.
    track : CutPath
        Empty.
    speed : float, m/s
        Of the needle on the march.
    """
    contact, state = march.contact, march.states[-1]
    limits = contact.friction_forces
    for number, later in enumerate(march.states[2:], 1):
        track.crack_front = later.tip
        track.extend(float(limits[number]))
    track.friction_force[: len(limits)] = limits
    here = track.instrument.tip(state.tip)
    trial = contact.trial(here)
    path = np.column_stack([state.friction_force, state.lateral_force]).ravel()
    field = ContactField(contact, path, trial, np.append(state.tip_force, state.tip_lateral))
    now = dataclasses.replace(
        state,
        time=state.depth / speed,
        inserted_length=track.length,
        slipping=np.ones(len(limits), dtype=int),
        tip_displacement=float(field.means(here)[0, 0]),
        tip_nodes=here.nodes,
        tip_weights=here.rows[0],
    )
    return now, field


# One run of a motion.
#
# A monotone insertion in elastic tissue needs no time steps. Where the assumptions of path
# following end (a segment stops slipping, the needle rests or turns back), time stepping continues
# on the same path.


STEPS_A_PIECE = 2.0
"""Steps in which the needle travels the length of a piece of its path, or that over which
friction weakens, at least."""
MOST_EVENTS = 1000
"""Of those that were written already, how many a result keeps."""


def longest_travel(scene: Scene) -> float:
    """Return the largest travel of the needle in a time step, m."""
    longest, needle = scene.discretization.path_spacing / STEPS_A_PIECE, scene.needle
    if needle.static_friction_ratio > 1.0 and needle.slip_weakening_distance > 0.0:
        longest = min(longest, needle.slip_weakening_distance / STEPS_A_PIECE)
    return longest


class InsertionRun:
    """A motion of the needle in one tissue.

    Parameters
    ----------
    scene : Scene
        Resolved.
    motion : Motion
        What the needle is told to do.
    instrument : NeedleInterface
    medium : TissueResponse
    model : TissueModel
    friction : callable
        Returns the friction law; asked for when there is something to step.
    guide : WarmStart, optional
        For a march, what is known from one nearby.

    Attributes
    ----------
    march : PathFollowing or None
        Set when the motion began with one.
    stepping : TimeStepping or None
        Set when there was something to step.
    """

    def __init__(
        self,
        scene: Scene,
        motion: Motion,
        instrument: NeedleInterface,
        medium: TissueResponse,
        model: TissueModel,
        *,
        friction: Callable[[], "SlipWeakeningFriction"],
        guide: WarmStart | None = None,
    ) -> None:
        self.scene, self.motion, self.instrument = scene, motion, instrument
        self._guide, self._friction = guide, friction
        self.medium, self.model = medium, model
        self.march: PathFollowing | None = None
        self.stepping: TimeStepping | None = None
        self._legs = motion_stages(motion)
        self._told = 0
        self._marched_events: list[Event] = []
        self._kept: deque[Event] = deque(maxlen=MOST_EVENTS)
        self.expected_steps = 0.0
        """Number of time steps, about; 0 for path following alone."""
        if not (self._marches and self._alone):
            self._check_steps()

    def iterate(self) -> Iterator[State]:
        """Yield the states one by one; stop early by not asking for more."""
        if self._marches:
            yield from self._marched()
            if self._alone and self.march is not None and self.march.outcome.status in FINAL:
                return
        yield from self._stepped()

    @property
    def outcome(self) -> Outcome:
        """How it ended."""
        run = self.march if self.stepping is None else self.stepping
        assert run is not None
        found = run.outcome
        if self.motion.stages or self.motion.times:
            return found
        largest = f"motion.max_depth, {100.0 * self.motion.max_depth:.4g} cm"
        if found.status is Status.NOT_PUNCTURED:
            return Outcome(found.status, f"{found.sentence}; raise motion.max_depth")
        if found.status is Status.COMPLETED and not self.pieces:
            return Outcome(Status.NOT_PUNCTURED, f"the skin is not cut at {largest}")
        if found.status is Status.COMPLETED:
            return Outcome(found.status, f"reached {largest}")
        return found

    @property
    def releases(self) -> tuple[str, ...]:
        """Names of what will be released, in their order."""
        return tuple(name for leg in self._legs for name in leg.releases)

    @property
    def pieces(self) -> Sequence[ContactSegment]:
        """Pieces of the path cut so far."""
        if self.stepping is not None:
            return self.stepping.pieces
        return self.march.contact.pieces if self.march is not None else ()

    def take_events(self) -> list[Event]:
        """Return what happened since this was asked for the last time."""
        found = self._events()[self._told :]
        self._told += len(found)
        if self.stepping is not None:
            found = (*found, *self.stepping.event_log.events)
            self._kept.extend(self.stepping.event_log.events)
            self.stepping.event_log.events.clear()
        return list(found)

    @property
    def _marches(self) -> bool:
        """Whether the motion begins with a march along the path."""
        return self.scene.discretization.integrator == "path_following" and self._legs[0].end > 0.0

    @property
    def _alone(self) -> bool:
        """Whether the motion is one push and no more."""
        return len(self._legs) == 1 and not self._legs[0].releases

    def _marched(self) -> Iterator[State]:
        first = self._legs[0]
        assert isinstance(self.medium, ElasticResponse)
        march = PathFollowing(
            self.instrument,
            self.medium.responses,
            first.end,
            within=not self._alone,
            speed=first.end / first.duration,
            guide=self._guide,
        )
        states = march.iterate()
        head = [] if self._alone else list(itertools.islice(states, 3))
        if not self._alone and march.outcome.status is Status.NOT_PUNCTURED:
            return  # what only presses is stepped from the start
        self.march = march
        yield from itertools.chain(head, states)

    def _stepped(self) -> Iterator[State]:
        from needlefem.insertion.time_stepping import TimeStepping  # noqa: PLC0415

        friction = self._friction()
        stepping = TimeStepping(self.instrument, self.medium, self.model, friction)
        self.stepping = stepping
        wanted, longest = self._longest_steps()
        found = time_steps(self.motion, wanted, longest, timeless=self.medium.timeless)
        states = stepping.iterate(found)
        if self.march is not None:
            speed = self._legs[0].end / self._legs[0].duration
            stepping.take_over(self.march, speed, energy_terms(self._marched_result()))
            next(states)
        yield from states

    def _longest_steps(self) -> tuple[float, float]:
        """Return the longest time of a step, s, and the longest travel of the needle, m."""
        spacing = self.instrument.spacing
        wanted = self.scene.discretization.time_step or np.inf
        if not self.medium.timeless and not np.isfinite(wanted):
            wanted = spacing / (STEPS_A_PIECE * self.motion.speed)
        return wanted, longest_travel(self.scene)

    def _check_steps(self) -> None:
        """Refuse a motion of more steps than the scene's limits allow, before it begins."""
        wanted, longest = self._longest_steps()
        travel = sum(abs(leg.end - leg.start) for leg in self._legs)
        still = self.medium.timeless  # while the needle rests nothing happens then
        time = sum(leg.duration for leg in self._legs if not still or leg.start != leg.end)
        if time / wanted > travel / longest:
            key, remedy = "discretization.time_step", "a longer step or a shorter motion"
        else:
            key, remedy = "discretization.path_spacing", "a longer spacing"
        self.expected_steps = max(time / wanted, travel / longest)
        check_steps(self.expected_steps, key, remedy, self.scene.limits)

    def _marched_result(self) -> Insertion:
        assert self.march is not None
        return self.march.result(self.scene, self.model)

    def result(self, states: tuple[State, ...]) -> Insertion:
        """Return the insertion with the states that were kept."""
        outcome = self.outcome
        if outcome.status is Status.STOPPED and states:
            depth = f"a depth of {100.0 * states[-1].depth:.4g} cm"
            outcome = Outcome(Status.STOPPED, f"ended at {depth}, for no more was asked for")
        if self.stepping is None:
            found = self._marched_result()
            events = self._events()
            return dataclasses.replace(found, outcome=outcome, states=states, events=events)
        stepping, march = self.stepping, self.march
        snaps = march.snaps if march else []
        return Insertion(
            scene=self.scene,
            model=self.model,
            instrument=self.instrument,
            outcome=outcome,
            states=states,
            pieces=tuple(stepping.pieces),
            ruptures=(*snaps, *stepping.snaps),
            contact_solves=stepping.evaluations,
            events=(*self._events(), *self._kept, *stepping.event_log.events),
            seeds=tuple(stepping.event_log.seeds),
            energies=stepping.energy_balance.energy_terms(),
        )

    def _events(self) -> tuple[Event, ...]:
        """Return what happened on the march."""
        if self.march is None:
            return ()
        states, found = self.march.states, self._marched_events
        if not found and len(states) > 1 and states[1].tip_force >= states[1].cutting_force:
            found.append(self._event("puncture", states[1], 0.0))
        for snap in self.march.snaps[max(len(found) - 1, 0) :]:
            energy = released(self._marched_result(), snap)
            found.append(self._event("rupture", states[snap.last], energy))
        return tuple(found)

    def _event(self, kind: str, state: State, energy: float) -> Event:
        speed = self._legs[0].end / self._legs[0].duration
        return Event(kind, state.depth / speed, state.depth, state.tip, energy)


FINAL = (
    Status.COMPLETED,
    Status.NOT_PUNCTURED,
    Status.NOT_CONVERGED,
    Status.LEFT_TISSUE,
)
"""What a push can end with that stepping would not go on from."""
