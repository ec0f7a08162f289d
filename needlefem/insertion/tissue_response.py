"""Tissue as a needle stepped in time meets it: an operator, and the motion without the needle."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from needlefem._arrays import Floats, Vector
from needlefem.contact.functionals import Piece
from needlefem.fem.compliance import DirectResponses, Responses, SharedResponses
from needlefem.fem.condensation import Corridor, CorridorColumns
from needlefem.fem.factorization import Factor
from needlefem.fem.tissue_model import Model

MOST_SHARED_UNKNOWNS = 10_000
"""Above, a column for every node that a needle touches costs more than condensing its corridor."""
MOST_CORRIDOR_UNKNOWNS = 12_000
"""Above, the compliance between all nodes of a corridor would be too large a matrix."""


def responses_of(
    model: Model, factor: Factor | None = None, corridor: Corridor | None = None
) -> Responses:
    """Return the responses of a tissue's stiffness, or of a step's factorised operator.

    Parameters
    ----------
    model : Model
    factor : Factor, optional
        Of the step's operator; that of K when left out.
    corridor : Corridor, optional
        Where needles are expected.
    """
    if len(model.free_dofs) <= MOST_SHARED_UNKNOWNS:
        return SharedResponses(model, factor, corridor=corridor)
    if corridor is not None and factor is None and model.element.definite:
        columns = CorridorColumns(model, corridor)
        if np.count_nonzero(columns.inner()) <= MOST_CORRIDOR_UNKNOWNS:
            return SharedResponses(model, columns=columns, corridor=corridor)
    return DirectResponses(model, factor)


class Medium(Protocol):
    """A tissue in time.

    Attributes
    ----------
    responses : Responses
        Of the operator of the step that has begun.
    background : array, shape (nnodes, dim), m, or None
        Displacement at its end without the needle; None: none.
    timeless : bool
        Whether a step may be of any duration, and cut short where something happens.
    inertial : bool
        Whether velocity persists.
    """

    responses: Responses
    background: Floats | None
    timeless: bool
    inertial: bool

    def begin(self, duration: float) -> None:
        """Prepare a step."""
        ...

    def swing(self, pieces: Sequence[Piece], direction: Vector) -> Floats | None:
        """Return how pieces of a needle in a direction swing, see `Contact`; None: no inertia."""
        ...

    def finish(self, load: Floats) -> None:
        """End the step under the needle's forces, shape (ndofs,), N.

        Forces that change at the step's end (the tip runs ahead) are given one after the other.
        """
        ...

    def energies(self) -> dict[str, float]:
        """Return energies by their name in the ledger that the needle can't know, J (J/m in 2D)."""
        ...


class ElasticMedium:
    """Equilibrium at every time, without a memory; see `Medium`."""

    timeless, inertial = True, False
    background: Floats | None = None

    def __init__(self, responses: Responses) -> None:
        self.responses = responses

    def begin(self, duration: float) -> None:
        """See `Medium`: there is nothing to prepare."""

    def swing(self, pieces: Sequence[Piece], direction: Vector) -> None:
        """See `Medium`."""

    def finish(self, load: Floats) -> None:
        """See `Medium`: there is nothing to remember."""

    def energies(self) -> dict[str, float]:
        """See `Medium`."""
        return {}
