"""Tissue as a needle stepped in time meets it: an operator, and the motion without the needle."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from needlefem.arrays import Floats, Vector
from needlefem.dynamics import EnergyLedger, Motion, TissueSystem
from needlefem.dynamics.steppers import StaticStepper
from needlefem.errors import SimulationError
from needlefem.fem.factor import Factor
from needlefem.fem.model import Model
from needlefem.fem.responses import DirectResponses, Responses, SharedResponses
from needlefem.insertion.recent import Recent
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


class ViscoelasticMedium:
    """Equilibrium at the end of every step, with the memory of branches; see `Medium`."""

    timeless, inertial = False, False

    def __init__(self, model: Model) -> None:
        self.model, self.system = model, TissueSystem(model)
        self._motion: Motion | None = None
        self._steppers: Recent[float, tuple[StaticStepper, Responses]] = Recent()
        self._energies: dict[str, float] = {}
        self._forces = np.zeros(self.system.size)
        self.background: Floats | None = None
        self.responses: Responses

    def begin(self, duration: float) -> None:
        """See `Medium`."""
        if duration <= 0.0:
            raise SimulationError("viscoelastic tissue takes steps that last")
        key = float(np.format_float_scientific(duration, precision=9))
        self._stepper, self.responses = self._steppers.get(key, lambda: self._ready(duration))
        if self._motion is None:
            rest = np.zeros(self.system.size)
            self._motion = self._stepper.start(rest, rest)
        self._free = self._stepper.free_motion(self._motion)
        self.background = self.system.nodal(self._free)

    def _ready(self, duration: float) -> tuple[StaticStepper, Responses]:
        stepper = StaticStepper(self.system, duration)
        return stepper, responses_of(self.model, stepper.factor)

    def swing(self, pieces: Sequence[Piece], direction: Vector) -> None:
        """See `Medium`."""

    def finish(self, load: Floats) -> None:
        """See `Medium`."""
        assert self._motion is not None
        force = load[self.model.free_dofs]
        new = self._stepper.advance(self._motion, self._free + self._stepper.factor.solve(force))
        ledger = EnergyLedger(self._stepper)
        ledger.add(self._motion, new, self._forces, force)
        for name in ("strain", "stored", "relaxation"):
            self._energies[name] = self._energies.get(name, 0.0) + getattr(ledger, name)
        self._motion, self._forces = new, force

    def energies(self) -> dict[str, float]:
        """See `Medium`."""
        return dict(self._energies)
