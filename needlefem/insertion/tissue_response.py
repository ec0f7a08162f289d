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
"""Number of unknowns up to which columns are used if they cost at most `MARGIN` times the single
loads, because the products that follow cost less with columns."""
MARGIN = 2.0
MOST_CORRIDOR_UNKNOWNS = 12_000
"""Unknowns of a corridor above which the compliance between its nodes needs too much memory."""
TOUCHED = 0.5
"""Share of the unknowns of a corridor that needles load: 0.43 to 0.53 in four meshes."""
FIRST, NEXT = 16, 5
"""Loads for each segment of the path, in a first insertion and in one with a warm start: 16 to 20
and 4 to 7 in four meshes."""
EACH_STEP = 40
"""Loads for each time step: 35 to 45 in three scenes with stick-slip friction."""
DENSE = 1_000.0
"""Operations of a matrix product that take as long as a back-substitution for one unknown."""


class ExpectedLoads(NamedTuple):
    """Where needles are expected to load the tissue, and how often.

    Parameters
    ----------
    corridor : Corridor
    loads : int
        Number of loads. Without shared columns each of them is one right-hand side.
    """

    corridor: Corridor
    loads: int

    @classmethod
    def of_path(cls, corridor: Corridor, segments: int, insertions: int) -> "ExpectedLoads":
        """Return the loads of insertions by path following with a number of segments each."""
        return cls(corridor, segments * (FIRST + NEXT * (insertions - 1)))

    @classmethod
    def of_steps(cls, corridor: Corridor, steps: int, insertions: int) -> "ExpectedLoads":
        """Return the loads of insertions by time stepping with a number of steps each."""
        return cls(corridor, EACH_STEP * steps * insertions)


def responses_of(
    model: TissueModel, factor: Factor | None = None, expected: ExpectedLoads | None = None
) -> ComplianceOperator:
    """Return the compliance operator of the stiffness matrix, or of the operator of a step.

    The method with the smallest expected cost is chosen: columns for all nodes that needles load,
    columns through a condensed corridor, or one back-substitution for each load. The results agree
    to round-off.

    Parameters
    ----------
    model : TissueModel
    factor : Factor, optional
        Factorised operator of a step; that of the stiffness matrix when left out.
    expected : ExpectedLoads, optional
        When left out, only the number of unknowns decides.
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
    """Return the cost of columns through a condensed corridor, in back-substitutions.

    With n unknowns, ni of them in the corridor, nb adjacent to it and R loaded, the cost is nb
    back-substitutions with the whole factor, R + nb with the factor of the corridor, and matrix
    products of 2 (ni nb^2 + R^2 nb) operations.

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
    """Response of the tissue to needle forces, step by step.

    Attributes
    ----------
    responses : ComplianceOperator
        Compliances of the operator of the step that has begun.
    free_displacement : array, shape (nnodes, dim), m, or None
        Displacement at the end of the step without needle forces; None: zero.
    rate_independent : bool
        Whether the response is independent of the duration of a step. Then a step can end where an
        event occurs.
    has_inertia : bool
        Whether the tissue has mass.
    """

    responses: ComplianceOperator
    free_displacement: Floats | None
    rate_independent: bool
    has_inertia: bool

    def begin(self, duration: float) -> None:
        """Begin a step of a duration, s."""
        ...

    def inertial_drift(
        self, segments: Sequence[ContactSegment], direction: Vector
    ) -> Floats | None:
        """Return how far contact segments move by inertia in the step, or None without inertia.

        Parameters
        ----------
        segments : sequence of ContactSegment
        direction : array, shape (dim,)
            Unit vector of the needle axis.

        Returns
        -------
        Array, shape (3, nsegments); see `CondensedContact`.
        """
        ...

    def finish(self, load: Floats) -> None:
        """End the step with the needle forces at its end, shape (ndofs,), N (N/m in 2D).

        Forces that change at the end of the step (advance at fixed depth) are given in sequence.
        """
        ...

    def displacement(self) -> Floats | None:
        """Return the displacement after the last step, shape (ndofs,), m.

        None in rate-independent tissue: there it follows from the forces of the state.
        """
        ...

    def energies(self) -> dict[str, float]:
        """Return the energies that are computed from the tissue alone, by name, J (J/m in 2D)."""
        ...


class ElasticResponse:
    """Elastic equilibrium; see `TissueResponse`."""

    rate_independent, has_inertia = True, False
    free_displacement: Floats | None = None

    def __init__(self, responses: ComplianceOperator) -> None:
        self.responses = responses

    def begin(self, duration: float) -> None:
        """See `TissueResponse`; elastic tissue needs no preparation."""

    def inertial_drift(self, segments: Sequence[ContactSegment], direction: Vector) -> None:
        """See `TissueResponse`."""

    def finish(self, load: Floats) -> None:
        """See `TissueResponse`; elastic tissue stores no state."""

    def displacement(self) -> Floats | None:
        """See `TissueResponse`."""
        return None

    def energies(self) -> dict[str, float]:
        """See `TissueResponse`."""
        return {}
