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
"""Increment of depth in which a rupture begins, relative to the path spacing."""
GIVES = 1e-10
"""Energy that contact may add in a step, over the total absolute work; else the step is halved."""
HALVINGS = 10
"""Largest number of halvings of a step."""
REFUSED = 5e-10
"""Energy that contact may add in a step, over the total absolute work; else the motion ends."""


class TimeStepping:
    """A needle that follows a prescribed motion in time steps.

    Parameters
    ----------
    instrument : NeedleInterface
    tissue_response : TissueResponse
    model : TissueModel
    friction : SlipWeakeningFriction

    Attributes
    ----------
    outcome : Outcome
        Set when `iterate` is exhausted.
    ruptures : list of Rupture
    """

    def __init__(
        self,
        instrument: NeedleInterface,
        tissue_response: TissueResponse,
        model: TissueModel,
        friction: SlipWeakeningFriction,
    ) -> None:
        self.instrument, self.tissue_response, self.friction = instrument, tissue_response, friction
        self.ruptures: list[Rupture] = []
        self.outcome = Outcome(Status.STOPPED, "ended before the end of the motion")
        self._progress = Progress(instrument, tissue_response, model, friction)
        self._stick_resolution_checked = False
        self._reached: TimeStep | None = None

    @property
    def energy_balance(self) -> EnergyBalance:
        """Energies of all steps so far."""
        return self._progress.energy_balance

    @property
    def event_log(self) -> EventLog:
        """Events and seeds so far."""
        return self._progress.event_log

    @property
    def state(self) -> State:
        """The last accepted state."""
        return self._progress.state

    @property
    def segments(self) -> list[ContactSegment]:
        """Contact segments of the path cut so far."""
        return self._progress.segments

    @property
    def evaluations(self) -> int:
        """Number of contact problems that were solved."""
        return self._progress.evaluations

    def iterate(self, time_steps: Iterable[TimeStep]) -> Iterator[State]:
        """Yield the states one by one. The motion stops if no further state is requested."""
        try:
            yield self._progress.state
            for time_step in time_steps:
                if time_step is self._reached:
                    continue
                if time_step.time > self._progress.state.time or time_step.releases:
                    yield from self._take_time_step(time_step)
            sentence = f"the motion ended at {100.0 * self._progress.state.depth:.4g} cm"
            self.outcome = Outcome(Status.COMPLETED, sentence)
        except LeftTissueError as error:
            self.outcome = error.outcome
        except OutsideError:
            self.outcome = self._progress.left().outcome
        except SimulationError as error:
            sentence = f"after {100.0 * self._progress.state.depth:.4g} cm of depth: {error}"
            self.outcome = Outcome(Status.NOT_CONVERGED, sentence)

    def continue_from(
        self, path_following: PathFollowing, speed: float, spent: EnergyTerms
    ) -> None:
        """Continue an insertion after path following; see `Progress.continue_from`."""
        self._progress.continue_from(path_following, speed, spent)

    # one time step, and the events in it

    def _take_time_step(self, time_step: TimeStep, halvings: int = HALVINGS) -> Iterator[State]:
        now = self._progress.state
        if time_step.time > now.time or time_step.depth != now.depth:
            self._progress.begin(time_step.duration)
            if time_step.depth < now.depth and not self._stick_resolution_checked:
                check_stick_resolution(
                    self._progress.contact, self._progress.cut_path, self.friction
                )
                self._stick_resolution_checked = True
            start = (now.time, now.depth)
            while self._ends_before(time_step):
                now = self._progress.state
                if not self.tissue_response.rate_independent and now.time > start[0]:
                    time_step = time_step._replace(
                        duration=time_step.time - now.time
                    )  # the remaining part
                    start = (now.time, now.depth)
                    self._progress.begin(time_step.duration)
                yield from self._advance(time_step, start, halvings)
        elif time_step.releases:
            yield self._progress.release(time_step.releases)

    def _ends_before(self, time_step: TimeStep) -> bool:
        """Say whether the state is before the end of a time step; a path step may be beyond it."""
        now = self._progress.state
        if time_step.stage_end is not None and now.depth > time_step.depth:
            return now.time < time_step.time
        return now.time < time_step.time or now.depth != time_step.depth

    def _follow_path(self, time_step: TimeStep, start: tuple[float, float]) -> State | None:
        """Take a step of path following towards the end of the stage, or return None.

        Rate-independent tissue needs no time steps while the needle cuts and all segments slip.
        """
        end = time_step.stage_end or time_step
        trial = self._progress.path_step(end.depth)
        if trial is None:
            return None
        time = end.time if trial.depth == end.depth else time_step.time_at(trial.depth, start)
        found = self._progress.found(trial, time)
        if self._gains_energy(found, GIVES):
            return None
        if trial.depth == end.depth:
            self._reached = end
        return self._accept(found, end)

    def _advance(
        self, time_step: TimeStep, start: tuple[float, float], halvings: int
    ) -> Iterator[State]:
        """Advance to the end of a time step, or to the first event if the step can end there."""
        if not self.segments:
            yield from self._press_skin(time_step, start, halvings)
            return
        old, arc, rate_independent = (
            self._progress.state,
            self._progress.arc,
            self.tissue_response.rate_independent,
        )
        if rate_independent:
            state = self._follow_path(time_step, start)
            if state is not None:
                yield state
                return
        equations = self._progress.equations()
        new = trial_step(equations, old.tip_phase, arc, time_step.depth)
        room = np.inf
        if new.phase is TipPhase.CUTTING and new.solution is None:
            room = self._progress.room()
        if rate_independent:
            if new.phase is not old.tip_phase:
                new = first_event(equations, old, arc, new) or new
            new = limit_to_segment(equations, new, room)
        if new.phase is TipPhase.CUTTING and new.solution is None:
            yield from self._rupture(time_step, start)
        else:
            found = self._progress.found(new, time_step.time_at(new.depth, start))
            if self._crosses_skin(time_step, new.phase is TipPhase.OUTSIDE):
                share = crossing_on_path(self._progress, time_step)
                if share < 1.0:
                    yield self._accept(self._ended_at(share, time_step), time_step)
                    return
            yield from self._halve_until_energy_closes(found, time_step, halvings)

    def _accept(self, found: StepResult, time_step: TimeStep) -> State:
        """Accept the result of a step, and release the seeds at the end of the time step.

        Raises
        ------
        SimulationError
            Contact adds energy in the step.
        """
        self._refuse_energy_gain(found)
        state = self._progress.accept(found)
        if state.time >= time_step.time and state.depth == time_step.depth and time_step.releases:
            return self._progress.release(time_step.releases)
        return state

    def _halve_until_energy_closes(
        self, found: StepResult, time_step: TimeStep, halvings: int
    ) -> Iterator[State]:
        """Accept the result of a step, or repeat the step in halves if contact adds energy."""
        if self._gains_energy(found, GIVES) and halvings:
            yield from self._in_halves(time_step, halvings)
        else:
            yield self._accept(found, time_step)

    def _gains_energy(self, found: StepResult, most: float) -> bool:
        """Say whether contact adds more than a share of the total absolute work in a step."""
        return found.spent.smallest_dissipation < -most * (
            self.energy_balance.total_absolute_work + abs(found.spent.work)
        )

    def _refuse_energy_gain(self, found: StepResult) -> None:
        """Raise a `SimulationError` if contact adds energy in a step."""
        if self._gains_energy(found, REFUSED):
            depth, work = self._progress.state.depth, self.energy_balance.total_absolute_work
            share = -found.spent.smallest_dissipation / (work + abs(found.spent.work))
            raise SimulationError(
                f"beyond {depth:.4g} m contact would add energy, {share:.1e} of the work so far: "
                "the strain of the tissue at the needle exceeds the range of small strain; refine "
                "the mesh there, or take a stiffer tissue or a sharper needle"
            )

    def _crosses_skin(self, time_step: TimeStep, out: bool) -> bool:
        """Say whether a step has to end where the tip crosses the skin.

        In tissue with inertia a step does not end at the first contact: in its short remaining part
        the needle would accelerate the tissue to its own velocity with too large a force. It ends
        at the skin only if a retracted needle leaves the tissue.

        Parameters
        ----------
        time_step : TimeStep
        out : bool
            Whether the needle is outside at the end of the step.
        """
        now = self._progress.state
        if self.tissue_response.rate_independent or out is (now.tip_phase is TipPhase.OUTSIDE):
            return False
        return not self.tissue_response.has_inertia or (out and time_step.depth < now.depth)

    def _ended_at(self, share: float, time_step: TimeStep) -> StepResult:
        """Return the result of a step that ends at the skin without contact."""
        now = self._progress.state
        time = now.time + share * (time_step.time - now.time)
        depth = now.depth + share * (time_step.depth - now.depth)
        self._progress.begin(time - now.time)
        return self._progress.free(time, depth)

    def _in_halves(self, time_step: TimeStep, halvings: int) -> Iterator[State]:
        """Replace a time step by two of half its duration."""
        now, half = self._progress.state, 0.5 * time_step.duration
        middle = TimeStep(
            0.5 * (now.time + time_step.time), 0.5 * (now.depth + time_step.depth), half
        )
        for part in (middle, time_step._replace(duration=half)):
            yield from self._take_time_step(part, halvings - 1)

    def _rupture(self, time_step: TimeStep, start: tuple[float, float]) -> Iterator[State]:
        """Advance the tip at fixed depth until its force is the cutting force again."""
        progress, rate_independent, depth = (
            self._progress,
            self.tissue_response.rate_independent,
            time_step.depth,
        )
        first, cut_path = progress.count, progress.cut_path
        if rate_independent:
            depth = min(depth, progress.state.depth + NUDGE * self.instrument.spacing)
        time, before = time_step.time_at(depth, start), self.energy_balance.rupture
        while True:
            equations = progress.equations()
            high, low = segment_target(equations), None
            step = self._advanced(equations, high, depth)
            high = step.position.length
            while self.tissue_response.has_inertia and step.excess_cutting_force > 0.0:
                # one state only: its forces accelerate the tissue
                low, high = high, high + self.instrument.spacing
                step = advance_at_fixed_depth(equations, high, depth)
            if step.excess_cutting_force <= 0.0:
                break
            rupture = TipTrial(TipPhase.RUPTURE, cut_path.length, depth, step)
            advance = progress.found(rupture, time)
            self._refuse_energy_gain(advance)
            yield progress.accept(advance)
        arrest = find_arrest(equations, high, depth, low)
        tip_trial = TipTrial(
            TipPhase.CUTTING, cut_path.length, depth, arrest, segment_full=rate_independent
        )
        found = progress.found(tip_trial, time)
        state = self._accept(found, time_step)
        self.ruptures.append(Rupture(depth, first, progress.count))
        self.event_log.record("rupture", self.energy_balance.rupture - before, state)
        yield state

    def _advanced(self, equations: StepEquations, length: float, depth: float) -> StepSolution:
        """Advance the tip at fixed depth to a length, or less if the tip would leave the tissue."""
        grown = self._progress.cut_path.length - self._progress.cut_path.arcs[-1]
        for _ in range(HALVINGS):
            try:
                return advance_at_fixed_depth(equations, length, depth)
            except OutsideError:
                length = 0.5 * (grown + length)
        return advance_at_fixed_depth(equations, length, depth)

    def _press_skin(
        self, time_step: TimeStep, start: tuple[float, float], halvings: int
    ) -> Iterator[State]:
        """Load the uncut skin, and cut it when the tip force reaches the cutting force."""
        progress, rate_independent = self._progress, self.tissue_response.rate_independent
        weights = progress.tip_at_entry
        limit = self.instrument.cutting_force_at(weights)
        before = progress.state.depth if rate_independent else time_step.depth
        found = press_skin(progress.contact, weights, limit, (before, time_step.depth))
        time = time_step.time_at(found.depth, start)
        if self._crosses_skin(time_step, found.forces[0] <= 0.0):
            share = crossing_of_uncut_skin(progress, time_step)
            if share < 1.0:
                yield self._accept(self._ended_at(share, time_step), time_step)
                return
        if found.forces[0] <= 0.0:
            yield from self._halve_until_energy_closes(
                progress.free(time, found.depth), time_step, halvings
            )
            return
        trial, forces = found.trial, found.forces
        loaded = loading_state(progress.cut_path, trial, forces, time, found.depth)
        states = []
        if not found.punctured or rate_independent:
            states.append(self._accept(progress.pressing(loaded, trial, forces), time_step))
        if found.punctured:
            progress.puncture(trial, len(forces) - 1)
            at = progress.state if rate_independent else loaded
            self.event_log.record("puncture", sum(progress.spent), at)
        yield from states


def check_stick_resolution(
    contact: CondensedContact, cut_path: CutPath, friction: SlipWeakeningFriction
) -> None:
    """Raise a `SimulationError` if the forces on sticking segments are not determined."""
    count = len(contact.segments)
    if count:
        contact.set_active(count)
        lengths = np.diff(cut_path.arcs[:count])
        compliance = contact.sliding().compliance[1:, 1:]  # the entry point has no friction
        refuse_noise(compliance, friction.slack(lengths))
