"""The tissue's full displacement in states of an insertion, recovered when asked for."""

from collections.abc import Sequence

import numpy as np

from needlefem.arrays import Floats, Ints
from needlefem.fem.model import Model
from needlefem.insertion.result import Insertion
from needlefem.insertion.state import State
from needlefem.needle.functionals import Piece


def loads(insertion: Insertion, states: Sequence[int]) -> Floats:
    """Return the needle's forces on the tissue in some states, shape (ndofs, nstates), N (N/m)."""
    model, frame = insertion.model, insertion.axis.frame
    found = [load(model, frame, insertion.states[n], insertion.pieces) for n in states]
    return np.column_stack(found)


def load(model: Model, frame: Floats, state: State, pieces: Sequence[Piece]) -> Floats:
    """Return the needle's forces on the tissue in a state, shape (ndofs,), N (N/m in 2D).

    Parameters
    ----------
    model : Model
    frame : array, shape (dim, dim)
        The needle's.
    state : State
    pieces : sequence of Piece
        Of the whole path.
    """
    found = np.zeros(model.ndofs)
    force = np.concatenate([[state.tip_force], state.tip_lateral]) @ frame
    _add(found, model.node_dofs[state.tip_nodes], state.tip_weights, force)
    forces = np.column_stack([state.axial, state.lateral]) @ frame
    for piece, on_piece in zip(state.filled(pieces), forces, strict=True):
        _add(found, model.node_dofs[piece.nodes], piece.weights, on_piece)
    return found


def _add(target: Floats, dofs: Ints, weights: Floats, force: Floats) -> None:
    target[dofs] += weights[:, None] * force  # a functional has every node once


def displacements(insertion: Insertion, states: Sequence[int]) -> Floats:
    """Return the displacement of all dofs in some states, shape (ndofs, nstates), m."""
    return insertion.model.solve(loads(insertion, states))
