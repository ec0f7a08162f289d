"""The tissue's full displacement in states of an insertion, recovered when asked for."""

from collections.abc import Sequence

import numpy as np

from needlefem._arrays import Floats, Ints
from needlefem.contact.functionals import ContactSegment
from needlefem.fem.tissue_model import TissueModel
from needlefem.insertion.result import Insertion
from needlefem.insertion.state import State
from needlefem.scene.discretization import DYNAMIC


def loads(insertion: Insertion, states: Sequence[int]) -> Floats:
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


def depends_on_time(insertion: Insertion) -> bool:
    """Say whether a state's displacement is more than what its forces do at rest."""
    inertial = insertion.scene.discretisation.integrator in DYNAMIC
    return inertial or bool(insertion.model.branches)


def displacements(insertion: Insertion, states: Sequence[int]) -> Floats:
    """Return the displacement of all dofs in some states, shape (ndofs, nstates), m.

    Elastic tissue is in equilibrium with a state's forces. Where it depends on time, all that
    happened before is gone through again (`replay.py`).
    """
    if depends_on_time(insertion):
        from needlefem.insertion.replay import gone_through  # noqa: PLC0415 (needs dynamics)

        return gone_through(insertion, np.asarray(states))
    return insertion.model.solve(loads(insertion, states))
