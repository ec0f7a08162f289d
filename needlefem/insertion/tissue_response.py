"""Response of the tissue to needle forces in one step, and the choice of its method.

A response consists of the compliance of the operator of the step, and of the displacement of the
tissue at its end without needle forces.
"""

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np

from needlefem._arrays import Bools, Floats, Vector
from needlefem.contact.condensed_contact import ContactSegment
from needlefem.fem.compliance import (
    CachedCompliance,
    ComplianceOperator,
    CondensedCorridor,
    Corridor,
    DirectCompliance,
    coupled_equations,
)
from needlefem.fem.factorization import Factor
from needlefem.fem.tissue_model import TissueModel

MOST_SHARED_UNKNOWNS = 10_000
"""Unknowns up to which columns are taken wherever they cost at most `MARGIN` times single loads,
for the products that follow cost less with them."""
MARGIN = 2.0
MOST_CORRIDOR_UNKNOWNS = 12_000
"""Unknowns of a corridor above which the compliance between its nodes needs too much memory."""
TOUCHED = 0.5
"""Part of a corridor's unknowns that needles touch: 0.43 to 0.53 in four meshes."""
FIRST, NEXT = 16, 5
"""Loads for each segment of the path, of a first insertion and of one that starts from another's
solution: 16 to 20 and 4 to 7 in four meshes."""
EACH_STEP = 40
"""Loads of a time step: 35 to 45 in three scenes with stick-slip friction."""
DENSE = 1_000.0
"""Operations of a matrix product that take as long as a back-substitution takes for one unknown."""


class ExpectedLoads(NamedTuple):
    """Where needles are expected to load the tissue, and how often.

    Parameters
    ----------
    corridor : Corridor
    loads : int
        Their number; each is one right-hand side if it is solved for by itself.
    """

    corridor: Corridor
    loads: int

    @classmethod
    def of_path(cls, corridor: Corridor, segments: int, insertions: int) -> "ExpectedLoads":
        """Return the loads of insertions by path following, with so many segments each."""
        return cls(corridor, segments * (FIRST + NEXT * (insertions - 1)))

    @classmethod
    def of_steps(cls, corridor: Corridor, steps: int, insertions: int) -> "ExpectedLoads":
        """Return the loads of insertions by time stepping, with so many steps each."""
        return cls(corridor, EACH_STEP * steps * insertions)


def responses_of(
    model: TissueModel, factor: Factor | None = None, expected: ExpectedLoads | None = None
) -> ComplianceOperator:
    """Return the responses of a tissue's stiffness, or of a step's factorised operator.

    Of columns for all nodes that needles touch, columns through a condensed corridor, and one
    back-substitution for each load, those that are expected to cost least; the results agree to
    round-off.

    Parameters
    ----------
    model : TissueModel
    factor : Factor, optional
        Of the step's operator; that of K when left out.
    expected : ExpectedLoads, optional
        Without them the number of unknowns decides alone.
    """
    few = len(model.free_dofs) <= MOST_SHARED_UNKNOWNS
    if expected is None:
        return CachedCompliance(model, factor) if few else DirectCompliance(model, factor)
    corridor = expected.corridor
    condensed = CondensedCorridor(model, corridor)
    inner = condensed.inner()
    size = np.count_nonzero(inner)
    if few and TOUCHED * size <= MARGIN * expected.loads:
        return CachedCompliance(model, factor, corridor=corridor if factor is None else None)
    if (
        not few
        and factor is None
        and model.element.definite
        and size <= MOST_CORRIDOR_UNKNOWNS
        and corridor_cost(model, inner) <= expected.loads
    ):
        return CachedCompliance(model, columns=condensed, corridor=corridor)
    return DirectCompliance(model, factor)


def corridor_cost(model: TissueModel, inner: Bools) -> float:
    """Return what columns through a condensed corridor cost, in back-substitutions.

    With n unknowns, of which ni lie in the corridor, nb around it and R are touched, these are nb
    with the whole factor, R + nb with the corridor's own, and the products of ni nb^2 and R^2 nb
    operations, twice each.

    Parameters
    ----------
    model : TissueModel
    inner : array, shape (nequations,)
        Whether an equation belongs to the corridor.
    """
    n, ni = len(inner), float(np.count_nonzero(inner))
    nb = float(np.count_nonzero(coupled_equations(model, inner)))
    touched = TOUCHED * ni
    products = 2.0 * (ni * nb**2 + touched**2 * nb) / (DENSE * n)
    return nb + (touched + nb) * ni / n + products


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

        Forces that change at the end of the step (advance at fixed depth) are given in sequence.
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
