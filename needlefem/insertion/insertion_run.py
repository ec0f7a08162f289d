"""One motion of a needle: path following as far as it is valid, then time stepping."""

import dataclasses
import itertools
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from needlefem._arrays import Floats
from needlefem.contact.condensed_contact import ContactSegment
from needlefem.errors import CaseError
from needlefem.fem.tissue_model import TissueModel
from needlefem.insertion.cut_path import CutPath
from needlefem.insertion.energy_balance import energy_terms, released
from needlefem.insertion.motion_schedule import motion_stages, time_steps
from needlefem.insertion.path_following import PathFollowing
from needlefem.insertion.result import Event, Insertion, Outcome, Status
from needlefem.insertion.state import ContactField, State, load
from needlefem.insertion.tip_solver import WarmStart
from needlefem.insertion.tissue_response import ElasticResponse, TissueResponse
from needlefem.needle.needle_interface import NeedleInterface
from needlefem.scene import Motion, Scene
from needlefem.scene.limits import check_steps

if TYPE_CHECKING:
    from needlefem.contact.friction import SlipWeakeningFriction
    from needlefem.insertion.time_stepping import TimeStepping


def state_after_path_following(
    path_following: PathFollowing, cut_path: CutPath, speed: float
) -> tuple[State, ContactField]:
    """Return the last state of path following and its field, from which time stepping continues.

    Parameters
    ----------
    path_following : PathFollowing
        Has cut the skin.
    cut_path : CutPath
        Empty; it receives the path that was cut.
    speed : float, m/s
        Speed of the needle during path following.
    """
    contact, state = path_following.contact, path_following.states[-1]
    limits = contact.friction_forces
    for number, later in enumerate(path_following.states[2:], 1):
        cut_path.crack_front = later.tip
        cut_path.extend(float(limits[number]))
    cut_path.friction_force[: len(limits)] = limits
    tip = cut_path.instrument.tip(state.tip)
    trial = contact.trial(tip)
    path = np.column_stack([state.friction_force, state.lateral_force]).ravel()
    field = ContactField(contact, path, trial, np.append(state.tip_force, state.tip_lateral))
    now = dataclasses.replace(
        state,
        time=state.depth / speed,
        inserted_length=cut_path.length,
        slipping=np.ones(len(limits), dtype=int),
        tip_displacement=float(field.means(tip)[0, 0]),
        tip_nodes=tip.nodes,
        tip_weights=tip.rows[0],
    )
    return now, field


# One run of a motion.
#
# A monotone insertion in elastic tissue needs no time steps. Where the assumptions of path
# following end (a segment stops slipping, the needle rests or turns back), time stepping continues
# on the same path.


STEPS_PER_SEGMENT = 2.0
"""Smallest number of time steps in which the needle travels the length of a contact segment, or the
slip distance over which friction weakens."""
MOST_EVENTS = 1000
"""Largest number of events kept in a result, of those that were written to a file before."""


def longest_travel(scene: Scene) -> float:
    """Return the longest travel of the needle in a time step, m."""
    longest, needle = scene.discretization.path_spacing / STEPS_PER_SEGMENT, scene.needle
    if needle.static_friction_ratio > 1.0 and needle.slip_weakening_distance > 0.0:
        longest = min(longest, needle.slip_weakening_distance / STEPS_PER_SEGMENT)
    return longest


MEMORY = 2e8
"""Memory up to which displacements are kept where `SaveAt` leaves it open, bytes."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class SaveAt:
    """Which states of a motion are kept, and whether they hold the displacement of the tissue.

    The first and the last state are always kept, all states of path following, the states in which
    the phase of the tip changes, and those around ruptures and events.

    Parameters
    ----------
    every : int
        One of so many states of time stepping is kept.
    times : sequence of float, s
        The states before and after each of these times are kept as well.
    fields : bool, optional
        Whether the kept states hold the displacement. By default they do in tissue that depends on
        time, as long as `MEMORY` suffices: there it can't be computed from the forces of a state.
    """

    every: int = 1
    times: Sequence[float] = ()
    fields: bool | None = None

    def __post_init__(self) -> None:
        """Raise a `CaseError` for a number of states below one, or times that are no numbers."""
        if self.every < 1:
            raise CaseError("SaveAt.every", f"{self.every} is below 1", "give 1, 2, ...")
        if not np.all(np.isfinite(np.asarray(self.times, dtype=float))):
            raise CaseError("SaveAt.times", "a time is not a finite number", "give times in s")


class KeptStates:
    """The states of a motion that `SaveAt` selects, while the motion runs.

    Parameters
    ----------
    save : SaveAt
    run : InsertionRun
    """

    def __init__(self, save: SaveAt, run: "InsertionRun") -> None:
        self._save, self._run = save, run
        self._fields = save.fields
        if self._fields is None:
            size = 8.0 * run.model.ndofs * max(run.expected_steps / save.every, 1.0)
            self._fields = run.depends_on_time and size <= MEMORY
        self.states: list[State] = []
        self.numbers: list[int] = []
        """Number of each kept state among all states of the motion."""
        self._count = 0
        self._last: State | None = None
        self._occurrences = (0, 0)

    def add(self, state: State) -> None:
        """Take the next state of the motion."""
        last, occurrences = self._last, self._run.occurrences
        around = last is not None and (
            occurrences != self._occurrences
            or state.tip_phase is not last.tip_phase
            or any(last.time <= time <= state.time for time in self._save.times)
        )
        if last is not None and around and self.numbers[-1] != self._count - 1:
            self._keep(last, self._count - 1)
        if self._fields:
            state = dataclasses.replace(state, displacement=self._run.displacement(state))
        if around or self._run.stepping is None or self._count % self._save.every == 0:
            self._keep(state, self._count)
        self._last, self._occurrences = state, occurrences
        self._count += 1

    def _keep(self, state: State, number: int) -> None:
        self.states.append(state)
        self.numbers.append(number)

    def insertion(self) -> Insertion:
        """Return the insertion with the states that were kept."""
        if self._last is not None and self.numbers[-1] != self._count - 1:
            self._keep(self._last, self._count - 1)
        if self.states and self._run.depends_on_time and self.states[-1].displacement is None:
            field = self._run.displacement(self.states[-1])
            self.states[-1] = dataclasses.replace(self.states[-1], displacement=field)
        return self._run.result(tuple(self.states), self.numbers)


class InsertionRun:
    """A motion of the needle in one tissue.

    Parameters
    ----------
    scene : Scene
        Resolved scene.
    motion : Motion
        Prescribed motion of the needle.
    instrument : NeedleInterface
    tissue_response : TissueResponse
    model : TissueModel
    friction : callable
        Returns the friction law. It is called when time stepping begins.
    warm_start : WarmStart, optional
        Initial values for path following, from an insertion with a nearby entry.

    Attributes
    ----------
    path_following : PathFollowing or None
        None unless the motion begins with path following.
    stepping : TimeStepping or None
        None until time stepping begins.
    """

    def __init__(
        self,
        scene: Scene,
        motion: Motion,
        instrument: NeedleInterface,
        tissue_response: TissueResponse,
        model: TissueModel,
        *,
        friction: Callable[[], "SlipWeakeningFriction"],
        warm_start: WarmStart | None = None,
    ) -> None:
        self.scene, self.motion, self.instrument = scene, motion, instrument
        self._warm_start, self._friction = warm_start, friction
        self.tissue_response, self.model = tissue_response, model
        self.path_following: PathFollowing | None = None
        self.stepping: TimeStepping | None = None
        self._stages = motion_stages(motion)
        self._events_returned = 0
        self._path_events: list[Event] = []
        self._taken_events: deque[Event] = deque(maxlen=MOST_EVENTS)
        self.expected_steps = 0.0
        """Approximate number of time steps; 0 for path following alone."""
        if not (self._follows_path and self._single_push):
            self._check_steps()

    def iterate(self) -> Iterator[State]:
        """Yield the states one by one. The motion stops if no further state is requested."""
        if self._follows_path:
            yield from self._path_states()
            if (
                self._single_push
                and self.path_following is not None
                and self.path_following.outcome.status in FINAL
            ):
                return
        yield from self._time_step_states()

    @property
    def depends_on_time(self) -> bool:
        """Whether the displacement depends on more than the forces of the same state."""
        return not self.tissue_response.rate_independent

    @property
    def occurrences(self) -> tuple[int, int]:
        """Numbers of events and ruptures of time stepping so far."""
        if self.stepping is None:
            return 0, 0
        return self.stepping.event_log.count, len(self.stepping.ruptures)

    def displacement(self, state: State) -> Floats:
        """Return the displacement of all dofs in the last state, shape (ndofs,), m."""
        field = self.tissue_response.displacement()
        if field is not None:
            return field
        frame = self.instrument.axis.frame
        return self.model.solve(load(self.model, frame, state, self.segments))

    @property
    def outcome(self) -> Outcome:
        """How the motion ended."""
        run = self.path_following if self.stepping is None else self.stepping
        assert run is not None
        found = run.outcome
        if self.motion.stages or self.motion.times:
            return found
        largest = f"motion.max_depth, {100.0 * self.motion.max_depth:.4g} cm"
        if found.status is Status.NOT_PUNCTURED:
            return Outcome(found.status, f"{found.sentence}; raise motion.max_depth")
        if found.status is Status.COMPLETED and not self.segments:
            return Outcome(Status.NOT_PUNCTURED, f"the skin is not cut at {largest}")
        if found.status is Status.COMPLETED:
            return Outcome(found.status, f"reached {largest}")
        return found

    @property
    def releases(self) -> tuple[str, ...]:
        """Names of all seeds of the motion, in the order of their release."""
        return tuple(name for stage in self._stages for name in stage.releases)

    @property
    def segments(self) -> Sequence[ContactSegment]:
        """Contact segments of the path cut so far."""
        if self.stepping is not None:
            return self.stepping.segments
        return self.path_following.contact.segments if self.path_following is not None else ()

    def take_events(self) -> list[Event]:
        """Return the events that occurred since the last call."""
        found = self._events()[self._events_returned :]
        self._events_returned += len(found)
        if self.stepping is not None:
            found = (*found, *self.stepping.event_log.events)
            self._taken_events.extend(self.stepping.event_log.events)
            self.stepping.event_log.events.clear()
        return list(found)

    @property
    def _follows_path(self) -> bool:
        """Whether the motion begins with path following."""
        return (
            self.scene.discretization.integrator == "path_following" and self._stages[0].end > 0.0
        )

    @property
    def _single_push(self) -> bool:
        """Whether the motion is one insertion without a release."""
        return len(self._stages) == 1 and not self._stages[0].releases

    def _path_states(self) -> Iterator[State]:
        first = self._stages[0]
        assert isinstance(self.tissue_response, ElasticResponse)
        path_following = PathFollowing(
            self.instrument,
            self.tissue_response.responses,
            first.end,
            within=not self._single_push,
            speed=first.end / first.duration,
            warm_start=self._warm_start,
        )
        states = path_following.iterate()
        head = [] if self._single_push else list(itertools.islice(states, 3))
        if not self._single_push and path_following.outcome.status is Status.NOT_PUNCTURED:
            return  # without a puncture, time stepping computes the motion from its start
        self.path_following = path_following
        yield from itertools.chain(head, states)

    def _time_step_states(self) -> Iterator[State]:
        from needlefem.insertion.time_stepping import TimeStepping  # noqa: PLC0415

        friction = self._friction()
        stepping = TimeStepping(self.instrument, self.tissue_response, self.model, friction)
        self.stepping = stepping
        duration, travel = self._longest_steps()
        steps = time_steps(
            self.motion, duration, travel, rate_independent=self.tissue_response.rate_independent
        )
        states = stepping.iterate(steps)
        if self.path_following is not None:
            speed = self._stages[0].end / self._stages[0].duration
            stepping.continue_from(self.path_following, speed, energy_terms(self._path_result()))
            next(states)
        yield from states

    def _longest_steps(self) -> tuple[float, float]:
        """Return the longest duration of a step, s, and the longest travel of the needle, m."""
        spacing = self.instrument.spacing
        duration = self.scene.discretization.time_step or np.inf
        if not self.tissue_response.rate_independent and not np.isfinite(duration):
            duration = spacing / (STEPS_PER_SEGMENT * self.motion.speed)
        return duration, longest_travel(self.scene)

    def _check_steps(self) -> None:
        """Raise a `CaseError` if the motion needs more steps than the limits of the scene allow."""
        duration, longest = self._longest_steps()
        travel = sum(abs(stage.end - stage.start) for stage in self._stages)
        time = sum(
            stage.duration
            for stage in self._stages
            if stage.start != stage.end or not self.tissue_response.rate_independent
        )
        if time / duration > travel / longest:
            key, remedy = "discretization.time_step", "a longer step or a shorter motion"
        else:
            key, remedy = "discretization.path_spacing", "a longer spacing"
        self.expected_steps = max(time / duration, travel / longest)
        check_steps(self.expected_steps, key, remedy, self.scene.limits)

    def _path_result(self) -> Insertion:
        assert self.path_following is not None
        return self.path_following.result(self.scene, self.model)

    def result(self, states: tuple[State, ...], numbers: Sequence[int] | None = None) -> Insertion:
        """Return the insertion with the states that were kept by the caller.

        Parameters
        ----------
        states : tuple of State
        numbers : sequence of int, optional
            Number of each of them among all states; by default all states were kept.
        """
        outcome = self.outcome
        if outcome.status is Status.STOPPED and states:
            depth = f"a depth of {100.0 * states[-1].depth:.4g} cm"
            outcome = Outcome(Status.STOPPED, f"stopped at {depth}, as requested by the caller")
        if self.stepping is None:
            found = self._path_result()
            events = self._events()
            return dataclasses.replace(found, outcome=outcome, states=states, events=events)
        stepping, path_following = self.stepping, self.path_following
        ruptures = [*(path_following.ruptures if path_following else ()), *stepping.ruptures]
        if numbers is not None:
            places = [np.searchsorted(numbers, [r.first, r.last]).tolist() for r in ruptures]
            ruptures = [
                dataclasses.replace(rupture, first=first, last=last)
                for rupture, (first, last) in zip(ruptures, places, strict=True)
            ]
        return Insertion(
            scene=self.scene,
            model=self.model,
            instrument=self.instrument,
            outcome=outcome,
            states=states,
            segments=tuple(stepping.segments),
            ruptures=tuple(ruptures),
            contact_solves=stepping.evaluations,
            events=(*self._events(), *self._taken_events, *stepping.event_log.events),
            seeds=tuple(stepping.event_log.seeds),
            energies=stepping.energy_balance.energy_terms(),
        )

    def _events(self) -> tuple[Event, ...]:
        """Return the events of path following."""
        if self.path_following is None:
            return ()
        states, found = self.path_following.states, self._path_events
        if not found and len(states) > 1 and states[1].tip_force >= states[1].cutting_force:
            found.append(self._event("puncture", states[1], 0.0))
        for rupture in self.path_following.ruptures[max(len(found) - 1, 0) :]:
            energy = released(self._path_result(), rupture)
            found.append(self._event("rupture", states[rupture.last], energy))
        return tuple(found)

    def _event(self, kind: str, state: State, energy: float) -> Event:
        speed = self._stages[0].end / self._stages[0].duration
        return Event(kind, state.depth / speed, state.depth, state.tip, energy)


FINAL = (
    Status.COMPLETED,
    Status.NOT_PUNCTURED,
    Status.NOT_CONVERGED,
    Status.LEFT_TISSUE,
)
"""Status of path following after which time stepping does not continue."""
