"""The state of needle and tissue at one moment, and the displacement that belongs to it."""

import dataclasses
from collections.abc import Sequence
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from needlefem._arrays import Floats, Ints, Points, Vector
from needlefem.contact.condensed_contact import CondensedContact, ContactSegment, ContactTrial
from needlefem.fem.interpolation import LinearFunctionals
from needlefem.fem.tissue_model import TissueModel
from needlefem.insertion.cut_path import CutPath
from needlefem.scene.discretization import DYNAMIC

if TYPE_CHECKING:
    from needlefem.insertion.result import Insertion
    from needlefem.insertion.step_equations import StepSolution
    from needlefem.insertion.tip_phase import TipTrial


class TipPhase(StrEnum):
    """What the tip does."""

    LOADING = "loading"
    CUTTING = "cutting"
    RUPTURE = "rupture"
    RETRACTED = "retracted"
    OUTSIDE = "outside"


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class State:
    """Needle and tissue in equilibrium at one depth, or with its tip in an advance at fixed depth.

    Pieces are those of the path that the needle lies in, from the entry on.

    Parameters
    ----------
    depth : float, m
        Travel of the tip from the undeformed skin, s.
    tip : array, shape (dim,), m
        Material point at the tip.
    tip_force : float, N (N/m in 2D)
        Axial force of the tip on the tissue, R.
    cutting_force : float, N (N/m in 2D)
        What the tip would cut at there.
    tip_lateral : array, shape (dim - 1,), N (N/m in 2D)
        Lateral force of the tip, which only a tip that holds its point has.
    tip_nodes, tip_weights : arrays, shape (k,)
        The kernel's mean displacement is ``tip_weights @ u[tip_nodes]``.
    friction_force : array, shape (npieces,), N (N/m in 2D)
        Friction force of the shaft on every piece of the path.
    lateral_force : array, shape (npieces, dim - 1), N (N/m in 2D)
        Lateral force of the shaft on every piece.
    segment_displacement : array, shape (npieces, dim), m
        Mean displacement of the pieces, in the needle's frame.
    time : float, s
        From the first touch on.
    inserted_length : float, m
        Length of the cut path that the needle lies in.
    partial_segment : ContactSegment, optional
        The piece that the tip is in, which the needle fills in part: the last of the pieces.
    slipping : array, shape (npieces,)
        1: the needle slips forward in the piece, -1: backward, 0: they stick.
    tip_phase : TipPhase
        What the tip does: it presses on the crack front, cuts, or is drawn back on its path.
    tip_displacement : float, m
        Axial mean displacement over the tip's kernel.
    seeds : array, shape (nseeds, dim), m
        Where everything released so far is in the world.
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
    seeds: Points = dataclasses.field(default_factory=lambda: np.zeros((0, 2)))

    @property
    def full_segments(self) -> int:
        """Number of pieces that the needle fills."""
        return len(self.friction_force) - (self.partial_segment is not None)

    def filled(self, pieces: Sequence[ContactSegment]) -> tuple[ContactSegment, ...]:
        """Return the pieces that the needle lies in, of those of the whole path."""
        whole = tuple(pieces[: self.full_segments])
        return whole if self.partial_segment is None else (*whole, self.partial_segment)

    @property
    def force(self) -> float:
        """Axial force on the needle, N (N/m in 2D)."""
        return self.tip_force + float(np.sum(self.friction_force))


# Displacement of the tissue at one moment, evaluated where it is needed.


class ZeroField:
    """No displacement; see `Field`."""

    def __init__(self, dim: int) -> None:
        self._dim = dim

    def means(self, weights: LinearFunctionals) -> Floats:
        """See `Field`."""
        return np.zeros((len(weights.rows), self._dim))


class ContactField:
    """Displacement under the needle's forces of one moment; see `Field`.

    Parameters
    ----------
    contact : CondensedContact
    path : array, shape (n,), N (N/m in 2D)
        Forces on the first pieces, needle's frame, piece-major.
    trial : ContactTrial, optional
        Functionals on which there are forces as well.
    forces : array, shape (rows,), N (N/m in 2D)
        Forces on them.
    """

    def __init__(
        self, contact: CondensedContact, path: Floats, trial: ContactTrial | None, forces: Floats
    ) -> None:
        self._contact, self._path, self._trial, self._forces = contact, path, trial, forces
        self._background = contact.background

    def means(self, weights: LinearFunctionals) -> Floats:
        """See `Field`."""
        moved = self._contact.field_at(weights.nodes, self._path, self._trial, self._forces)
        if self._background is not None:
            moved = moved + self._background[weights.nodes]
        found: Floats = weights.rows @ moved @ self._contact.frame.T
        return found


# Displacement of the whole tissue in states of an insertion.


def loads(insertion: "Insertion", states: Sequence[int]) -> Floats:
    """Return the needle's forces on the tissue in some states, shape (ndofs, nstates), N (N/m)."""
    model, frame, pieces = insertion.model, insertion.axis.frame, insertion.pieces
    found = np.zeros((model.ndofs, len(states)))
    forces = np.zeros((len(pieces), model.dim, len(states)))
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
    if pieces:
        touched, means = means_of(pieces)
        spread = means.T @ forces.reshape(len(pieces), -1)
        found[model.node_dofs[touched]] += spread.reshape(len(touched), model.dim, -1)
    return found


def means_of(pieces: Sequence[ContactSegment]) -> tuple[Ints, Floats]:
    """Return the nodes that pieces touch, and their weights there, shape (npieces, nodes)."""
    nodes, place = np.unique(np.concatenate([p.nodes for p in pieces]), return_inverse=True)
    means = np.zeros((len(pieces), len(nodes)))
    row = np.repeat(np.arange(len(pieces)), [len(p.nodes) for p in pieces])
    means[row, place] = np.concatenate([p.weights for p in pieces])
    return nodes, means


def load(
    model: TissueModel, frame: Floats, state: State, pieces: Sequence[ContactSegment]
) -> Floats:
    """Return the needle's forces on the tissue in a state, shape (ndofs,), N (N/m in 2D).

    Parameters
    ----------
    model : TissueModel
    frame : array, shape (dim, dim)
        The needle's.
    state : State
    pieces : sequence of ContactSegment
        Of the whole path.
    """
    found = np.zeros(model.ndofs)
    _add_tip(found, model, frame, state)
    forces = np.column_stack([state.friction_force, state.lateral_force]) @ frame
    for piece, on_piece in zip(state.filled(pieces), forces, strict=True):
        _add(found, model.node_dofs[piece.nodes], piece.weights, on_piece)
    return found


def _add_tip(target: Floats, model: TissueModel, frame: Floats, state: State) -> None:
    force = np.concatenate([[state.tip_force], state.tip_lateral]) @ frame
    _add(target, model.node_dofs[state.tip_nodes], state.tip_weights, force)


def _add(target: Floats, dofs: Ints, weights: Floats, force: Floats) -> None:
    target[dofs] += weights[:, None] * force  # a functional has every node once


def depends_on_time(insertion: "Insertion") -> bool:
    """Say whether a state's displacement is more than what its forces do at rest."""
    inertial = insertion.scene.discretization.integrator in DYNAMIC
    return inertial or bool(insertion.model.branches)


def displacements(insertion: "Insertion", states: Sequence[int]) -> Floats:
    """Return the displacement of all dofs in some states, shape (ndofs, nstates), m.

    Elastic tissue is in equilibrium with a state's forces. Where it depends on time, all that
    happened before is gone through again (`replay.py`).
    """
    if depends_on_time(insertion):
        from needlefem.insertion.response_in_time import gone_through  # noqa: PLC0415 (needs dynamics)

        return gone_through(insertion, np.asarray(states))
    return insertion.model.solve(loads(insertion, states))


# States from the solution of a step, with all forces.


THIN = 1e-9
"""Length of a piece, relative to the spacing, below which its hold is taken to be of this."""


def state_at_entry(
    entry: Vector, weights: LinearFunctionals, limit: float, lateral: Floats
) -> State:
    """Return the state of a tip that presses on the entry point, about to cut."""
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
    track: CutPath, tip_at_entry: LinearFunctionals, time: float, depth: float
) -> State:
    """Return the state of a needle that touches nothing."""
    instrument = track.instrument
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
    track: CutPath, trial: ContactTrial, forces: Floats, time: float, depth: float
) -> State:
    """Return the state of a tip that holds the entry point of uncut skin.

    Parameters
    ----------
    track : CutPath
    trial : ContactTrial
        Of the tip's kernel at the entry.
    forces : array, shape (dim,), N (N/m in 2D)
        Of the tip.
    time : float, s
    depth : float, m
    """
    return dataclasses.replace(
        outside_state(track, trial.weights, time, depth),
        tip_force=float(forces[0]),
        tip_lateral=forces[1:],
        tip_phase=TipPhase.LOADING,
        tip_displacement=float(trial.displacement[0] + trial.bare[0] @ forces),
    )


def state_from_trial(
    contact: CondensedContact, track: CutPath, moment: "TipTrial", time: float
) -> tuple[State, ContactField]:
    """Return the state at a moment, and its field.

    Parameters
    ----------
    contact : CondensedContact
        Covers afterwards what the needle lies in, with the friction found.
    track : CutPath
    moment : TipTrial
        With a solution.
    time : float, s
    """
    solution = moment.solution
    assert solution is not None
    position, dim = solution.position, contact.dim
    whole, trial, pull = position.full_segments, position.trial, solution.forces[:-1]
    contact.set_friction(pull[:whole])
    forces = np.zeros(2 * dim)
    forces[0], forces[dim] = solution.tip_force, pull[whole]
    forces[dim + 1 :] = position.shaft.lateral(solution.forces)
    lateral = contact.lateral_forces(trial, forces)
    moved = contact.displacements(lateral, trial, forces)
    state = State(
        depth=moment.depth,
        tip=position.tip,
        tip_force=solution.tip_force,
        cutting_force=position.cutting_force,
        tip_lateral=np.zeros(dim - 1),
        tip_nodes=trial.weights.nodes,
        tip_weights=trial.weights.rows[0],
        friction_force=pull,
        lateral_force=np.vstack([lateral, forces[dim + 1 :]]),
        segment_displacement=np.delete(moved, whole, axis=0),
        time=time,
        inserted_length=moment.arc,
        partial_segment=_end(track, solution),
        slipping=np.sign(solution.slip).astype(int),
        tip_phase=moment.phase,
        tip_displacement=float(moved[whole, 0]),
    )
    path = np.column_stack([pull[:whole], lateral]).ravel()
    return state, ContactField(contact, path, trial, forces)


def _end(track: CutPath, solution: "StepSolution") -> ContactSegment:
    """Return the piece that the tip is in."""
    position, instrument = solution.position, track.instrument
    last = track.vertices[position.full_segments - 1]
    row = position.trial.weights.rows[1]
    used = np.flatnonzero(row)
    length = max(position.length, THIN * instrument.spacing)
    return ContactSegment(
        position.trial.weights.nodes[used],
        row[used],
        instrument.axis.lateral_offset(0.5 * (position.tip + last)),
        1.0 / (instrument.lateral_penalty * length),
    )


def extend(contact: CondensedContact, pieces: Sequence[ContactSegment]) -> None:
    """Give a contact the pieces of a path that it lacks."""
    contact.set_active(len(contact.pieces))
    for piece in pieces[len(contact.pieces) :]:
        trial = contact.trial(LinearFunctionals(piece.nodes, piece.weights[None]))
        contact.append_segment(trial, 0, 0.0, piece.offset, piece.compliance)
