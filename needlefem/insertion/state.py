"""States of an insertion, and the displacement field of the tissue in a state."""

import dataclasses
from collections.abc import Sequence
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from needlefem._arrays import Floats, Ints, Points, Vector
from needlefem.contact.condensed_contact import CondensedContact, ContactSegment, ContactTrial
from needlefem.errors import SimulationError
from needlefem.fem.interpolation import LinearFunctionals
from needlefem.fem.tissue_model import TissueModel
from needlefem.insertion.cut_path import CutPath
from needlefem.scene.discretization import DYNAMIC

if TYPE_CHECKING:
    from needlefem.insertion.result import Insertion
    from needlefem.insertion.step_equations import StepSolution
    from needlefem.insertion.tip_phase import TipTrial


class TipPhase(StrEnum):
    """What the tip does in a state.

    `LOADING`: the tip loads the crack front with less than the cutting force. `CUTTING`: the tip
    extends the cut path. `RUPTURE`: the tip advances at a fixed depth. `RETRACTED`: the tip is
    behind the crack front on its path. `OUTSIDE`: the needle is not in the tissue.
    """

    LOADING = "loading"
    CUTTING = "cutting"
    RUPTURE = "rupture"
    RETRACTED = "retracted"
    OUTSIDE = "outside"


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class State:
    """Equilibrium of needle and tissue at one depth, or a point of an advance at fixed depth.

    The contact segments of a state are those of the inserted part of the cut path, from the entry
    to the tip; their number is nsegments.

    Parameters
    ----------
    depth : float, m
        Distance of the tip from the undeformed skin along the axis, s.
    tip : array, shape (dim,), m
        Material point at the tip.
    tip_force : float, N (N/m in 2D)
        Axial force of the tip on the tissue, R.
    cutting_force : float, N (N/m in 2D)
        Axial force at which the tip cuts at this material point.
    tip_lateral : array, shape (dim - 1,), N (N/m in 2D)
        Lateral force of the tip. It is zero unless the tip loads the uncut skin.
    tip_nodes, tip_weights : arrays, shape (k,)
        The mean displacement over the tip kernel is ``tip_weights @ u[tip_nodes]``.
    friction_force : array, shape (nsegments,), N (N/m in 2D)
        Friction force of the shaft on each contact segment.
    lateral_force : array, shape (nsegments, dim - 1), N (N/m in 2D)
        Lateral force of the shaft on each contact segment.
    segment_displacement : array, shape (nsegments, dim), m
        Mean displacement of each contact segment in the needle's frame.
    time : float, s
        Time since the first contact with the skin.
    inserted_length : float, m
        Length of the part of the cut path in which the needle is.
    partial_segment : ContactSegment, optional
        The last contact segment, if the needle fills only a part of it.
    slipping : array, shape (nsegments,)
        1: the needle slips forward relative to the segment, -1: backward, 0: the segment sticks.
    tip_phase : TipPhase
    tip_displacement : float, m
        Mean axial displacement over the tip kernel.
    displacement : array, shape (ndofs,), m, optional
        Displacement of the tissue, if the state was to hold it (`SaveAt`).
    seeds : array, shape (nseeds, dim), m
        Present positions in space of all seeds that were released before.
    """

    depth: float
    tip: Vector
    tip_force: float
    cutting_force: float
    tip_lateral: Floats
    tip_nodes: Ints
    tip_weights: Floats
    friction_force: Floats
    lateral_force: Floats
    segment_displacement: Floats
    time: float = 0.0
    inserted_length: float = 0.0
    partial_segment: ContactSegment | None = None
    slipping: Ints | None = None
    tip_phase: TipPhase = TipPhase.CUTTING
    tip_displacement: float = 0.0
    displacement: Floats | None = None
    seeds: Points = dataclasses.field(default_factory=lambda: np.zeros((0, 2)))

    @property
    def full_segments(self) -> int:
        """Number of contact segments that the needle fills completely."""
        return len(self.friction_force) - (self.partial_segment is not None)

    def filled(self, segments: Sequence[ContactSegment]) -> tuple[ContactSegment, ...]:
        """Return the contact segments of this state, given those of the whole cut path."""
        full = tuple(segments[: self.full_segments])
        return full if self.partial_segment is None else (*full, self.partial_segment)

    @property
    def force(self) -> float:
        """Axial force on the needle, N (N/m in 2D)."""
        return self.tip_force + float(np.sum(self.friction_force))


# Displacement fields of a state, evaluated only for the functionals that are needed.


class ZeroField:
    """The displacement field of undeformed tissue; see `Field`."""

    def __init__(self, dim: int) -> None:
        self._dim = dim

    def means(self, weights: LinearFunctionals) -> Floats:
        """See `Field`."""
        return np.zeros((len(weights.rows), self._dim))


class ContactField:
    """The displacement field under the needle forces of one state; see `Field`.

    Parameters
    ----------
    contact : CondensedContact
    path : array, shape (n,), N (N/m in 2D)
        Forces on the first contact segments in the needle's frame, all components of a segment
        next to each other.
    trial : ContactTrial, optional
        Further functionals on which forces act: tip kernel and partial segment.
    forces : array, shape (rows,), N (N/m in 2D)
        Forces on these functionals.
    """

    def __init__(
        self, contact: CondensedContact, path: Floats, trial: ContactTrial | None, forces: Floats
    ) -> None:
        self._contact, self._path, self._trial, self._forces = contact, path, trial, forces
        self._free_displacement = contact.free_displacement

    def means(self, weights: LinearFunctionals) -> Floats:
        """See `Field`."""
        nodal = self._contact.field_at(weights.nodes, self._path, self._trial, self._forces)
        if self._free_displacement is not None:
            nodal = nodal + self._free_displacement[weights.nodes]
        found: Floats = weights.rows @ nodal @ self._contact.frame.T
        return found


# Displacement of all degrees of freedom in states of an insertion.


def loads(insertion: "Insertion", states: Sequence[int]) -> Floats:
    """Return the needle forces on all dofs in some states, shape (ndofs, n), N (N/m in 2D)."""
    model, frame, segments = insertion.model, insertion.axis.frame, insertion.segments
    found = np.zeros((model.ndofs, len(states)))
    forces = np.zeros((len(segments), model.dim, len(states)))
    for column, number in enumerate(states):
        state = insertion.states[number]
        on_pieces = np.column_stack([state.friction_force, state.lateral_force]) @ frame
        forces[: state.full_segments, :, column] = on_pieces[: state.full_segments]
        _add_tip(found[:, column], model, frame, state)
        if state.partial_segment is not None:
            _add(
                found[:, column],
                model.node_dofs[state.partial_segment.nodes],
                state.partial_segment.weights,
                on_pieces[-1],
            )
    if segments:
        touched, means = means_of(segments)
        spread = means.T @ forces.reshape(len(segments), -1)
        found[model.node_dofs[touched]] += spread.reshape(len(touched), model.dim, -1)
    return found


def means_of(segments: Sequence[ContactSegment]) -> tuple[Ints, Floats]:
    """Return the mean displacement over contact segments as linear functionals.

    Returns
    -------
    Numbers of the nodes with a weight, shape (n,), and the weights, shape (nsegments, n).
    """
    nodes, place = np.unique(np.concatenate([p.nodes for p in segments]), return_inverse=True)
    means = np.zeros((len(segments), len(nodes)))
    row = np.repeat(np.arange(len(segments)), [len(p.nodes) for p in segments])
    means[row, place] = np.concatenate([p.weights for p in segments])
    return nodes, means


def load(
    model: TissueModel, frame: Floats, state: State, segments: Sequence[ContactSegment]
) -> Floats:
    """Return the load vector of the needle forces in a state, shape (ndofs,), N (N/m in 2D).

    Parameters
    ----------
    model : TissueModel
    frame : array, shape (dim, dim)
        The needle's frame; its rows are the axial and the lateral directions.
    state : State
    segments : sequence of ContactSegment
        Contact segments of the whole cut path.
    """
    found = np.zeros(model.ndofs)
    _add_tip(found, model, frame, state)
    forces = np.column_stack([state.friction_force, state.lateral_force]) @ frame
    for segment, on_piece in zip(state.filled(segments), forces, strict=True):
        _add(found, model.node_dofs[segment.nodes], segment.weights, on_piece)
    return found


def _add_tip(target: Floats, model: TissueModel, frame: Floats, state: State) -> None:
    force = np.concatenate([[state.tip_force], state.tip_lateral]) @ frame
    _add(target, model.node_dofs[state.tip_nodes], state.tip_weights, force)


def _add(target: Floats, dofs: Ints, weights: Floats, force: Floats) -> None:
    target[dofs] += weights[:, None] * force  # each node occurs once in a functional


def depends_on_time(insertion: "Insertion") -> bool:
    """Say whether the displacement in a state depends on the states before it."""
    has_inertia = insertion.scene.discretization.integrator in DYNAMIC
    return has_inertia or bool(insertion.model.branches)


def displacements(insertion: "Insertion", states: Sequence[int]) -> Floats:
    """Return the displacement of all degrees of freedom in some states, shape (ndofs, nstates), m.

    States that hold their displacement are read (`SaveAt`). That of other states is computed in
    elastic tissue: it is in equilibrium with the forces of the state.

    Raises
    ------
    SimulationError
        A state of tissue that depends on time does not hold its displacement.
    """
    kept = [insertion.states[number].displacement for number in states]
    missing = [n for n, (_, field) in enumerate(zip(states, kept, strict=True)) if field is None]
    if not missing:
        return np.column_stack([field for field in kept if field is not None])
    if depends_on_time(insertion):
        raise SimulationError(
            f"state {states[missing[0]]} does not hold the displacement, which depends on all "
            "states before it; simulate with save=SaveAt(fields=True)"
        )
    found = np.empty((insertion.model.ndofs, len(kept)))
    found[:, missing] = insertion.model.solve(loads(insertion, [states[n] for n in missing]))
    for column, field in enumerate(kept):
        if field is not None:
            found[:, column] = field
    return found


# Construction of a state from the solution of a step.


THIN = 1e-9
"""Smallest length of a segment, relative to the path spacing, in its lateral compliance."""


def state_at_entry(
    entry: Vector, weights: LinearFunctionals, limit: float, lateral: Floats
) -> State:
    """Return the state in which the tip loads the entry point with the cutting force.

    Parameters
    ----------
    entry : array, shape (dim,), m
    weights : LinearFunctionals
        Tip kernel at the entry point.
    limit : float, N (N/m in 2D)
        Cutting force.
    lateral : array, shape (dim - 1,)
        Lateral force of the tip over its axial force.
    """
    none = np.zeros((0, len(lateral)))
    return State(
        depth=0.0,
        tip=entry,
        tip_force=limit,
        cutting_force=limit,
        tip_lateral=limit * lateral,
        tip_nodes=weights.nodes,
        tip_weights=weights.rows[0],
        friction_force=np.zeros(0),
        lateral_force=none,
        segment_displacement=np.zeros((0, len(lateral) + 1)),
    )


def outside_state(
    cut_path: CutPath, tip_at_entry: LinearFunctionals, time: float, depth: float
) -> State:
    """Return the state of a needle that is not in contact with the tissue."""
    instrument = cut_path.instrument
    dim = len(instrument.axis.frame)
    return State(
        depth=depth,
        tip=instrument.axis.entry,
        tip_force=0.0,
        cutting_force=instrument.cutting_force_at(tip_at_entry),
        tip_lateral=np.zeros(dim - 1),
        tip_nodes=tip_at_entry.nodes,
        tip_weights=tip_at_entry.rows[0],
        friction_force=np.zeros(0),
        lateral_force=np.zeros((0, dim - 1)),
        segment_displacement=np.zeros((0, dim)),
        time=time,
        slipping=np.zeros(0, dtype=int),
        tip_phase=TipPhase.OUTSIDE,
    )


def loading_state(
    cut_path: CutPath, trial: ContactTrial, forces: Floats, time: float, depth: float
) -> State:
    """Return the state of a tip that loads the entry point of uncut skin.

    Parameters
    ----------
    cut_path : CutPath
    trial : ContactTrial
        Tip kernel at the entry point.
    forces : array, shape (dim,), N (N/m in 2D)
        Forces of the tip in the needle's frame.
    time : float, s
    depth : float, m
    """
    return dataclasses.replace(
        outside_state(cut_path, trial.weights, time, depth),
        tip_force=float(forces[0]),
        tip_lateral=forces[1:],
        tip_phase=TipPhase.LOADING,
        tip_displacement=float(trial.displacement[0] + trial.bare[0] @ forces),
    )


def state_from_trial(
    contact: CondensedContact, cut_path: CutPath, tip_trial: "TipTrial", time: float
) -> tuple[State, ContactField]:
    """Return the state that belongs to the solution of a step, and its displacement field.

    Parameters
    ----------
    contact : CondensedContact
        Its active segments and friction forces are afterwards those of the state.
    cut_path : CutPath
    tip_trial : TipTrial
        Must have a solution.
    time : float, s
    """
    solution = tip_trial.solution
    assert solution is not None
    position, dim = solution.position, contact.dim
    full, trial, friction = position.full_segments, position.trial, solution.forces[:-1]
    contact.set_friction(friction[:full])
    forces = np.zeros(2 * dim)
    forces[0], forces[dim] = solution.tip_force, friction[full]
    forces[dim + 1 :] = solution.lateral
    lateral = contact.lateral_forces(trial, forces)
    displacement = contact.displacements(lateral, trial, forces)
    state = State(
        depth=tip_trial.depth,
        tip=position.tip,
        tip_force=solution.tip_force,
        cutting_force=position.cutting_force,
        tip_lateral=np.zeros(dim - 1),
        tip_nodes=trial.weights.nodes,
        tip_weights=trial.weights.rows[0],
        friction_force=friction,
        lateral_force=np.vstack([lateral, forces[dim + 1 :]]),
        segment_displacement=np.delete(displacement, full, axis=0),
        time=time,
        inserted_length=tip_trial.arc,
        partial_segment=_end(cut_path, solution),
        slipping=np.sign(solution.slip).astype(int),
        tip_phase=tip_trial.phase,
        tip_displacement=float(displacement[full, 0]),
    )
    path = np.column_stack([friction[:full], lateral]).ravel()
    return state, ContactField(contact, path, trial, forces)


def _end(cut_path: CutPath, solution: "StepSolution") -> ContactSegment:
    """Return the contact segment in which the tip is, as far as the needle fills it."""
    position, instrument = solution.position, cut_path.instrument
    last = cut_path.vertices[position.full_segments - 1]
    row = position.trial.weights.rows[1]
    used = np.flatnonzero(row)
    length = max(position.length, THIN * instrument.spacing)
    return ContactSegment(
        position.trial.weights.nodes[used],
        row[used],
        instrument.axis.lateral_offset(0.5 * (position.tip + last)),
        1.0 / (instrument.lateral_penalty * length),
    )


def extend(contact: CondensedContact, segments: Sequence[ContactSegment]) -> None:
    """Append to a contact the segments of a path that it does not have yet."""
    contact.set_active(len(contact.segments))
    for segment in segments[len(contact.segments) :]:
        trial = contact.trial(LinearFunctionals(segment.nodes, segment.weights[None]))
        contact.append_segment(trial, 0, 0.0, segment.offset, segment.compliance)
