"""What was found of a step becomes a state, with all forces recovered."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from needlefem._arrays import Floats, Vector
from needlefem.contact.condensed_contact import CondensedContact
from needlefem.contact.friction import SlipWeakeningFriction, refuse_noise
from needlefem.contact.functionals import ContactSegment, ContactTrial
from needlefem.fem.interpolation import LinearFunctionals
from needlefem.insertion.cut_path import CutPath
from needlefem.insertion.state import State, TipPhase
from needlefem.insertion.step_equations import StepSolution
from needlefem.insertion.stepfield import ContactField
from needlefem.insertion.tip_phase import TipTrial

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
    contact: CondensedContact, track: CutPath, moment: TipTrial, time: float
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
    whole, trial, pull = position.whole, position.trial, solution.forces[:-1]
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
        jumping=moment.way is TipPhase.RUPTURE,
        time=time,
        inserted_length=moment.arc,
        partial_segment=_end(track, solution),
        slipping=np.sign(solution.slip).astype(int),
        tip_phase=moment.way,
        tip_displacement=float(moved[whole, 0]),
    )
    path = np.column_stack([pull[:whole], lateral]).ravel()
    return state, ContactField(contact, path, trial, forces)


def _end(track: CutPath, solution: StepSolution) -> ContactSegment:
    """Return the piece that the tip is in."""
    position, instrument = solution.position, track.instrument
    last = track.vertices[position.whole - 1]
    row = position.trial.weights.rows[1]
    used = np.flatnonzero(row)
    length = max(position.length, THIN * instrument.spacing)
    return ContactSegment(
        position.trial.weights.nodes[used],
        row[used],
        instrument.axis.lateral_offset(0.5 * (position.tip + last)),
        1.0 / (instrument.lateral_stiffness * length),
    )


def extend(contact: CondensedContact, pieces: Sequence[ContactSegment]) -> None:
    """Give a contact the pieces of a path that it lacks."""
    contact.set_active(len(contact.pieces))
    for piece in pieces[len(contact.pieces) :]:
        trial = contact.trial(LinearFunctionals(piece.nodes, piece.weights[None]))
        contact.append_segment(trial, 0, 0.0, piece.offset, piece.compliance)


def check_stick_resolution(
    contact: CondensedContact, track: CutPath, friction: SlipWeakeningFriction
) -> None:
    """Raise a `SimulationError` where the tissue can't tell the path's pieces apart that stick."""
    count = len(contact.pieces)
    if count:
        contact.set_active(count)
        lengths = np.diff(track.arcs[:count])
        compliance = contact.sliding().compliance[1:, 1:]  # the entry point has no friction
        refuse_noise(compliance, friction.slack(lengths))
