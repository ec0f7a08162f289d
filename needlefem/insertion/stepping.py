"""A needle in any motion, stepped in time: insert, hold, retract, and in again.

After every step the tissue is in equilibrium with the needle where it is told to be. Where
something happens within a step (the tip starts to cut, leaves the crack front or comes back to
it, leaves the skin), the step is cut there if the tissue has no memory of time; otherwise it
happens at the step's end.
"""

import dataclasses
from collections.abc import Iterable, Iterator

import numpy as np
from scipy.optimize import brentq

from needlefem.arrays import Floats, Vector
from needlefem.errors import SimulationError
from needlefem.fem.interpolation import OutsideError, Weights
from needlefem.fem.model import Model
from needlefem.insertion.account import Account
from needlefem.insertion.contactstep import Field, Solution, StepEquations
from needlefem.insertion.fields import load
from needlefem.insertion.march import March
from needlefem.insertion.media import Medium
from needlefem.insertion.result import Event, Ledger, Outcome, Seed, Snap, State, Status, Way
from needlefem.insertion.schedule import Tick
from needlefem.insertion.track import Friction, Track
from needlefem.insertion.ways import Moment, attempt, first_change, last_smooth
from needlefem.needle.contact import Contact
from needlefem.needle.functionals import Piece, Trial
from needlefem.needle.instrument import Instrument

SHORT = 1e-3
"""Part of what is left of a step at which a tip that runs ahead begins to."""
THIN = 1e-9
"""Length of a piece, relative to the spacing, below which its hold is taken to be of this."""
STUCK = 1e-13
"""Slip in a step that is none, m."""
CHANGES = {
    (Way.PRESSING, Way.WITHDRAWN): "withdrawal",
    (Way.CUTTING, Way.WITHDRAWN): "withdrawal",
    (Way.WITHDRAWN, Way.PRESSING): "return",
    (Way.WITHDRAWN, Way.CUTTING): "return",
    (Way.WITHDRAWN, Way.OUT): "exit",
    (Way.OUT, Way.WITHDRAWN): "entry",
}
"""What a change of the tip's way is called."""


class Rest:
    """No displacement; see `Field`."""

    def __init__(self, dim: int) -> None:
        self._none = np.zeros(dim)

    def means(self, weights: Weights) -> Floats:
        """See `Field`."""
        return np.tile(self._none, (len(weights.rows), 1))


class StepField:
    """Displacement under the needle's forces of one moment, found where it is asked for."""

    def __init__(self, contact: Contact, path: Floats, trial: Trial | None, forces: Floats) -> None:
        self._contact, self._path, self._trial, self._forces = contact, path, trial, forces
        self._background = contact.background

    def means(self, weights: Weights) -> Floats:
        """See `Field`."""
        moved = self._contact.field_at(weights.nodes, self._path, self._trial, self._forces)
        if self._background is not None:
            moved = moved + self._background[weights.nodes]
        found: Floats = weights.rows @ moved @ self._contact.frame.T
        return found


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
    events : list of Event
    seeds : list of Seed
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
        self.account = Account(self.pieces)
        self.events: list[Event] = []
        self.seeds: list[Seed] = []
        self.snaps: list[Snap] = []
        self.outcome = Outcome(Status.STOPPED, "stopped by the caller")
        self.evaluations = 0
        self._contact: Contact  # met with the first step's operator
        self._tip_at_entry = instrument.tip(instrument.axis.entry)
        self.state = self._free_state(0.0, 0.0)
        self._field: Field = Rest(model.dim)
        self._solved: list[StepEquations] = []
        self._spent = (0.0, 0.0)
        self._arc = 0.0
        self._deepest: tuple[float, Field, float] = (0.0, self._field, 0.0)
        self._count = 0
        self._sticking = False

    def iterate(self, ticks: Iterable[Tick]) -> Iterator[State]:
        """Yield the states one by one; stop early by not asking for more."""
        try:
            yield self.state
            for tick in ticks:
                if tick.time > self.state.time or tick.release:
                    yield from self._tick(tick)
            self.outcome = Outcome(
                Status.COMPLETED, f"the motion ended at {self.state.depth:.4g} m"
            )
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
        contact, state, track = march.contact, march.states[-1], self.track
        self._contact = contact
        self.pieces.extend(contact.pieces)
        limits = contact.axial
        for number, later in enumerate(march.states[2:], 1):
            track.front = later.tip
            track.extend(float(limits[number]))
        track.pull[: len(limits)] = limits
        here = self.instrument.tip(state.tip)
        trial = contact.try_functionals(here)
        path = np.column_stack([state.axial, state.lateral]).ravel()
        forces = np.append(state.tip_force, state.tip_lateral)
        self._field = StepField(contact, path, trial, forces)
        self.state = dataclasses.replace(
            state,
            time=state.depth / speed,
            covered=track.length,
            slipping=np.ones(len(limits), dtype=int),
            tip_moved=float(self._field.means(here)[0, 0]),
            tip_nodes=here.nodes,
            tip_weights=here.rows[0],
        )
        self._arc = track.length
        self._deepest = (state.depth, self._field, track.length)
        self.account.begin(spent)

    def position_of(self, seed: Seed) -> Vector:
        """Return where a seed is in the world now, shape (dim,), m."""
        moved = self._field.means(seed.weights)[0] @ self.instrument.axis.frame
        found: Vector = seed.point + moved
        return found

    # a step and what happens in it

    def _tick(self, tick: Tick) -> Iterator[State]:
        if tick.time > self.state.time or tick.depth != self.state.depth:
            self.medium.begin(tick.duration)
            self._meet()
            start = (self.state.time, self.state.depth)
            while self.state.time < tick.time or self.state.depth != tick.depth:
                yield from self._advance(tick, start)
        if tick.release:
            self._release(tick.release)

    def _meet(self) -> None:
        """Let the contact follow the tissue's operator and its motion without the needle."""
        medium = self.medium
        if not hasattr(self, "_contact") or self._contact.responses is not medium.responses:
            self._contact = self._rebuilt(medium)
        self._contact.background = medium.background
        self._contact.balance()

    def _rebuilt(self, medium: Medium) -> Contact:
        contact = Contact(medium.responses, self.instrument.axis.frame)
        for piece in self.pieces:
            trial = contact.try_functionals(Weights(piece.nodes, piece.weights[None]))
            contact.adopt(trial, 0, 0.0, piece.offset, piece.compliance)
        return contact

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
                new = first_change(equations, old.way, old.tip_force, new) or new
            new = self._whole_piece(equations, new)
        if new.way is not Way.CUTTING or new.solution is not None:
            yield self._accept(new, self._time(new.depth, tick, start))
            return
        if self.medium.timeless:
            smooth = last_smooth(equations, old.way, self._arc, tick.depth)
            if smooth is not None and smooth.depth > old.depth:
                yield self._accept(smooth, self._time(smooth.depth, tick, start))
        yield from self._run_ahead(tick, start)

    def _whole_piece(self, equations: StepEquations, new: Moment) -> Moment:
        """Return the moment in the step at which the growing piece is whole, if there is one."""
        solution, spacing = new.solution, self.instrument.spacing
        if new.way is not Way.CUTTING or solution is None:
            return new
        if solution.position.length <= (1.0 + 1e-9) * spacing:
            return new
        track = self.track
        distance = spacing - (track.length - track.arcs[-1])
        found = equations.cut_to(distance, new.depth)
        if found is None or not equations.depth < found.depth < new.depth:
            return new
        return Moment(Way.CUTTING, track.length + distance, found.depth, found)

    def _run_ahead(self, tick: Tick, start: tuple[float, float]) -> Iterator[State]:
        """Let the tip run on at fixed depth until its force is back at that of cutting."""
        timeless, spacing, first = self.medium.timeless, self.instrument.spacing, self._count
        travel = tick.depth - self.state.depth
        depth = self.state.depth + travel * SHORT if timeless else tick.depth
        time, released = self._time(depth, tick, start), self.account.snap
        while True:
            equations, track = self._equations(), self.track
            whole = spacing - (track.length - track.arcs[-1])
            step = equations.run_ahead(whole, depth)
            if step.excess <= 0.0:
                break
            moment = Moment(Way.JUMPING, track.length + whole, depth, step)
            yield self._accept(moment, time, finish=timeless)
        reach = brentq(lambda x: equations.run_ahead(x, depth).excess, 1e-6 * whole, whole,
                       xtol=1e-12 * spacing)  # fmt: skip
        landing = equations.run_ahead(float(reach), depth)
        yield self._accept(Moment(Way.CUTTING, track.length + reach, depth, landing), time)
        self.snaps.append(Snap(depth, first, self._count))
        self._happens("snap", self.account.snap - released)

    def _touch(self, tick: Tick, start: tuple[float, float]) -> Iterator[State]:
        """Press on the skin, and cut it."""
        weights = self._tip_at_entry
        trial = self._contact.try_functionals(weights)
        limit = self.instrument.cutting_force_at(weights)
        depth = tick.depth
        forces = self._pressing(trial, depth)
        if self.medium.timeless and forces[0] > limit:
            old = self.state
            per_depth = (forces[0] - self._pressing(trial, old.depth)[0]) / (depth - old.depth)
            depth -= float((forces[0] - limit) / per_depth)
            forces = self._pressing(trial, depth)
            forces[0] = limit
        punctured = forces[0] >= limit
        if forces[0] <= 0.0:
            state = self._free_state(self._time(depth, tick, start), depth)
            yield self._keep(state, StepField(self._contact, np.zeros(0), None, np.zeros(0)))
            return
        if not punctured or self.medium.timeless:
            state = State(
                depth=depth,
                tip=self.instrument.axis.entry,
                tip_force=float(forces[0]),
                cutting_force=limit,
                tip_lateral=forces[1:],
                tip_nodes=weights.nodes,
                tip_weights=weights.rows[0],
                axial=np.zeros(0),
                lateral=np.zeros((0, len(forces) - 1)),
                moved=np.zeros((0, len(forces))),
                time=self._time(depth, tick, start),
                slipping=np.zeros(0, dtype=int),
                way=Way.PRESSING,
                tip_moved=float(trial.displacement[0] + trial.bare[0] @ forces),
            )
            yield self._keep(state, StepField(self._contact, np.zeros(0), trial, forces))
        if punctured:
            self._contact.adopt(trial, 0, 0.0, np.zeros(len(forces) - 1), 0.0)
            self.pieces.append(self._contact.pieces[-1])
            self._happens("puncture", sum(self._spent))

    def _pressing(self, trial: Trial, depth: float) -> Floats:
        """Return the forces of a tip that holds the entry point on the axis at a depth."""
        wanted = np.zeros(self._contact.dim)
        wanted[0] = depth
        found: Floats = np.linalg.solve(trial.bare, wanted - trial.displacement).astype(float)
        return found

    @staticmethod
    def _time(depth: float, tick: Tick, start: tuple[float, float]) -> float:
        travel = tick.depth - start[1]
        share = (depth - start[1]) / travel if depth != tick.depth and travel != 0.0 else 1.0
        return start[0] + share * (tick.time - start[0])

    # what was found becomes the state

    def _equations(self) -> StepEquations:
        found = StepEquations(self._contact, self.track, self.friction, self.state, self._field)
        self._solved.append(found)
        return found

    def _accept(self, moment: Moment, time: float, *, finish: bool = True) -> State:
        """Make a moment the state."""
        if moment.solution is None:
            self._contact.cover(0)
            state = self._free_state(time, moment.depth)
            field = StepField(self._contact, np.zeros(0), None, np.zeros(0))
            self.track.remember(np.zeros(0), np.zeros(0))
            self._arc = 0.0
            return self._keep(state, field, finish=finish)
        solution, position, contact = moment.solution, moment.solution.position, self._contact
        whole, trial, dim = position.whole, position.trial, contact.dim
        pull = solution.forces[:-1]
        contact.cover(whole)
        contact.axial = np.zeros(len(contact.pieces))
        contact.axial[:whole] = pull[:whole]
        contact.balance()
        forces = np.zeros(2 * dim)
        forces[0], forces[dim] = solution.tip_force, pull[whole]
        forces[dim + 1 :] = position.shaft.lateral(solution.forces)
        lateral = contact.lateral_forces(trial, forces)
        moved = contact.displacements(lateral, trial, forces)
        end = self._end(solution)
        slip = np.where(np.abs(solution.slip) > STUCK, solution.slip, 0.0)
        state = State(
            depth=moment.depth,
            tip=position.tip,
            tip_force=solution.tip_force,
            cutting_force=position.cutting_force,
            tip_lateral=np.zeros(dim - 1),
            tip_nodes=trial.weights.nodes,
            tip_weights=trial.weights.rows[0],
            axial=pull,
            lateral=np.vstack([lateral, forces[dim + 1 :]]),
            moved=np.delete(moved, whole, axis=0),
            jumping=moment.way is Way.JUMPING,
            time=time,
            covered=moment.arc,
            end=end,
            slipping=np.sign(slip).astype(int),
            way=moment.way,
            tip_moved=float(moved[whole, 0]),
        )
        path = np.column_stack([pull[:whole], lateral]).ravel()
        self.track.remember(pull, slip)
        self._keep(state, StepField(contact, path, trial, forces), finish=finish)
        if moment.way in (Way.CUTTING, Way.JUMPING):
            self._cut_on(solution, float(forces[dim]), end)
        self._arc = self.track.length if moment.way is not Way.WITHDRAWN else moment.arc
        return state

    def _end(self, solution: Solution) -> Piece:
        """Return the piece that the tip is in."""
        position, instrument = solution.position, self.instrument
        last = self.track.vertices[position.whole - 1]
        row = position.trial.weights.rows[1]
        used = np.flatnonzero(row)
        length = max(position.length, THIN * instrument.spacing)
        return Piece(
            position.trial.weights.nodes[used],
            row[used],
            instrument.axis.offset(0.5 * (position.tip + last)),
            1.0 / (instrument.lateral_stiffness * length),
        )

    def _cut_on(self, solution: Solution, pull: float, end: Piece) -> None:
        """Move the crack front; make the growing piece a whole one when it is long enough."""
        position = solution.position
        self.track.front = position.tip
        if position.length >= (1.0 - 1e-9) * self.instrument.spacing:
            self._contact.adopt(position.trial, 1, pull, end.offset, end.compliance)
            self.pieces.append(end)
            self.track.extend(float(position.kinetic[-1]))

    def _free_state(self, time: float, depth: float) -> State:
        """Return the state of a needle that touches nothing."""
        weights, dim = self._tip_at_entry, self.model.dim
        return State(
            depth=depth,
            tip=self.instrument.axis.entry,
            tip_force=0.0,
            cutting_force=self.instrument.cutting_force_at(weights),
            tip_lateral=np.zeros(dim - 1),
            tip_nodes=weights.nodes,
            tip_weights=weights.rows[0],
            axial=np.zeros(0),
            lateral=np.zeros((0, dim - 1)),
            moved=np.zeros((0, dim)),
            time=time,
            slipping=np.zeros(0, dtype=int),
            way=Way.OUT,
        )

    def _keep(self, state: State, field: Field, *, finish: bool = True) -> State:
        old = self.state
        if state.way is Way.OUT:
            own = Weights(state.tip_nodes, state.tip_weights[None])
            state = dataclasses.replace(state, tip_moved=float(field.means(own)[0, 0]))
        self._spent = self.account.add(old, state, (self._field, field))
        self.state, self._field = state, field
        self._count += 1
        self.evaluations += sum(equations.evaluations for equations in self._solved)
        self._solved.clear()
        if finish:
            self.medium.finish(load(self.model, self.instrument.axis.frame, state, self.pieces))
            energies = self.medium.energies()
            if energies:
                stored = energies["strain"] + energies["stored"]
                self.account.set_tissue(stored, energies["relaxation"])
        if state.depth >= self._deepest[0] and state.way is not Way.OUT:
            self._deepest = (state.depth, field, state.covered)
        self._tell(old, state)
        return state

    # events

    def _happens(self, kind: str, energy: float, name: str = "", at: State | None = None) -> None:
        state = at or self.state
        self.events.append(Event(kind, state.time, state.depth, state.tip, energy, name))

    def _tell(self, old: State, new: State) -> None:
        """Note what changed from one state to the next."""
        friction, tip = self._spent
        if (old.way, new.way) in CHANGES and self.pieces and (len(old.axial) or len(new.axial)):
            found = new.way in (Way.OUT, Way.PRESSING, Way.CUTTING) or not self.medium.timeless
            at = new if found else old  # a step is cut before the tip leaves, after it arrives
            self._happens(CHANGES[old.way, new.way], tip, at=at)
        if len(new.axial) < 2:
            return
        assert new.slipping is not None
        slipping = np.count_nonzero(new.slipping[1:])
        if self._sticking and slipping == len(new.axial) - 1:
            self._sticking = False
            self._happens("breakaway", friction)
        elif not self._sticking and slipping == 0:
            self._sticking = True
            self._happens("grip", friction)

    def _shortcut(self, depth: float) -> Vector:
        """Return the material that was at a depth of the path when the needle was deepest."""
        deepest, field, length = self._deepest
        axis, track = self.instrument.axis, self.track
        if depth >= deepest or not self.pieces:
            return self.state.tip

        def ahead(arc: float) -> float:
            point = track.at(arc)[1]
            return float(axis.along(point) + field.means(self.instrument.tip(point))[0, 0]) - depth

        if ahead(0.0) >= 0.0 or ahead(length) <= 0.0:
            return self.state.tip
        return track.at(float(brentq(ahead, 0.0, length, xtol=1e-12)))[1]

    def _release(self, name: str) -> None:
        state = self.state
        weights = Weights(state.tip_nodes, state.tip_weights[None])
        world = self.instrument.axis.tip(state.depth)
        self.seeds.append(
            Seed(
                name=name,
                time=state.time,
                released_at=world,
                point=state.tip,
                shortcut=self._shortcut(state.depth),
                weights=weights,
                inside=len(state.axial) > 0,
            )
        )
        self._happens("release", 0.0, name)
