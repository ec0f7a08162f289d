"""Current state of time stepping: cut path, energies and events up to the last accepted step."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from needlefem._arrays import Floats, Vector
from needlefem.contact.condensed_contact import CondensedContact, ContactSegment, ContactTrial
from needlefem.contact.friction import SlipWeakeningFriction
from needlefem.fem.compliance import ComplianceOperator
from needlefem.fem.interpolation import LinearFunctionals, OutsideError
from needlefem.fem.tissue_model import TissueModel
from needlefem.insertion.cut_path import CutPath
from needlefem.insertion.energy_balance import EnergyBalance, EnergyIncrement
from needlefem.insertion.events import EventLog
from needlefem.insertion.insertion_run import state_after_path_following
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
from needlefem.insertion.tip_solver import (
    TOLERANCE,
    NoEquilibriumError,
    TipSolution,
    TipSolver,
)
from needlefem.insertion.tissue_response import TissueResponse
from needlefem.mesh.surface import TipWatch
from needlefem.needle.needle_interface import NeedleInterface

CLOSE = 1e-12
"""Relative difference of forces that is round-off."""
MOST_GROWN = 0.99
"""Length of the partial segment over that of a full one up to which path following extends it."""
LITTLE = 0.25
"""Depth gained over length in a step, relative to that in the last step or to 1, below which the
depth may have a maximum in the step."""
AT_SURFACE = 1.0 / 64
"""Distance from the surface, relative to the path spacing, at which the tip leaves the tissue."""


@dataclasses.dataclass(frozen=True, eq=False)
class StepResult:
    """Result of a step that is not accepted yet.

    Parameters
    ----------
    state : State
    field : Field
        Displacement field of the state.
    spent : EnergyIncrement
        Energies of the step.
    tip_trial : TipTrial, optional
        None: the needle is not in the tissue.
    """

    state: State
    field: Field
    spent: EnergyIncrement
    tip_trial: TipTrial | None = None


class Progress:
    """Current state of time stepping.

    Parameters
    ----------
    instrument : NeedleInterface
    tissue_response : TissueResponse
    model : TissueModel
    friction : SlipWeakeningFriction

    Attributes
    ----------
    state : State
        The last accepted state.
    arc : float, m
        Path length at the tip.
    count : int
        Number of accepted states.
    contact : CondensedContact
        Defined when the first step has begun.
    spent : (float, float)
        Energy dissipated in the last step by friction, and at the tip, J (J/m in 2D).
    evaluations : int
        Number of contact problems that were solved.
    """

    def __init__(
        self,
        instrument: NeedleInterface,
        tissue_response: TissueResponse,
        model: TissueModel,
        friction: SlipWeakeningFriction,
    ) -> None:
        self.instrument, self.tissue_response, self.model = instrument, tissue_response, model
        self.friction = friction
        self.cut_path = CutPath(instrument)
        self.segments: list[ContactSegment] = []
        stiffness = friction.stiffness
        penalty_ratio = instrument.lateral_penalty / stiffness if stiffness > 0.0 else 0.0
        self.energy_balance = EnergyBalance(
            self.segments, penalty_ratio, has_inertia=tissue_response.has_inertia
        )
        self.event_log = EventLog(self.cut_path, rate_independent=tissue_response.rate_independent)
        self.tip_at_entry = instrument.tip(instrument.axis.entry)
        self.state = outside_state(self.cut_path, self.tip_at_entry, 0.0, 0.0)
        self.spent = (0.0, 0.0)
        self.arc, self.count, self.evaluations = 0.0, 0, 0
        self.contact: CondensedContact
        self._watch = TipWatch(instrument.interpolation.surface, instrument.axis.entry)
        self._contacts: LeastRecentlyUsed[ComplianceOperator, CondensedContact] = (
            LeastRecentlyUsed()
        )
        self._field: Field = ZeroField(model.dim)
        self._tip_solver: TipSolver | None = None
        self._path_rate = 0.0
        self._solved: list[StepEquations] = []

    def continue_from(
        self, path_following: PathFollowing, speed: float, spent: EnergyTerms
    ) -> None:
        """Continue after path following, with the path that it has cut.

        Parameters
        ----------
        path_following : PathFollowing
        speed : float, m/s
            Speed of the needle during path following.
        spent : EnergyTerms
            Energies of path following.
        """
        if not path_following.contact.segments:
            return
        self.contact, self._tip_solver = path_following.contact, path_following.tip_solver
        self.segments.extend(path_following.contact.segments)
        self.state, self._field = state_after_path_following(path_following, self.cut_path, speed)
        self.arc, self.count = self.cut_path.length, len(path_following.states) - 1
        for state in path_following.states:
            self.event_log.record_deepest(state)
        stored = self._stored_by_sticking()
        penalty, friction = spent.lateral_penalty_energy + stored, spent.friction - stored
        self.energy_balance.begin(
            dataclasses.replace(spent, lateral_penalty_energy=penalty, friction=friction)
        )

    def _stored_by_sticking(self) -> float:
        """Return the energy stored in the tangential penalty after path following, J (J/m in 2D).

        All segments are then at the friction limit.
        """
        compliances = np.array([segment.compliance for segment in self.segments])
        return (
            0.5
            * self.energy_balance.penalty_ratio
            * float(compliances @ self.state.friction_force**2)
        )

    def begin(self, duration: float) -> None:
        """Begin a step of a duration (s): set operator and free displacement of the tissue."""
        tissue_response = self.tissue_response
        tissue_response.begin(duration)
        responses = tissue_response.responses
        if not hasattr(self, "contact") or self.contact.responses is not responses:
            frame = self.instrument.axis.frame
            self.contact = self._contacts.get(responses, lambda: CondensedContact(responses, frame))
            extend(self.contact, self.segments)
        self.contact.free_displacement = tissue_response.free_displacement
        self.contact.inertial_drift = tissue_response.inertial_drift(
            self.segments, self.instrument.axis.direction
        )
        self.contact.eliminate_lateral()

    def equations(self) -> StepEquations:
        """Return the equations of a step from the last accepted state."""
        found = StepEquations(self.contact, self.cut_path, self.friction, self.state, self._field)
        self._solved.append(found)
        return found

    def path_step(self, depth: float) -> TipTrial | None:
        """Return a step of path following: to the end of a contact segment, or to a depth in it.

        It needs a few contact solutions, as the friction forces are known and only the direction of
        the tip is sought. None where path following is not valid, or the tip may rupture: then the
        step is taken by depth.

        Parameters
        ----------
        depth : float, m
            Largest depth of the needle.
        """
        state, contact, cut_path = self.state, self.contact, self.cut_path
        grown, spacing = cut_path.length - cut_path.arcs[-1], self.instrument.spacing
        kinetic = np.array(cut_path.kinetic)
        if (
            depth <= state.depth
            or state.tip_force < (1.0 - CLOSE) * state.cutting_force
            or grown > MOST_GROWN * spacing
            or len(contact.friction_forces) != cut_path.count
            or np.any(np.abs(contact.friction_forces - kinetic) > CLOSE * kinetic)
        ):
            return None
        if contact.active_segments != cut_path.count:
            contact.set_active(cut_path.count)
        if self._tip_solver is None or self._tip_solver.contact is not contact:
            self._tip_solver = TipSolver(self.instrument, contact)
        begun = self._tip_solver.evaluations
        try:
            step = self._step_along_path(self._tip_solver, spacing - grown, depth)
        except (NoEquilibriumError, OutsideError):
            return None
        finally:
            self.evaluations += self._tip_solver.evaluations - begun
        if step is None or self._watch.first_exit(cut_path.crack_front, step.tip) is not None:
            return None
        solution = self.equations().all_slipping(step)
        if solution is None:
            return None
        self._tip_solver.follow(step)
        return TipTrial(TipPhase.CUTTING, cut_path.length, step.depth, solution)

    def _step_along_path(
        self, solver: TipSolver, missing: float, depth: float
    ) -> TipSolution | None:
        """Return a step of path following over the missing length of a segment, or to a depth.

        None if the depth grows little: its maximum, where a rupture begins, may be in the step.
        """
        before, spacing = self.state.depth, self.instrument.spacing
        last = self.cut_path.vertices[-1]
        step: TipSolution | None = solver.solve(last, spacing)
        assert step is not None
        if step.depth > depth + TOLERANCE:
            rate = (step.depth - before) / missing
            step = solver.solve_to(last, depth, spacing - (step.depth - depth) / rate, rate)
            if step is None:
                return None
            missing -= spacing - float(np.linalg.norm(step.tip - last))
        if abs(step.depth - depth) <= TOLERANCE:
            step = step._replace(depth=depth)
        if missing <= 0.0 or step.depth - before <= LITTLE * max(self._path_rate, 1.0) * missing:
            return None
        self._path_rate = (step.depth - before) / missing
        return step

    # results of a step that are not accepted yet

    def found(self, tip_trial: TipTrial, time: float) -> StepResult:
        """Return the result of a step with a given solution.

        Raises
        ------
        LeftTissueError
            The tip has cut through the surface.
        """
        solution = tip_trial.solution
        if solution is None:
            return self.free(time, tip_trial.depth)
        if tip_trial.phase in (TipPhase.CUTTING, TipPhase.RUPTURE):
            self.check_inside(solution.position.tip, tip_trial.depth)
            arc = self.cut_path.arcs[-1] + solution.position.length
            tip_trial = dataclasses.replace(tip_trial, arc=arc)
        state, field = state_from_trial(self.contact, self.cut_path, tip_trial, time)
        return self._with_energies(state, field, tip_trial)

    def check_inside(self, tip: Vector, depth: float) -> None:
        """Raise a `LeftTissueError` if the tip crosses the surface on the line to a point.

        Parameters
        ----------
        tip : array, shape (dim,), m
            Material point ahead of the crack front.
        depth : float, m
            Depth of the needle there.
        """
        front, before = self.cut_path.crack_front, self.state.depth
        share = self._watch.first_exit(front, tip)
        if share is not None:
            place = front + share * (tip - front)
            raise LeftTissueError(place, before + share * (depth - before))

    def room(self) -> float:
        """Return the length that the tip may cut straight ahead, m: at most to the surface.

        Infinite if the surface is further away than the path spacing.

        Raises
        ------
        LeftTissueError
            The tip is at the surface.
        """
        front, depth, spacing = self.cut_path.crack_front, self.state.depth, self.instrument.spacing
        direction = self.instrument.axis.direction
        self.check_inside(front + AT_SURFACE * spacing * direction, depth)
        share = self._watch.first_exit(front, front + spacing * direction)
        return np.inf if share is None else share * spacing

    def left(self) -> LeftTissueError:
        """Return the error of a tip kernel that is outside of the tissue."""
        front, depth = self.cut_path.crack_front, self.state.depth
        try:
            self.check_inside(
                front + self.instrument.spacing * self.instrument.axis.direction, depth
            )
        except LeftTissueError as error:
            return error
        return LeftTissueError(front, depth)

    def free(self, time: float, depth: float) -> StepResult:
        """Return the result of a step that ends without contact."""
        self.contact.set_active(0)
        state = outside_state(self.cut_path, self.tip_at_entry, time, depth)
        field = ContactField(self.contact, np.zeros(0), None, np.zeros(0))
        own = LinearFunctionals(state.tip_nodes, state.tip_weights[None])
        state = dataclasses.replace(state, tip_displacement=float(field.means(own)[0, 0]))
        return self._with_energies(state, field)

    def pressing(self, state: State, trial: ContactTrial, forces: Floats) -> StepResult:
        """Return the result of a step that ends with the tip loading the uncut skin."""
        return self._with_energies(state, ContactField(self.contact, np.zeros(0), trial, forces))

    def _with_energies(
        self, state: State, field: Field, tip_trial: TipTrial | None = None
    ) -> StepResult:
        fields = (self._field, field)
        spent = self.energy_balance.increment(self.state, state, fields, self.cut_path.length)
        return StepResult(state, field, spent, tip_trial)

    # acceptance of a result

    def accept(self, found: StepResult) -> State:
        """Accept a result; the tissue ends its step with the forces of the result."""
        cut_path, tip_trial = self.cut_path, found.tip_trial
        if tip_trial is None:
            cut_path.store(np.zeros(0), np.zeros(0))
            self.arc = 0.0
            return self._keep(found)
        solution, state = tip_trial.solution, found.state
        assert solution is not None
        assert state.partial_segment is not None
        ahead = tip_trial.phase in (TipPhase.CUTTING, TipPhase.RUPTURE)
        if ahead:
            cut_path.crack_front = solution.position.tip
        cut_path.store(state.friction_force, solution.slipped)
        self._keep(found)
        self.arc = tip_trial.arc
        full = solution.position.length >= (1.0 - 1e-9) * self.instrument.spacing
        if ahead and (full or tip_trial.segment_full):
            end, trial = state.partial_segment, solution.position.trial
            self.contact.append_segment(
                trial, 1, float(state.friction_force[-1]), end.offset, end.compliance
            )
            self.segments.append(end)
            cut_path.extend(float(solution.position.kinetic[-1]))
        return self.state

    def release(self, names: Sequence[str]) -> State:
        """Release seeds at the tip; return the state with their positions."""
        position = self.instrument.axis.tip_position(self.state.depth)
        for name in names:
            self.event_log.release(name, self.state, position)
        seeds = self.event_log.seed_positions(self._field)
        self.state = dataclasses.replace(self.state, seeds=seeds)
        return self.state

    def puncture(self, trial: ContactTrial, count: int) -> None:
        """Cut the skin: the entry point becomes the first segment of the path, without friction.

        Parameters
        ----------
        trial : ContactTrial
            Tip kernel at the entry point.
        count : int
            Number of lateral directions.
        """
        self.contact.append_segment(trial, 0, 0.0, np.zeros(count), 0.0)
        self.segments.append(self.contact.segments[-1])

    def _keep(self, found: StepResult) -> State:
        old, state = self.state, found.state
        if self.event_log.seeds:
            state = dataclasses.replace(state, seeds=self.event_log.seed_positions(found.field))
        self.energy_balance.add(found.spent)
        self.spent = (found.spent.friction, found.spent.tip)
        self.state, self._field = state, found.field
        self.count += 1
        self.evaluations += sum(equations.evaluations for equations in self._solved)
        self._solved.clear()
        self.tissue_response.finish(
            load(self.model, self.instrument.axis.frame, state, self.segments)
        )
        self.energy_balance.set_tissue(self.tissue_response.energies())
        self.event_log.record_deepest(state)
        self.event_log.record_transitions(old, state, self.spent)
        return state
