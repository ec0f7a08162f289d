"""Viscoelastic tissue as a needle stepped in time meets it."""

from collections.abc import Sequence

import numpy as np

from needlefem._arrays import Floats, Vector
from needlefem.contact.functionals import ContactSegment
from needlefem.dynamics import KinematicState, TissueEnergyBalance, TissueSystem
from needlefem.dynamics.steppers import StaticStepper
from needlefem.errors import SimulationError
from needlefem.fem.compliance import ComplianceOperator
from needlefem.fem.tissue_model import TissueModel
from needlefem.insertion.recent import LeastRecentlyUsed
from needlefem.insertion.tissue_response import ExpectedLoads, responses_of


class ViscoelasticResponse:
    """Equilibrium at the end of every step, with the memory of branches; see `TissueResponse`."""

    timeless, inertial = False, False

    def __init__(self, model: TissueModel, expected: ExpectedLoads | None = None) -> None:
        self.model, self.system, self._expected = model, TissueSystem(model), expected
        self._motion: KinematicState | None = None
        self._start: KinematicState
        self._ended = False
        self._steppers: LeastRecentlyUsed[float, tuple[StaticStepper, ComplianceOperator]] = (
            LeastRecentlyUsed()
        )
        self._energies: dict[str, float] = {}
        self._forces = np.zeros(self.system.size)
        self.background: Floats | None = None
        self.responses: ComplianceOperator

    def begin(self, duration: float) -> None:
        """See `TissueResponse`."""
        if duration <= 0.0:
            raise SimulationError("viscoelastic tissue takes steps that last")
        key = float(np.format_float_scientific(duration, precision=9))
        self._stepper, self.responses = self._steppers.get(key, lambda: self._ready(duration))
        if self._motion is None:
            rest = np.zeros(self.system.size)
            self._motion = self._stepper.start(rest, rest)
        self._start, self._ended = self._motion, False
        self._free = self._stepper.free_motion(self._motion)
        self.background = self.system.nodal(self._free)

    def _ready(self, duration: float) -> tuple[StaticStepper, ComplianceOperator]:
        stepper = StaticStepper(self.system, duration)
        return stepper, responses_of(self.model, stepper.factor, self._expected)

    def swing(self, pieces: Sequence[ContactSegment], direction: Vector) -> None:
        """See `TissueResponse`."""

    def finish(self, load: Floats) -> None:
        """See `TissueResponse`."""
        assert self._motion is not None
        force = load[self.model.free_dofs]
        new = self._stepper.advance(self._start, self._free + self._stepper.factor.solve(force))
        ledger = TissueEnergyBalance(self._stepper)
        ledger.add(self._motion, new, self._forces, force, at_once=self._ended)
        for name in ("strain", "stored", "relaxation"):
            self._energies[name] = self._energies.get(name, 0.0) + getattr(ledger, name)
        self._motion, self._forces, self._ended = new, force, True

    def energies(self) -> dict[str, float]:
        """See `TissueResponse`."""
        return dict(self._energies)
