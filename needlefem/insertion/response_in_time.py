"""Responses of tissue that depends on time: viscoelastic tissue, and tissue with inertia.

The operator of a step depends on its duration. The operators of the latest durations are kept.
"""

import dataclasses
from collections import OrderedDict
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Generic, Protocol, TypeVar

import numpy as np

from needlefem._arrays import Floats, Vector
from needlefem.contact.condensed_contact import ContactSegment
from needlefem.dynamics import (
    Damping,
    GeneralizedAlpha,
    KinematicState,
    Newmark,
    TissueEnergyBalance,
    TissueSystem,
)
from needlefem.dynamics.steppers import AlphaParameters, ImplicitStepper, StaticStepper
from needlefem.errors import CaseError, SimulationError
from needlefem.fem.compliance import ComplianceOperator
from needlefem.fem.factorization import Factor
from needlefem.fem.tissue_model import TissueModel
from needlefem.insertion.tissue_response import ExpectedLoads, responses_of
from needlefem.scene import Rayleigh, Scene

Key = TypeVar("Key")
Value = TypeVar("Value")

MOST = 8
"""Operators kept: those of the motion's legs, and of some halvings of their steps."""


class LeastRecentlyUsed(Generic[Key, Value]):
    """A few values by their key; the one not asked for longest goes first."""

    def __init__(self) -> None:
        self._kept: OrderedDict[Key, Value] = OrderedDict()

    def get(self, key: Key, make: Callable[[], Value]) -> Value:
        """Return the value of a key, made if it is not there."""
        if key not in self._kept:
            self._kept[key] = make()
            if len(self._kept) > MOST:
                self._kept.popitem(last=False)
        self._kept.move_to_end(key)
        return self._kept[key]


# Viscoelastic tissue.


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
        self._free = self._stepper.free_displacement(self._motion)
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


# Tissue with inertia and damping.
#
# Needle forces are those at the end of a step. A sticking point has the velocity of the needle
# there: over the step it moves with the mean of its old velocity and that of the needle. A point
# that starts to stick is therefore half a step behind, and then moves with the needle without
# oscillation. The tip on its material point and the lateral constraint prescribe displacements;
# the integrator has to damp the oscillations that follow.


RINGS = 1.0 - 1e-9
"""Spectral radius from which on motion under a bound displacement does not come to rest."""
GROWN = 1.5
"""Step over the one before it from which on accelerations are not kept."""
TERMS = ("strain", "stored", "relaxation", "kinetic", "damping", "algorithmic")


class Implicit(Protocol):
    """An integrator of the generalised-alpha family."""

    def stepper(self, system: TissueSystem, step: float) -> ImplicitStepper:
        """Return it ready for a system and a step, s."""
        ...


def bound_radius(weights: AlphaParameters) -> float:
    """Return by what velocity and acceleration shrink a step where the displacement is given.

    The larger eigenvalue of their recursion, ``v1 = (1 - g/b) v0 + (1 - g/2b) dt a0`` and
    ``dt a1 = -v0/b + (1 - 1/2b) dt a0`` with ``b = beta``, ``g = gamma``. Average acceleration has
    -1 twice, with a single eigenvector: its acceleration grows.
    """
    beta, gamma = weights.beta, weights.gamma
    recursion = np.array([
        [1.0 - gamma / beta, 1.0 - 0.5 * gamma / beta],
        [-1.0 / beta, 1.0 - 0.5 / beta],
    ])  # fmt: skip
    return float(np.abs(np.linalg.eigvals(recursion)).max())


class _Scaled:
    """A factorised operator of which a force acts with a share; see `Factor`."""

    def __init__(self, stepper: ImplicitStepper) -> None:
        self._factor, self._share = stepper.factor, 1.0 - stepper.weights.force
        self.name = stepper.factor.name

    def solve(self, rhs: Floats) -> Floats:
        return self._factor.solve(rhs if self._share == 1.0 else self._share * rhs)


class DynamicResponse:
    """A tissue with inertia; see `TissueResponse`.

    Parameters
    ----------
    system : TissueSystem
    integrator : Implicit
    expected : ExpectedLoads, optional
    refuse_ringing : bool
        Whether an integrator that does not damp bound displacements is an error.

    Attributes
    ----------
    motion : KinematicState
        At the last step's end.
    """

    timeless, inertial = False, True

    def __init__(
        self,
        system: TissueSystem,
        integrator: Implicit,
        expected: ExpectedLoads | None = None,
        *,
        refuse_ringing: bool = True,
    ) -> None:
        self.system, self.model, self.integrator = system, system.model, integrator
        self._refuse, self._expected = refuse_ringing, expected
        self._steppers: LeastRecentlyUsed[float, tuple[ImplicitStepper, ComplianceOperator]] = (
            LeastRecentlyUsed()
        )
        self._energies = dict.fromkeys(TERMS, 0.0)
        self._forces, self._pace = np.zeros((2, system.size))
        self.motion: KinematicState | None = None
        self._start: KinematicState
        self.background: Floats | None = None
        self._loose: list[float] = []
        self._past = np.inf
        self.responses: ComplianceOperator

    def begin(self, duration: float) -> None:
        """See `TissueResponse`."""
        if duration <= 0.0:
            raise SimulationError("tissue with inertia takes steps that last")
        key = float(np.format_float_scientific(duration, precision=9))
        self._stepper, self.responses = self._steppers.get(key, lambda: self._ready(duration))
        if self.motion is None:
            self.motion = self._stepper.at_rest()
        self._start = self.motion
        if duration > GROWN * self._past:  # what short steps resolved, long ones would amplify
            self._start = dataclasses.replace(self.motion, a=np.zeros_like(self.motion.a))
        share = self._stepper.weights.force
        carried = share * self._forces if share else None
        self._free = self._stepper.free_displacement(self._start, carried)
        self.background = self.system.nodal(self._free)

    def swing(self, pieces: Sequence[ContactSegment], direction: Vector) -> Floats:
        """See `TissueResponse`."""
        half, weights = 0.5 * self._stepper.step, self._stepper.weights
        fields = [self.system.nodal(half * v) @ direction for v in (self._start.v, self._pace)]
        ways = [[piece.weights @ field[piece.nodes] for piece in pieces] for field in fields]
        for piece in pieces[len(self._loose) :]:
            load = np.zeros((self.model.nnodes, self.model.dim))
            load[piece.nodes] = piece.weights[:, None] * direction
            force = self.model.dof_vector(load)[self.model.free_dofs]
            self._loose.append(float(force @ self._mass.solve(force)))
        inertia = weights.beta * self._stepper.step**2 / (1.0 - weights.mass)
        return np.array([*ways, (1.0 - weights.force) * inertia * np.array(self._loose)])

    @cached_property
    def _mass(self) -> Factor:
        return self.system.factor(1.0, 0.0, 0.0)

    def _ready(self, duration: float) -> tuple[ImplicitStepper, ComplianceOperator]:
        stepper = self.integrator.stepper(self.system, duration)
        if self._refuse and bound_radius(stepper.weights) >= RINGS:
            raise CaseError(
                "discretization.integrator",
                "average acceleration rings for ever where a needle binds the tissue",
                "take newmark_gamma above 0.5, or generalised-alpha with rho_inf below 1",
            )
        return stepper, responses_of(self.model, _Scaled(stepper), self._expected)

    def finish(self, load: Floats) -> None:
        """See `TissueResponse`."""
        stepper, old, force = self._stepper, self._start, load[self.model.free_dofs]
        self.motion = stepper.advance(old, self._free + _Scaled(stepper).solve(force))
        self._pace, self._past = (self.motion.u - old.u) / stepper.step, stepper.step
        ledger = TissueEnergyBalance(stepper)
        ledger.add(old, self.motion, self._forces, force)
        for name in TERMS:
            self._energies[name] += getattr(ledger, name)
        self._forces = force

    def energies(self) -> dict[str, float]:
        """See `TissueResponse`."""
        return dict(self._energies)


def dynamic_response(
    scene: Scene, model: TissueModel, expected: ExpectedLoads | None = None
) -> DynamicResponse:
    """Return the tissue of a resolved scene, in time as its discretisation says.

    Raises
    ------
    CaseError
        The mass can't be lumped so, or the tissue has none.
    """
    numbers = scene.discretization
    lumping = None if numbers.mass_matrix == "consistent" else numbers.mass_matrix
    system = TissueSystem(model, damping_of(scene.damping), lumping)
    gamma = numbers.newmark_gamma
    newmark = Newmark(beta=0.25 * (gamma + 0.5) ** 2, gamma=gamma)
    alpha = GeneralizedAlpha(rho_inf=numbers.rho_inf)
    chosen = newmark if numbers.integrator == "newmark" else alpha
    return DynamicResponse(system, chosen, expected)


def damping_of(said: Rayleigh) -> Damping:
    """Return the damping that a case asks for."""
    pairs = (said.frequencies, said.ratios)
    if not any(pairs):
        return Damping(mass_rate=said.mass_rate, stiffness_time=said.stiffness_time)
    first, second = said.frequencies
    return Damping.from_ratios((first, second), (said.ratios[0], said.ratios[1]))
