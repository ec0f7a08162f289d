"""The tissue's full displacement in states of an insertion, recovered when asked for."""

from collections.abc import Sequence

import numpy as np

from needlefem.arrays import Floats, Ints
from needlefem.insertion.result import Insertion


def loads(insertion: Insertion, states: Sequence[int]) -> Floats:
    """Return the needle's forces on the tissue in some states, shape (ndofs, nstates), N (N/m)."""
    model, frame = insertion.model, insertion.axis.frame
    found = np.zeros((model.ndofs, len(states)))
    for column, number in enumerate(states):
        state = insertion.states[number]
        force = np.concatenate([[state.tip_force], state.tip_lateral]) @ frame
        _add(found[:, column], model.node_dofs[state.tip_nodes], state.tip_weights, force)
        forces = np.column_stack([state.axial, state.lateral]) @ frame
        for piece, on_piece in zip(insertion.pieces, forces, strict=False):
            _add(found[:, column], model.node_dofs[piece.nodes], piece.weights, on_piece)
    return found


def _add(target: Floats, dofs: Ints, weights: Floats, force: Floats) -> None:
    target[dofs] += weights[:, None] * force  # a functional has every node once


def displacements(insertion: Insertion, states: Sequence[int]) -> Floats:
    """Return the displacement of all dofs in some states, shape (ndofs, nstates), m."""
    return insertion.model.solve(loads(insertion, states))
