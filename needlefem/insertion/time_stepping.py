"""Time stepping of a needle in any motion: insertion, dwell, retraction and repeated insertion.

After each step the tissue is in equilibrium with the needle at its prescribed position. If an event
occurs within a step (the tip begins to cut, loses or regains contact with the crack front), the
step ends there if the response of the tissue is independent of time; otherwise the event takes
place at the end of the step. In all tissue a step ends where the needle crosses the skin
(`events.py`). A step in which contact would add energy is halved; if halving does not help, the
motion ends.
"""

from collections.abc import Iterable, Iterator

import numpy as np

from needlefem.contact.condensed_contact import CondensedContact, ContactSegment
from needlefem.contact.friction import SlipWeakeningFriction, refuse_noise
from needlefem.errors import SimulationError
from needlefem.fem.interpolation import OutsideError
from needlefem.fem.tissue_model import TissueModel
from needlefem.insertion.cut_path import CutPath
from needlefem.insertion.energy_balance import EnergyBalance
from needlefem.insertion.events import EventLog, crossing_of_uncut_skin, crossing_on_path
from needlefem.insertion.motion_schedule import TimeStep
from needlefem.insertion.path_following import PathFollowing
from needlefem.insertion.progress import Progress, StepResult
from needlefem.insertion.result import EnergyTerms, LeftTissueError, Outcome, Rupture, Status
from needlefem.insertion.state import State, TipPhase, loading_state
from needlefem.insertion.step_equations import StepEquations, StepSolution
from needlefem.insertion.tip_advance import advance_at_fixed_depth, find_arrest, segment_target
from needlefem.insertion.tip_phase import (
    TipTrial,
    first_event,
    limit_to_segment,
    press_skin,
    trial_step,
)
from needlefem.insertion.tissue_response import TissueResponse
from needlefem.needle.needle_interface import NeedleInterface

NUDGE = 1e-5
"""Depth beyond that of a tip about to run ahead, relative to the spacing, at which it does."""
GIVES = 1e-10
"""Energy that contact may give in a step, of the turnover, before the step is halved."""
HALVINGS = 10
"""Of such a step, at most."""
REFUSED = 5e-10
"""Energy that contact may give in a step, of the turnover, before the motion ends there."""


class TimeStepping:
    """A needle moved by a schedule.

    Parameters
    ----------
    instrument : NeedleInterface
    medium : TissueResponse
        The tissue in time.
    model : TissueModel
    friction : SlipWeakeningFriction

    Attributes
    ----------
    outcome : Outcome
        Set when `iterate` is exhausted.
    snaps : list of Rupture
    """

    def __init__(
        self,
        instrument: NeedleInterface,
        medium: TissueResponse,
        model: TissueModel,
        friction: SlipWeakeningFriction,
    ) -> None:
        self.instrument, self.medium, self.friction = instrument, medium, friction
        self.snaps: list[Rupture] = []
        self.outcome = Outcome(Status.STOPPED, "ended before the motion did")
        self._progress = Progress(instrument, medium, model, friction)
        self._told_apart = False

    @property
    def energy_balance(self) -> EnergyBalance:
        """The energy ledger so far."""
        return self._progress.account

    @property
    def event_log(self) -> EventLog:
        """Events and seeds so far."""
        return self._progress.chronicle

    @property
    def pieces(self) -> list[ContactSegment]:
        """Pieces of the path cut so far."""
        return self._progress.pieces

    @property
    def evaluations(self) -> int:
        """Contact evaluations spent."""
        return self._progress.evaluations

    def iterate(self, ticks: Iterable[TimeStep]) -> Iterator[State]:
        """Yield the states one by one; stop early by not asking for more."""
        try:
            yield self._progress.state
            for tick in ticks:
                if tick.time > self._progress.state.time or tick.releases:
                    yield from self._take_time_step(tick)
            sentence = f"the motion ended at {100.0 * self._progress.state.depth:.4g} cm"
            self.outcome = Outcome(Status.COMPLETED, sentence)
        except LeftTissueError as error:
            self.outcome = error.outcome
        except OutsideError:
            self.outcome = self._progress.left().outcome
        except SimulationError as error:
            sentence = f"after {100.0 * self._progress.state.depth:.4g} cm of depth: {error}"
            self.outcome = Outcome(Status.NOT_CONVERGED, sentence)

    def take_over(self, march: PathFollowing, speed: float, spent: EnergyTerms) -> None:
        """Go on where a march ended; see `Progress.take_over`."""
        self._progress.take_over(march, speed, spent)

    # a step and what happens in it

    def _take_time_step(self, tick: TimeStep, halvings: int = HALVINGS) -> Iterator[State]:
        now = self._progress.state
        if tick.time > now.time or tick.depth != now.depth:
            self._progress.begin(tick.duration)
            if tick.depth < now.depth and not self._told_apart:
                check_stick_resolution(self._progress.contact, self._progress.track, self.friction)
                self._told_apart = True
            start = (now.time, now.depth)
            while (now := self._progress.state).time < tick.time or now.depth != tick.depth:
                if not self.medium.timeless and now.time > start[0]:
                    tick = tick._replace(duration=tick.time - now.time)  # what is left of it
                    start = (now.time, now.depth)
                    self._progress.begin(tick.duration)
                yield from self._advance(tick, start, halvings)
        elif tick.releases:
            yield self._progress.release(tick.releases)

    def _advance(
        self, tick: TimeStep, start: tuple[float, float], halvings: int
    ) -> Iterator[State]:
        """Go to the tick's depth, or to where something happens before, if time can be cut."""
        if not self.pieces:
            yield from self._press_skin(tick, start, halvings)
            return
        old, arc, timeless = self._progress.state, self._progress.arc, self.medium.timeless
        equations = self._progress.equations()
        new = trial_step(equations, old.tip_phase, arc, tick.depth)
        room = np.inf
        if new.phase is TipPhase.CUTTING and new.solution is None:
            room = self._progress.room()
        if timeless:
            if new.phase is not old.tip_phase:
                new = first_event(equations, old, arc, new) or new
            new = limit_to_segment(equations, new, room)
        if new.phase is TipPhase.CUTTING and new.solution is None:
            yield from self._rupture(tick, start)
        else:
            found = self._progress.found(new, tick.time_at(new.depth, start))
            if self._crosses_skin(tick, new.phase is TipPhase.OUTSIDE):
                share = crossing_on_path(self._progress, tick)
                if share < 1.0:
                    yield self._accept(self._ended_at(share, tick), tick)
                    return
            yield from self._halve_until_energy_closes(found, tick, halvings)

    def _accept(self, found: StepResult, tick: TimeStep) -> State:
        """Accept what was found, and release at the tick's end what is released there.

        Raises
        ------
        SimulationError
            Contact gives energy in the step.
        """
        self._refuse_energy_gain(found)
        state = self._progress.accept(found)
        if state.time >= tick.time and state.depth == tick.depth and tick.releases:
            return self._progress.release(tick.releases)
        return state

    def _halve_until_energy_closes(
        self, found: StepResult, tick: TimeStep, halvings: int
    ) -> Iterator[State]:
        """Accept what was found, or take the step in halves if contact gives too much in it."""
        if self._gains_energy(found, GIVES) and halvings:
            yield from self._in_halves(tick, halvings)
        else:
            yield self._accept(found, tick)

    def _gains_energy(self, found: StepResult, most: float) -> bool:
        """Say whether contact gives more than a part of the turnover in a step."""
        return found.spent.smallest_dissipation < -most * (
            self.energy_balance.total_absolute_work + abs(found.spent.work)
        )

    def _refuse_energy_gain(self, found: StepResult) -> None:
        """Raise a `SimulationError` if contact gives energy in a step."""
        if self._gains_energy(found, REFUSED):
            depth, work = self._progress.state.depth, self.energy_balance.total_absolute_work
            share = -found.spent.smallest_dissipation / (work + abs(found.spent.work))
            raise SimulationError(
                f"beyond {depth:.4g} m contact would give energy, {share:.1e} of the work so far: "
                "the tissue at the needle is strained beyond what small strain describes; refine "
                "the mesh there, or take a stiffer tissue or a sharper needle"
            )

    def _crosses_skin(self, tick: TimeStep, out: bool) -> bool:
        """Say whether a step, at whose end the needle is out or not, is cut at the skin.

        Tissue with inertia is met at the step's end: in the short rest of a step it would be
        brought to the needle's velocity by too large a force. The needle leaves it, where it is
        not the tissue that swings away, at that moment.
        """
        now = self._progress.state
        if self.medium.timeless or out is (now.tip_phase is TipPhase.OUTSIDE):
            return False
        return not self.medium.inertial or (out and tick.depth < now.depth)

    def _ended_at(self, share: float, tick: TimeStep) -> StepResult:
        """Return a step's end with the needle at the skin, touching nothing."""
        now = self._progress.state
        time = now.time + share * (tick.time - now.time)
        depth = now.depth + share * (tick.depth - now.depth)
        self._progress.begin(time - now.time)
        return self._progress.free(time, depth)

    def _in_halves(self, tick: TimeStep, halvings: int) -> Iterator[State]:
        """Take the step in two of half its duration."""
        now, half = self._progress.state, 0.5 * tick.duration
        middle = TimeStep(0.5 * (now.time + tick.time), 0.5 * (now.depth + tick.depth), half)
        for part in (middle, tick._replace(duration=half)):
            yield from self._take_time_step(part, halvings - 1)

    def _rupture(self, tick: TimeStep, start: tuple[float, float]) -> Iterator[State]:
        """Let the tip run on at fixed depth until its force is back at that of cutting."""
        progress, timeless, depth = self._progress, self.medium.timeless, tick.depth
        first, track = progress.count, progress.track
        if timeless:
            depth = min(depth, progress.state.depth + NUDGE * self.instrument.spacing)
        time, released = tick.time_at(depth, start), self.energy_balance.rupture
        while True:
            equations = progress.equations()
            high, low = segment_target(equations), None
            step = self._advanced(equations, high, depth)
            high = step.position.length
            while self.medium.inertial and step.excess_cutting_force > 0.0:
                low, high = high, high + self.instrument.spacing  # one step: it moves the tissue
                step = advance_at_fixed_depth(equations, high, depth)
            if step.excess_cutting_force <= 0.0:
                break
            jump = progress.found(TipTrial(TipPhase.RUPTURE, track.length, depth, step), time)
            self._refuse_energy_gain(jump)
            yield progress.accept(jump)
        landing = find_arrest(equations, high, depth, low)
        moment = TipTrial(TipPhase.CUTTING, track.length, depth, landing, segment_full=timeless)
        found = progress.found(moment, time)
        state = self._accept(found, tick)
        self.snaps.append(Rupture(depth, first, progress.count))
        self.event_log.record("rupture", self.energy_balance.rupture - released, state)
        yield state

    def _advanced(self, equations: StepEquations, length: float, depth: float) -> StepSolution:
        """Run ahead, as far as there is tissue around the tip."""
        grown = self._progress.track.length - self._progress.track.arcs[-1]
        for _ in range(HALVINGS):
            try:
                return advance_at_fixed_depth(equations, length, depth)
            except OutsideError:
                length = 0.5 * (grown + length)
        return advance_at_fixed_depth(equations, length, depth)

    def _press_skin(
        self, tick: TimeStep, start: tuple[float, float], halvings: int
    ) -> Iterator[State]:
        """Press on the skin, and cut it."""
        progress, timeless = self._progress, self.medium.timeless
        weights = progress.tip_at_entry
        limit = self.instrument.cutting_force_at(weights)
        before = progress.state.depth if timeless else tick.depth
        found = press_skin(progress.contact, weights, limit, (before, tick.depth))
        time = tick.time_at(found.depth, start)
        if self._crosses_skin(tick, found.forces[0] <= 0.0):
            share = crossing_of_uncut_skin(progress, tick)
            if share < 1.0:
                yield self._accept(self._ended_at(share, tick), tick)
                return
        if found.forces[0] <= 0.0:
            yield from self._halve_until_energy_closes(
                progress.free(time, found.depth), tick, halvings
            )
            return
        trial, forces = found.trial, found.forces
        held = loading_state(progress.track, trial, forces, time, found.depth)
        states = []
        if not found.punctured or timeless:
            states.append(self._accept(progress.pressing(held, trial, forces), tick))
        if found.punctured:
            progress.puncture(trial, len(forces) - 1)
            at = progress.state if timeless else held
            self.event_log.record("puncture", sum(progress.spent), at)
        yield from states


def check_stick_resolution(
    contact: CondensedContact, track: CutPath, friction: SlipWeakeningFriction
) -> None:
    """Raise a `SimulationError` if the forces on sticking segments are not determined."""
    count = len(contact.pieces)
    if count:
        contact.set_active(count)
        lengths = np.diff(track.arcs[:count])
        compliance = contact.sliding().compliance[1:, 1:]  # the entry point has no friction
        refuse_noise(compliance, friction.slack(lengths))
