"""Tissue as a needle stepped in time meets it: an operator, and the motion without the needle."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from needlefem._arrays import Floats, Vector
from needlefem.contact.functionals import ContactSegment
from needlefem.fem.compliance import CachedCompliance, ComplianceOperator, DirectCompliance
from needlefem.fem.condensation import CondensedCorridor, Corridor
from needlefem.fem.factorization import Factor
from needlefem.fem.tissue_model import TissueModel

MOST_SHARED_UNKNOWNS = 10_000
"""Above, a column for every node that a needle touches costs more than condensing its corridor."""
MOST_CORRIDOR_UNKNOWNS = 12_000
"""Above, the compliance between all nodes of a corridor would be too large a matrix."""


def responses_of(
    model: TissueModel, factor: Factor | None = None, corridor: Corridor | None = None
) -> ComplianceOperator:
    """Return the responses of a tissue's stiffness, or of a step's factorised operator.

    Parameters
    ----------
    model : TissueModel
    factor : Factor, optional
        Of the step's operator; that of K when left out.
    corridor : Corridor, optional
        Where needles are expected.
    """
    if len(model.free_dofs) <= MOST_SHARED_UNKNOWNS:
        return CachedCompliance(model, factor, corridor=corridor)
    if corridor is not None and factor is None and model.element.definite:
        columns = CondensedCorridor(model, corridor)
        if np.count_nonzero(columns.inner()) <= MOST_CORRIDOR_UNKNOWNS:
            return CachedCompliance(model, columns=columns, corridor=corridor)
    return DirectCompliance(model, factor)


class TissueResponse(Protocol):
    """A tissue in time.

    Attributes
    ----------
    responses : ComplianceOperator
        Of the operator of the step that has begun.
    background : array, shape (nnodes, dim), m, or None
        Displacement at its end without the needle; None: none.
    timeless : bool
        Whether a step may be of any duration, and cut short where something happens.
    inertial : bool
        Whether velocity persists.
    """

    responses: ComplianceOperator
    background: Floats | None
    timeless: bool
    inertial: bool

    def begin(self, duration: float) -> None:
        """Prepare a step."""
        ...

    def swing(self, pieces: Sequence[ContactSegment], direction: Vector) -> Floats | None:
        """Return how pieces of a needle swing along a direction (`CondensedContact`), or None."""
        ...

    def finish(self, load: Floats) -> None:
        """End the step under the needle's forces, shape (ndofs,), N.

        Forces that change at the step's end (the tip runs ahead) are given one after the other.
        """
        ...

    def energies(self) -> dict[str, float]:
        """Return energies by their name in the ledger that the needle can't know, J (J/m in 2D)."""
        ...


class ElasticResponse:
    """Equilibrium at every time, without a memory; see `TissueResponse`."""

    timeless, inertial = True, False
    background: Floats | None = None

    def __init__(self, responses: ComplianceOperator) -> None:
        self.responses = responses

    def begin(self, duration: float) -> None:
        """See `TissueResponse`: there is nothing to prepare."""

    def swing(self, pieces: Sequence[ContactSegment], direction: Vector) -> None:
        """See `TissueResponse`."""

    def finish(self, load: Floats) -> None:
        """See `TissueResponse`: there is nothing to remember."""

    def energies(self) -> dict[str, float]:
        """See `TissueResponse`."""
        return {}
