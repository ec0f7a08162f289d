"""The current result of time stepping: state, cut path, energies and events."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from needlefem._arrays import Floats, Vector
from needlefem.contact.condensed_contact import CondensedContact, ContactSegment, ContactTrial
from needlefem.contact.friction import SlipWeakeningFriction
from needlefem.fem.compliance import ComplianceOperator
from needlefem.fem.interpolation import LinearFunctionals
from needlefem.fem.tissue_model import TissueModel
from needlefem.insertion.cut_path import CutPath
from needlefem.insertion.energy_balance import EnergyBalance, EnergyIncrement
from needlefem.insertion.events import EventLog
from needlefem.insertion.insertion_run import hand_over
from needlefem.insertion.path_following import PathFollowing
from needlefem.insertion.response_in_time import LeastRecentlyUsed
from needlefem.insertion.result import EnergyTerms, LeftTissueError
from needlefem.insertion.state import (
    ContactField,
    State,
    TipPhase,
    ZeroField,
    extend,
    load,
    outside_state,
    state_from_trial,
)
from needlefem.insertion.step_equations import Field, StepEquations
from needlefem.insertion.tip_phase import TipTrial
from needlefem.insertion.tissue_response import TissueResponse
from needlefem.mesh.surface import TipWatch
from needlefem.needle.needle_interface import NeedleInterface

AT_SURFACE = 1.0 / 64
"""Distance from the surface ahead, relative to the spacing, at which the tip is there."""


@dataclasses.dataclass(frozen=True, eq=False)
class StepResult:
    """What a step may end in.

    Parameters
    ----------
    state : State
    field : Field
    spent : EnergyIncrement
    moment : TipTrial, optional
        None: the needle is not in the tissue.
    """

    state: State
    field: Field
    spent: EnergyIncrement
    moment: TipTrial | None = None


class Progress:
    """The needle in the tissue so far.

    Parameters
    ----------
    instrument : NeedleInterface
    medium : TissueResponse
        The tissue in time.
    model : TissueModel
    friction : SlipWeakeningFriction

    Attributes
    ----------
    state : State
        The newest.
    arc : float, m
        Path length at which the tip is.
    count : int
        States so far.
    contact : CondensedContact
        Met with the first step's operator.
    spent : (float, float)
        What friction, and what the tip took in the newest step, J (J/m in 2D).
    evaluations : int
        Contact evaluations spent.
    """

    def __init__(
        self,
        instrument: NeedleInterface,
        medium: TissueResponse,
        model: TissueModel,
        friction: SlipWeakeningFriction,
    ) -> None:
        self.instrument, self.medium, self.model = instrument, medium, model
        self.friction = friction
        self.track = CutPath(instrument)
        self.pieces: list[ContactSegment] = []
        stiffness = friction.stiffness
        give = instrument.lateral_penalty / stiffness if stiffness > 0.0 else 0.0
        self.account = EnergyBalance(self.pieces, give, inertial=medium.inertial)
        self.chronicle = EventLog(self.track, timeless=medium.timeless)
        self.tip_at_entry = instrument.tip(instrument.axis.entry)
        self.state = outside_state(self.track, self.tip_at_entry, 0.0, 0.0)
        self.spent = (0.0, 0.0)
        self.arc, self.count, self.evaluations = 0.0, 0, 0
        self.contact: CondensedContact
        self._watch = TipWatch(instrument.interpolation.surface, instrument.axis.entry)
        self._contacts: LeastRecentlyUsed[ComplianceOperator, CondensedContact] = (
            LeastRecentlyUsed()
        )
        self._field: Field = ZeroField(model.dim)
        self._solved: list[StepEquations] = []

    def take_over(self, march: PathFollowing, speed: float, spent: EnergyTerms) -> None:
        """Go on where a march ended, with all that it has cut.

        Parameters
        ----------
        march : PathFollowing
        speed : float, m/s
            Of the needle on it.
        spent : EnergyTerms
            Its energies.
        """
        if not march.contact.pieces:
            return
        self.contact = march.contact
        self.pieces.extend(march.contact.pieces)
        self.state, self._field = hand_over(march, self.track, speed)
        self.arc, self.count = self.track.length, len(march.states) - 1
        for state in march.states:
            self.chronicle.record_deepest(state)
        stored = self._stored_by_sticking()
        hold, friction = spent.lateral_penalty_energy + stored, spent.friction - stored
        self.account.begin(
            dataclasses.replace(spent, lateral_penalty_energy=hold, friction=friction)
        )

    def _stored_by_sticking(self) -> float:
        """Return the energy of the tangential penalty, J (J/m in 2D): all of it is at the limit."""
        compliances = np.array([piece.compliance for piece in self.pieces])
        return 0.5 * self.account.give * float(compliances @ self.state.friction_force**2)

    def begin(self, duration: float) -> None:
        """Begin a step: meet the tissue's operator, and its motion without the needle."""
        medium = self.medium
        medium.begin(duration)
        responses = medium.responses
        if not hasattr(self, "contact") or self.contact.responses is not responses:
            frame = self.instrument.axis.frame
            self.contact = self._contacts.get(responses, lambda: CondensedContact(responses, frame))
            extend(self.contact, self.pieces)
        self.contact.background = medium.background
        self.contact.swing = medium.swing(self.pieces, self.instrument.axis.direction)
        self.contact.eliminate_lateral()

    def equations(self) -> StepEquations:
        """Return the equations of a step from the newest state."""
        found = StepEquations(self.contact, self.track, self.friction, self.state, self._field)
        self._solved.append(found)
        return found

    # what a step may end in

    def found(self, moment: TipTrial, time: float) -> StepResult:
        """Return a moment as a state, and what the step to it spends.

        Raises
        ------
        LeftTissueError
            The tip has cut its way out of the tissue.
        """
        solution = moment.solution
        if solution is None:
            return self.free(time, moment.depth)
        if moment.phase in (TipPhase.CUTTING, TipPhase.RUPTURE):
            self.check_inside(solution.position.tip, moment.depth)
            arc = self.track.arcs[-1] + solution.position.length
            moment = dataclasses.replace(moment, arc=arc)
        state, field = state_from_trial(self.contact, self.track, moment, time)
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
        front, before = self.track.crack_front, self.state.depth
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
        front, depth, spacing = self.track.crack_front, self.state.depth, self.instrument.spacing
        direction = self.instrument.axis.direction
        self.check_inside(front + AT_SURFACE * spacing * direction, depth)
        share = self._watch.first_exit(front, front + spacing * direction)
        return np.inf if share is None else share * spacing

    def left(self) -> LeftTissueError:
        """Return the error of a tip around which no tissue is left."""
        front, depth = self.track.crack_front, self.state.depth
        try:
            self.check_inside(
                front + self.instrument.spacing * self.instrument.axis.direction, depth
            )
        except LeftTissueError as error:
            return error
        return LeftTissueError(front, depth)

    def free(self, time: float, depth: float) -> StepResult:
        """Return the state of a needle that is not in the tissue."""
        self.contact.set_active(0)
        state = outside_state(self.track, self.tip_at_entry, time, depth)
        field = ContactField(self.contact, np.zeros(0), None, np.zeros(0))
        own = LinearFunctionals(state.tip_nodes, state.tip_weights[None])
        state = dataclasses.replace(state, tip_displacement=float(field.means(own)[0, 0]))
        return self._weighed(state, field)

    def pressing(self, state: State, trial: ContactTrial, forces: Floats) -> StepResult:
        """Return the state of a tip that holds uncut skin with some forces."""
        return self._weighed(state, ContactField(self.contact, np.zeros(0), trial, forces))

    def _weighed(self, state: State, field: Field, moment: TipTrial | None = None) -> StepResult:
        fields = (self._field, field)
        spent = self.account.weigh(self.state, state, fields, self.track.length)
        return StepResult(state, field, spent, moment)

    # what it ends in

    def accept(self, found: StepResult) -> State:
        """Make what was found the state; the tissue takes its forces in the step that has begun."""
        track, moment = self.track, found.moment
        if moment is None:
            track.store(np.zeros(0), np.zeros(0))
            self.arc = 0.0
            return self._keep(found)
        solution, state = moment.solution, found.state
        assert solution is not None
        assert state.partial_segment is not None
        ahead = moment.phase in (TipPhase.CUTTING, TipPhase.RUPTURE)
        if ahead:
            track.crack_front = solution.position.tip
        track.store(state.friction_force, solution.slipped)
        self._keep(found)
        self.arc = moment.arc
        long = solution.position.length >= (1.0 - 1e-9) * self.instrument.spacing
        if ahead and (long or moment.segment_full):
            end, trial = state.partial_segment, solution.position.trial
            self.contact.append_segment(
                trial, 1, float(state.friction_force[-1]), end.offset, end.compliance
            )
            self.pieces.append(end)
            track.extend(float(solution.position.kinetic[-1]))
        return self.state

    def release(self, names: Sequence[str]) -> State:
        """Let the tip let go of something; return the state with it."""
        world = self.instrument.axis.tip_position(self.state.depth)
        for name in names:
            self.chronicle.release(name, self.state, world)
        seeds = self.chronicle.seed_positions(self._field)
        self.state = dataclasses.replace(self.state, seeds=seeds)
        return self.state

    def puncture(self, trial: ContactTrial, count: int) -> None:
        """Cut the skin: the entry point becomes the path's first piece, without friction.

        Parameters
        ----------
        trial : ContactTrial
            Of the tip's kernel there.
        count : int
            Lateral directions.
        """
        self.contact.append_segment(trial, 0, 0.0, np.zeros(count), 0.0)
        self.pieces.append(self.contact.pieces[-1])

    def _keep(self, found: StepResult) -> State:
        old, state = self.state, found.state
        if self.chronicle.seeds:
            state = dataclasses.replace(state, seeds=self.chronicle.seed_positions(found.field))
        self.account.add(found.spent)
        self.spent = (found.spent.friction, found.spent.tip)
        self.state, self._field = state, found.field
        self.count += 1
        self.evaluations += sum(equations.evaluations for equations in self._solved)
        self._solved.clear()
        self.medium.finish(load(self.model, self.instrument.axis.frame, state, self.pieces))
        self.account.set_tissue(self.medium.energies())
        self.chronicle.record_deepest(state)
        self.chronicle.record_transitions(old, state, self.spent)
        return state
