"""A needle in any motion, stepped in time: insert, hold, retract, and in again.

After every step the tissue is in equilibrium with the needle where it is told to be. Where
something happens within a step (the tip starts to cut, leaves the crack front or comes back to
it, leaves the skin), the step is cut there if the tissue has no memory of time; otherwise it
happens at the step's end.
"""

import dataclasses
from collections.abc import Iterable, Iterator

import numpy as np

from needlefem.errors import SimulationError
from needlefem.fem.interpolation import OutsideError, Weights
from needlefem.fem.model import Model
from needlefem.insertion.account import Account
from needlefem.insertion.chronicle import Chronicle
from needlefem.insertion.equations import Field, StepEquations
from needlefem.insertion.fields import load
from needlefem.insertion.growth import goal, land, run_ahead
from needlefem.insertion.handover import hand_over
from needlefem.insertion.march import March
from needlefem.insertion.media import Medium
from needlefem.insertion.moments import free_state, pressing_state, rebuilt, settled, tell_apart
from needlefem.insertion.result import Ledger, Outcome, Snap, Status
from needlefem.insertion.schedule import Tick
from needlefem.insertion.skin import touch
from needlefem.insertion.state import State, Way
from needlefem.insertion.stepfield import Rest, StepField
from needlefem.insertion.track import Track
from needlefem.insertion.ways import Moment, attempt, first_change, within_piece
from needlefem.needle.contact import Contact
from needlefem.needle.friction import Friction
from needlefem.needle.functionals import Piece
from needlefem.needle.instrument import Instrument

NUDGE = 1e-5
"""Depth beyond that of a tip about to run ahead, relative to the spacing, at which it does."""


class Stepping:
    """A needle moved by a schedule.

    Parameters
    ----------
    instrument : Instrument
    medium : Medium
        The tissue in time.
    model : Model
    friction : Friction

    Attributes
    ----------
    account : Account
        The energy ledger so far.
    chronicle : Chronicle
        Events and seeds so far.
    outcome : Outcome
        Set when `iterate` is exhausted.
    state : State
        The newest.
    evaluations : int
        Contact evaluations spent.
    """

    def __init__(
        self, instrument: Instrument, medium: Medium, model: Model, friction: Friction
    ) -> None:
        self.instrument, self.medium, self.model = instrument, medium, model
        self.friction = friction
        self.track = Track(instrument)
        self.pieces: list[Piece] = []
        stiffness = friction.stiffness
        give = instrument.lateral_stiffness / stiffness if stiffness > 0.0 else 0.0
        self.account = Account(self.pieces, give, inertial=medium.inertial)
        self.snaps: list[Snap] = []
        self.outcome = Outcome(Status.STOPPED, "stopped by the caller")
        self.evaluations = 0
        self._contact: Contact  # met with the first step's operator
        self._tip_at_entry = instrument.tip(instrument.axis.entry)
        self.state = free_state(self.track, self._tip_at_entry, 0.0, 0.0)
        self._field: Field = Rest(model.dim)
        self.chronicle = Chronicle(self.track, timeless=medium.timeless)
        self._solved: list[StepEquations] = []
        self._spent = (0.0, 0.0)
        self._arc = 0.0
        self._count = 0
        self._told_apart = False

    def iterate(self, ticks: Iterable[Tick]) -> Iterator[State]:
        """Yield the states one by one; stop early by not asking for more."""
        try:
            yield self.state
            for tick in ticks:
                if tick.time > self.state.time or tick.release:
                    yield from self._tick(tick)
            sentence = f"the motion ended at {self.state.depth:.4g} m"
            self.outcome = Outcome(Status.COMPLETED, sentence)
        except SimulationError as error:
            self.outcome = Outcome(Status.NOT_CONVERGED, str(error))
        except OutsideError:
            self.outcome = Outcome(Status.LEFT_TISSUE, "the tip left the tissue")

    def take_over(self, march: March, speed: float, spent: Ledger) -> None:
        """Go on where a march ended, with all that it has cut.

        Parameters
        ----------
        march : March
        speed : float, m/s
            Of the needle on it.
        spent : Ledger
            Its energies.
        """
        if not march.contact.pieces:
            return
        self._contact = march.contact
        self.pieces.extend(march.contact.pieces)
        self.state, self._field = hand_over(march, self.track, speed)
        self._arc, self._count = self.track.length, len(march.states) - 1
        for state in march.states:
            self.chronicle.deepen(state)
        self.account.begin(spent)

    # a step and what happens in it

    def _tick(self, tick: Tick) -> Iterator[State]:
        if tick.time > self.state.time or tick.depth != self.state.depth:
            self.medium.begin(tick.duration)
            self._meet()
            if tick.depth < self.state.depth and not self._told_apart:
                tell_apart(self._contact, self.track, self.friction)
                self._told_apart = True
            start = (self.state.time, self.state.depth)
            while self.state.time < tick.time or self.state.depth != tick.depth:
                yield from self._advance(tick, start)
        if tick.release:
            world = self.instrument.axis.tip(self.state.depth)
            self.chronicle.release(tick.release, self.state, world)

    def _meet(self) -> None:
        """Let the contact follow the tissue's operator and its motion without the needle."""
        medium = self.medium
        if not hasattr(self, "_contact") or self._contact.responses is not medium.responses:
            fresh = Contact(medium.responses, self.instrument.axis.frame)
            self._contact = rebuilt(fresh, self.pieces)
        self._contact.background = medium.background
        self._contact.swing = medium.swing(self.pieces, self.instrument.axis.direction)
        self._contact.balance()

    def _advance(self, tick: Tick, start: tuple[float, float]) -> Iterator[State]:
        """Go to the tick's depth, or to where something happens before, if time can be cut."""
        if not self.pieces:
            yield from self._touch(tick, start)
            return
        old = self.state
        equations = self._equations()
        new = attempt(equations, old.way, self._arc, tick.depth)
        if self.medium.timeless:
            if new.way is not old.way:
                new = first_change(equations, old, self._arc, new) or new
            new = within_piece(equations, new)
        if new.way is Way.CUTTING and new.solution is None:
            yield from self._run_ahead(tick, start)
        else:
            yield self._accept(new, tick.time_at(new.depth, start))

    def _run_ahead(self, tick: Tick, start: tuple[float, float]) -> Iterator[State]:
        """Let the tip run on at fixed depth until its force is back at that of cutting."""
        timeless, first = self.medium.timeless, self._count
        depth = tick.depth
        if timeless:
            depth = min(depth, self.state.depth + NUDGE * self.instrument.spacing)
        time, released = tick.time_at(depth, start), self.account.snap
        while True:
            equations, track = self._equations(), self.track
            high, low = goal(equations), None
            step = run_ahead(equations, high, depth)
            while self.medium.inertial and step.excess > 0.0:
                low, high = high, high + self.instrument.spacing  # one step: it moves the tissue
                step = run_ahead(equations, high, depth)
            if step.excess <= 0.0:
                break
            yield self._accept(
                Moment(Way.JUMPING, track.length, depth, step), time, finish=timeless
            )
        landing = land(equations, high, depth, low)
        yield self._accept(Moment(Way.CUTTING, track.length, depth, landing), time)
        self.snaps.append(Snap(depth, first, self._count))
        self.chronicle.happens("snap", self.account.snap - released, self.state)

    def _touch(self, tick: Tick, start: tuple[float, float]) -> Iterator[State]:
        """Press on the skin, and cut it."""
        weights, timeless = self._tip_at_entry, self.medium.timeless
        limit = self.instrument.cutting_force_at(weights)
        before = self.state.depth if timeless else tick.depth
        found = touch(self._contact, weights, limit, (before, tick.depth))
        time = tick.time_at(found.depth, start)
        if found.forces[0] <= 0.0:
            state = free_state(self.track, weights, time, found.depth)
            yield self._keep(state, StepField(self._contact, np.zeros(0), None, np.zeros(0)))
            return
        trial, forces = found.trial, found.forces
        if not found.punctured or timeless:
            state = pressing_state(self.track, trial, forces, time, found.depth)
            yield self._keep(state, StepField(self._contact, np.zeros(0), trial, forces))
        if found.punctured:
            self._contact.adopt(trial, 0, 0.0, np.zeros(len(forces) - 1), 0.0)
            self.pieces.append(self._contact.pieces[-1])
            self.chronicle.happens("puncture", sum(self._spent), self.state)

    # what was found becomes the state

    def _equations(self) -> StepEquations:
        found = StepEquations(self._contact, self.track, self.friction, self.state, self._field)
        self._solved.append(found)
        return found

    def _accept(self, moment: Moment, time: float, *, finish: bool = True) -> State:
        """Make a moment the state."""
        solution, contact, track = moment.solution, self._contact, self.track
        if solution is None:
            contact.cover(0)
            track.remember(np.zeros(0), np.zeros(0))
            self._arc = 0.0
            state = free_state(track, self._tip_at_entry, time, moment.depth)
            field = StepField(contact, np.zeros(0), None, np.zeros(0))
            return self._keep(state, field, finish=finish)
        ahead = moment.way in (Way.CUTTING, Way.JUMPING)
        if ahead:
            track.front = solution.position.tip
            moment = dataclasses.replace(moment, arc=track.length)
        state, field = settled(contact, track, moment, time)
        track.remember(state.axial, solution.slipped)
        self._keep(state, field, finish=finish)
        self._arc = moment.arc
        assert state.end is not None
        if ahead and solution.position.length >= (1.0 - 1e-9) * self.instrument.spacing:
            contact.adopt(
                solution.position.trial,
                1,
                float(state.axial[-1]),
                state.end.offset,
                state.end.compliance,
            )
            self.pieces.append(state.end)
            track.extend(float(solution.position.kinetic[-1]))
        return self.state

    def _keep(self, state: State, field: Field, *, finish: bool = True) -> State:
        old = self.state
        if state.way is Way.OUT:
            own = Weights(state.tip_nodes, state.tip_weights[None])
            state = dataclasses.replace(state, tip_moved=float(field.means(own)[0, 0]))
        if self.chronicle.seeds:
            state = dataclasses.replace(state, seeds=self.chronicle.places(field))
        self._spent = self.account.add(old, state, (self._field, field))
        self.state, self._field = state, field
        self._count += 1
        self.evaluations += sum(equations.evaluations for equations in self._solved)
        self._solved.clear()
        if finish:
            self.medium.finish(load(self.model, self.instrument.axis.frame, state, self.pieces))
            self.account.set_tissue(self.medium.energies())
        self.chronicle.deepen(state)
        self.chronicle.tell(old, state, self._spent)
        return state
