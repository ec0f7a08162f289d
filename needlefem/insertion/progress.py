"""How far a stepped needle has come: its state, its path, energies and events so far."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from needlefem._arrays import Floats, Vector
from needlefem.contact.condensed_contact import Contact
from needlefem.contact.friction import Friction
from needlefem.contact.functionals import Piece, Trial
from needlefem.fem.compliance import Responses
from needlefem.fem.interpolation import Weights
from needlefem.fem.tissue_model import Model
from needlefem.insertion.account import Account, Spent
from needlefem.insertion.cut_path import Track
from needlefem.insertion.events import Chronicle
from needlefem.insertion.fields import load
from needlefem.insertion.handover import hand_over
from needlefem.insertion.moments import extend, free_state, settled
from needlefem.insertion.path_following import March
from needlefem.insertion.recent import Recent
from needlefem.insertion.result import Ledger, LeftTissueError
from needlefem.insertion.state import State, Way
from needlefem.insertion.step_equations import Field, StepEquations
from needlefem.insertion.stepfield import Rest, StepField
from needlefem.insertion.tip_phase import Moment
from needlefem.insertion.tissue_response import Medium
from needlefem.mesh.surface import TipWatch
from needlefem.needle.needle_interface import Instrument

AT_SURFACE = 1.0 / 64
"""Distance from the surface ahead, relative to the spacing, at which the tip is there."""


@dataclasses.dataclass(frozen=True, eq=False)
class Found:
    """What a step may end in.

    Parameters
    ----------
    state : State
    field : Field
    spent : Spent
    moment : Moment, optional
        None: the needle is not in the tissue.
    """

    state: State
    field: Field
    spent: Spent
    moment: Moment | None = None


class Progress:
    """The needle in the tissue so far.

    Parameters
    ----------
    instrument : Instrument
    medium : Medium
        The tissue in time.
    model : Model
    friction : Friction

    Attributes
    ----------
    state : State
        The newest.
    arc : float, m
        Path length at which the tip is.
    count : int
        States so far.
    contact : Contact
        Met with the first step's operator.
    spent : (float, float)
        What friction, and what the tip took in the newest step, J (J/m in 2D).
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
        self.chronicle = Chronicle(self.track, timeless=medium.timeless)
        self.tip_at_entry = instrument.tip(instrument.axis.entry)
        self.state = free_state(self.track, self.tip_at_entry, 0.0, 0.0)
        self.spent = (0.0, 0.0)
        self.arc, self.count, self.evaluations = 0.0, 0, 0
        self.contact: Contact
        self._watch = TipWatch(instrument.interpolation.surface, instrument.axis.entry)
        self._contacts: Recent[Responses, Contact] = Recent()
        self._field: Field = Rest(model.dim)
        self._solved: list[StepEquations] = []

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
        self.contact = march.contact
        self.pieces.extend(march.contact.pieces)
        self.state, self._field = hand_over(march, self.track, speed)
        self.arc, self.count = self.track.length, len(march.states) - 1
        for state in march.states:
            self.chronicle.deepen(state)
        stored = self._stored_by_sticking()
        hold, friction = spent.hold + stored, spent.friction - stored
        self.account.begin(dataclasses.replace(spent, hold=hold, friction=friction))

    def _stored_by_sticking(self) -> float:
        """Return the energy of the tangential penalty, J (J/m in 2D): all of it is at the limit."""
        compliances = np.array([piece.compliance for piece in self.pieces])
        return 0.5 * self.account.give * float(compliances @ self.state.axial**2)

    def begin(self, duration: float) -> None:
        """Begin a step: meet the tissue's operator, and its motion without the needle."""
        medium = self.medium
        medium.begin(duration)
        responses = medium.responses
        if not hasattr(self, "contact") or self.contact.responses is not responses:
            frame = self.instrument.axis.frame
            self.contact = self._contacts.get(responses, lambda: Contact(responses, frame))
            extend(self.contact, self.pieces)
        self.contact.background = medium.background
        self.contact.swing = medium.swing(self.pieces, self.instrument.axis.direction)
        self.contact.balance()

    def equations(self) -> StepEquations:
        """Return the equations of a step from the newest state."""
        found = StepEquations(self.contact, self.track, self.friction, self.state, self._field)
        self._solved.append(found)
        return found

    # what a step may end in

    def found(self, moment: Moment, time: float) -> Found:
        """Return a moment as a state, and what the step to it spends.

        Raises
        ------
        LeftTissueError
            The tip has cut its way out of the tissue.
        """
        solution = moment.solution
        if solution is None:
            return self.free(time, moment.depth)
        if moment.way in (Way.CUTTING, Way.JUMPING):
            self.check_inside(solution.position.tip, moment.depth)
            arc = self.track.arcs[-1] + solution.position.length
            moment = dataclasses.replace(moment, arc=arc)
        state, field = settled(self.contact, self.track, moment, time)
        return self._weighed(state, field, moment)

    def check_inside(self, tip: Vector, depth: float) -> None:
        """Raise a `LeftTissueError` if the tip leaves the tissue on its way to a point.

        Parameters
        ----------
        tip : array, shape (dim,), m
            Material point ahead of the crack front.
        depth : float, m
            Of the needle there.
        """
        front, before = self.track.front, self.state.depth
        share = self._watch.first_exit(front, tip)
        if share is not None:
            place = front + share * (tip - front)
            raise LeftTissueError(place, before + share * (depth - before))

    def room(self) -> float:
        """Return how far the tip may cut straight ahead, m: to the surface, at most a piece.

        Raises
        ------
        LeftTissueError
            It is at the surface.
        """
        front, depth, spacing = self.track.front, self.state.depth, self.instrument.spacing
        direction = self.instrument.axis.direction
        self.check_inside(front + AT_SURFACE * spacing * direction, depth)
        share = self._watch.first_exit(front, front + spacing * direction)
        return np.inf if share is None else share * spacing

    def left(self) -> LeftTissueError:
        """Return the error of a tip around which no tissue is left."""
        front, depth = self.track.front, self.state.depth
        try:
            self.check_inside(
                front + self.instrument.spacing * self.instrument.axis.direction, depth
            )
        except LeftTissueError as error:
            return error
        return LeftTissueError(front, depth)

    def free(self, time: float, depth: float) -> Found:
        """Return the state of a needle that is not in the tissue."""
        self.contact.cover(0)
        state = free_state(self.track, self.tip_at_entry, time, depth)
        field = StepField(self.contact, np.zeros(0), None, np.zeros(0))
        own = Weights(state.tip_nodes, state.tip_weights[None])
        state = dataclasses.replace(state, tip_moved=float(field.means(own)[0, 0]))
        return self._weighed(state, field)

    def pressing(self, state: State, trial: Trial, forces: Floats) -> Found:
        """Return the state of a tip that holds uncut skin with some forces."""
        return self._weighed(state, StepField(self.contact, np.zeros(0), trial, forces))

    def _weighed(self, state: State, field: Field, moment: Moment | None = None) -> Found:
        fields = (self._field, field)
        spent = self.account.weigh(self.state, state, fields, self.track.length)
        return Found(state, field, spent, moment)

    # what it ends in

    def accept(self, found: Found) -> State:
        """Make what was found the state; the tissue takes its forces in the step that has begun."""
        track, moment = self.track, found.moment
        if moment is None:
            track.remember(np.zeros(0), np.zeros(0))
            self.arc = 0.0
            return self._keep(found)
        solution, state = moment.solution, found.state
        assert solution is not None
        assert state.end is not None
        ahead = moment.way in (Way.CUTTING, Way.JUMPING)
        if ahead:
            track.front = solution.position.tip
        track.remember(state.axial, solution.slipped)
        self._keep(found)
        self.arc = moment.arc
        long = solution.position.length >= (1.0 - 1e-9) * self.instrument.spacing
        if ahead and (long or moment.whole):
            end, trial = state.end, solution.position.trial
            self.contact.adopt(trial, 1, float(state.axial[-1]), end.offset, end.compliance)
            self.pieces.append(end)
            track.extend(float(solution.position.kinetic[-1]))
        return self.state

    def release(self, names: Sequence[str]) -> State:
        """Let the tip let go of something; return the state with it."""
        world = self.instrument.axis.tip(self.state.depth)
        for name in names:
            self.chronicle.release(name, self.state, world)
        seeds = self.chronicle.places(self._field)
        self.state = dataclasses.replace(self.state, seeds=seeds)
        return self.state

    def puncture(self, trial: Trial, count: int) -> None:
        """Cut the skin: the entry point becomes the path's first piece, without friction.

        Parameters
        ----------
        trial : Trial
            Of the tip's kernel there.
        count : int
            Lateral directions.
        """
        self.contact.adopt(trial, 0, 0.0, np.zeros(count), 0.0)
        self.pieces.append(self.contact.pieces[-1])

    def _keep(self, found: Found) -> State:
        old, state = self.state, found.state
        if self.chronicle.seeds:
            state = dataclasses.replace(state, seeds=self.chronicle.places(found.field))
        self.account.add(found.spent)
        self.spent = (found.spent.friction, found.spent.tip)
        self.state, self._field = state, found.field
        self.count += 1
        self.evaluations += sum(equations.evaluations for equations in self._solved)
        self._solved.clear()
        self.medium.finish(load(self.model, self.instrument.axis.frame, state, self.pieces))
        self.account.set_tissue(self.medium.energies())
        self.chronicle.deepen(state)
        self.chronicle.tell(old, state, self.spent)
        return state
