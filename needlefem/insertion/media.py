"""Tissue as a needle stepped in time meets it: an operator, and the motion without the needle."""

from collections.abc import Sequence
from typing import Protocol

from needlefem.arrays import Floats, Vector
from needlefem.fem.factor import Factor
from needlefem.fem.model import Model
from needlefem.fem.responses import DirectResponses, Responses, SharedResponses
from needlefem.needle.functionals import Piece

MOST_SHARED_UNKNOWNS = 10_000
"""Above, the needle's corridor has so many nodes that one solve a load is cheaper."""


def responses_of(model: Model, factor: Factor | None = None) -> Responses:
    """Return the responses of a tissue's stiffness, or of a step's factorised operator."""
    kind = DirectResponses if len(model.free_dofs) > MOST_SHARED_UNKNOWNS else SharedResponses
    return kind(model) if factor is None else kind(model, factor)


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
        """End the step under the needle's forces, shape (ndofs,), N."""
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
