"""What was found of a step becomes a state, with all forces recovered."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from needlefem._arrays import Floats
from needlefem.contact.condensed_contact import Contact
from needlefem.contact.friction import Friction, refuse_noise
from needlefem.contact.functionals import Piece, Trial
from needlefem.fem.interpolation import Weights
from needlefem.insertion.cut_path import Track
from needlefem.insertion.state import State, Way
from needlefem.insertion.step_equations import Solution
from needlefem.insertion.stepfield import StepField
from needlefem.insertion.tip_phase import Moment

THIN = 1e-9
"""Length of a piece, relative to the spacing, below which its hold is taken to be of this."""


def free_state(track: Track, tip_at_entry: Weights, time: float, depth: float) -> State:
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
        axial=np.zeros(0),
        lateral=np.zeros((0, dim - 1)),
        moved=np.zeros((0, dim)),
        time=time,
        slipping=np.zeros(0, dtype=int),
        way=Way.OUT,
    )


def pressing_state(track: Track, trial: Trial, forces: Floats, time: float, depth: float) -> State:
    """Return the state of a tip that holds the entry point of uncut skin.

    Parameters
    ----------
    track : Track
    trial : Trial
        Of the tip's kernel at the entry.
    forces : array, shape (dim,), N (N/m in 2D)
        Of the tip.
    time : float, s
    depth : float, m
    """
    return dataclasses.replace(
        free_state(track, trial.weights, time, depth),
        tip_force=float(forces[0]),
        tip_lateral=forces[1:],
        way=Way.PRESSING,
        tip_moved=float(trial.displacement[0] + trial.bare[0] @ forces),
    )


def settled(contact: Contact, track: Track, moment: Moment, time: float) -> tuple[State, StepField]:
    """Return the state at a moment, and its field.

    Parameters
    ----------
    contact : Contact
        Covers afterwards what the needle lies in, with the friction found.
    track : Track
    moment : Moment
        With a solution.
    time : float, s
    """
    solution = moment.solution
    assert solution is not None
    position, dim = solution.position, contact.dim
    whole, trial, pull = position.whole, position.trial, solution.forces[:-1]
    contact.load(pull[:whole])
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
        axial=pull,
        lateral=np.vstack([lateral, forces[dim + 1 :]]),
        moved=np.delete(moved, whole, axis=0),
        jumping=moment.way is Way.JUMPING,
        time=time,
        covered=moment.arc,
        end=_end(track, solution),
        slipping=np.sign(solution.slip).astype(int),
        way=moment.way,
        tip_moved=float(moved[whole, 0]),
    )
    path = np.column_stack([pull[:whole], lateral]).ravel()
    return state, StepField(contact, path, trial, forces)


def _end(track: Track, solution: Solution) -> Piece:
    """Return the piece that the tip is in."""
    position, instrument = solution.position, track.instrument
    last = track.vertices[position.whole - 1]
    row = position.trial.weights.rows[1]
    used = np.flatnonzero(row)
    length = max(position.length, THIN * instrument.spacing)
    return Piece(
        position.trial.weights.nodes[used],
        row[used],
        instrument.axis.offset(0.5 * (position.tip + last)),
        1.0 / (instrument.lateral_stiffness * length),
    )


def extend(contact: Contact, pieces: Sequence[Piece]) -> None:
    """Give a contact the pieces of a path that it lacks."""
    contact.cover(len(contact.pieces))
    for piece in pieces[len(contact.pieces) :]:
        trial = contact.try_functionals(Weights(piece.nodes, piece.weights[None]))
        contact.adopt(trial, 0, 0.0, piece.offset, piece.compliance)


def tell_apart(contact: Contact, track: Track, friction: Friction) -> None:
    """Raise a `SimulationError` where the tissue can't tell the path's pieces apart that stick."""
    count = len(contact.pieces)
    if count:
        contact.cover(count)
        lengths = np.diff(track.arcs[:count])
        compliance = contact.sliding().compliance[1:, 1:]  # the entry point has no friction
        refuse_noise(compliance, friction.slack(lengths))
