"""Responses of tissue that depends on time: viscoelastic tissue, and tissue with inertia.

The operator of a step depends on its duration. The factorised operators of the last few
durations are kept.
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
    HHT,
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
"""Largest number of factorised operators: those of the stages of a motion and of halved steps."""


class LeastRecentlyUsed(Generic[Key, Value]):
    """A cache of a few values; the least recently used one is removed first."""

    def __init__(self) -> None:
        self._values: OrderedDict[Key, Value] = OrderedDict()

    def get(self, key: Key, make: Callable[[], Value]) -> Value:
        """Return the value of a key, and compute it if it is not in the cache."""
        if key not in self._values:
            self._values[key] = make()
            if len(self._values) > MOST:
                self._values.popitem(last=False)
        self._values.move_to_end(key)
        return self._values[key]


# Viscoelastic tissue without inertia.


class ViscoelasticResponse:
    """Equilibrium at the end of each step, with Maxwell branches; see `TissueResponse`.

    Parameters
    ----------
    model : TissueModel
    expected : ExpectedLoads, optional
        Used to choose the method that computes compliances.
    """

    rate_independent, has_inertia = False, False

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
        self.free_displacement: Floats | None = None
        self.responses: ComplianceOperator

    def begin(self, duration: float) -> None:
        """See `TissueResponse`."""
        if duration <= 0.0:
            raise SimulationError("viscoelastic tissue requires time steps with a duration above 0")
        key = float(np.format_float_scientific(duration, precision=9))
        self._stepper, self.responses = self._steppers.get(key, lambda: self._ready(duration))
        if self._motion is None:
            rest = np.zeros(self.system.size)
            self._motion = self._stepper.start(rest, rest)
        self._start, self._ended = self._motion, False
        self._free = self._stepper.free_displacement(self._motion)
        self.free_displacement = self.system.nodal(self._free)

    def _ready(self, duration: float) -> tuple[StaticStepper, ComplianceOperator]:
        stepper = StaticStepper(self.system, duration)
        return stepper, responses_of(self.model, stepper.factor, self._expected)

    def inertial_drift(self, segments: Sequence[ContactSegment], direction: Vector) -> None:
        """See `TissueResponse`."""

    def finish(self, load: Floats) -> None:
        """See `TissueResponse`."""
        assert self._motion is not None
        force = self.model.unknowns(load)
        new = self._stepper.advance(self._start, self._free + self._stepper.factor.solve(force))
        increment = TissueEnergyBalance(self._stepper)
        increment.add(self._motion, new, self._forces, force, at_once=self._ended)
        for name in ("strain", "stored", "relaxation"):
            self._energies[name] = self._energies.get(name, 0.0) + getattr(increment, name)
        self._motion, self._forces, self._ended = new, force, True

    def displacement(self) -> Floats:
        """See `TissueResponse`."""
        motion = self._motion
        return np.zeros(self.model.ndofs) if motion is None else self.model.dof_vectors(motion.u)

    def energies(self) -> dict[str, float]:
        """See `TissueResponse`."""
        return dict(self._energies)


# Tissue with inertia and damping.
#
# Needle forces are those at the end of a step. A sticking point has the velocity of the needle
# there: over the step it moves with the mean of its old velocity and the needle's velocity. In the
# step in which a point begins to stick it is therefore displaced less than the needle. Afterwards
# it moves with the needle without oscillation. A tip that loads the crack front, and the lateral
# constraint, prescribe displacements; the integrator has to damp the oscillations that follow.


RINGS = 1.0 - 1e-9
"""Spectral radius above which oscillations under a prescribed displacement do not decay."""
GROWN = 1.5
"""Ratio of a step to the step before it above which the accelerations are set to zero."""
TERMS = ("strain", "stored", "relaxation", "kinetic", "damping", "algorithmic")


class Implicit(Protocol):
    """An integrator of the generalized-alpha family."""

    def stepper(self, system: TissueSystem, step: float) -> ImplicitStepper:
        """Return the integrator for a system and a step duration, s."""
        ...


def bound_radius(weights: AlphaParameters) -> float:
    """Return the spectral radius of a step for a degree of freedom with prescribed displacement.

    It is that of the recursion of velocity and acceleration,
    ``v1 = (1 - g/b) v0 + (1 - g/2b) dt a0`` and ``dt a1 = -v0/b + (1 - 1/2b) dt a0`` with
    ``b = beta``, ``g = gamma``. Average acceleration has the double eigenvalue -1 with a single
    eigenvector, so that the acceleration grows.
    """
    beta, gamma = weights.beta, weights.gamma
    recursion = np.array([
        [1.0 - gamma / beta, 1.0 - 0.5 * gamma / beta],
        [-1.0 / beta, 1.0 - 0.5 / beta],
    ])  # fmt: skip
    return float(np.abs(np.linalg.eigvals(recursion)).max())


class _Scaled:
    """A factorised operator whose right-hand side is scaled; see `Factor`.

    The factor is the share of the force at the end of the step in the equation of motion.
    """

    def __init__(self, stepper: ImplicitStepper) -> None:
        self._factor, self._share = stepper.factor, 1.0 - stepper.weights.force
        self.name = stepper.factor.name

    def solve(self, rhs: Floats) -> Floats:
        return self._factor.solve(rhs if self._share == 1.0 else self._share * rhs)


class DynamicResponse:
    """Response of tissue with inertia; see `TissueResponse`.

    Parameters
    ----------
    system : TissueSystem
    integrator : Implicit
    expected : ExpectedLoads, optional
        Used to choose the method that computes compliances.
    refuse_ringing : bool
        Whether an integrator that does not damp oscillations under prescribed displacements is an
        error.

    Attributes
    ----------
    motion : KinematicState
        Displacement, velocity and acceleration at the end of the last step.
    """

    rate_independent, has_inertia = False, True

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
        self._forces, self._mean_velocity = np.zeros((2, system.size))
        self.motion: KinematicState | None = None
        self._start: KinematicState
        self.free_displacement: Floats | None = None
        self._inverse_masses: list[float] = []
        self._past = np.inf
        self.responses: ComplianceOperator

    def begin(self, duration: float) -> None:
        """See `TissueResponse`."""
        if duration <= 0.0:
            raise SimulationError("tissue with inertia requires time steps with a duration above 0")
        key = float(np.format_float_scientific(duration, precision=9))
        self._stepper, self.responses = self._steppers.get(key, lambda: self._ready(duration))
        if self.motion is None:
            self.motion = self._stepper.at_rest()
        self._start = self.motion
        # a long step would amplify the accelerations of oscillations that short steps resolve
        if duration > GROWN * self._past:
            self._start = dataclasses.replace(self.motion, a=np.zeros_like(self.motion.a))
        share = self._stepper.weights.force
        carried = share * self._forces if share else None
        self._free = self._stepper.free_displacement(self._start, carried)
        self.free_displacement = self.system.nodal(self._free)

    def inertial_drift(self, segments: Sequence[ContactSegment], direction: Vector) -> Floats:
        """See `TissueResponse`."""
        half, weights = 0.5 * self._stepper.step, self._stepper.weights
        velocities = (self._start.v, self._mean_velocity)
        fields = [self.system.nodal(half * v) @ direction for v in velocities]
        drifts = [
            [segment.weights @ field[segment.nodes] for segment in segments] for field in fields
        ]
        for segment in segments[len(self._inverse_masses) :]:
            load = np.zeros((self.model.nnodes, self.model.dim))
            load[segment.nodes] = segment.weights[:, None] * direction
            force = self.model.unknowns(self.model.dof_vector(load))
            self._inverse_masses.append(float(force @ self._mass.solve(force)))
        inertia = weights.beta * self._stepper.step**2 / (1.0 - weights.mass)
        scaled = (1.0 - weights.force) * inertia * np.array(self._inverse_masses)
        return np.array([*drifts, scaled])

    @cached_property
    def _mass(self) -> Factor:
        return self.system.factor(1.0, 0.0, 0.0)

    def _ready(self, duration: float) -> tuple[ImplicitStepper, ComplianceOperator]:
        stepper = self.integrator.stepper(self.system, duration)
        if self._refuse and bound_radius(stepper.weights) >= RINGS:
            raise CaseError(
                "discretization.integrator",
                "with average acceleration, oscillations of the constrained tissue do not decay",
                "take newmark_gamma above 0.5, hht_alpha below 0, or rho_inf below 1",
            )
        return stepper, responses_of(self.model, _Scaled(stepper), self._expected)

    def finish(self, load: Floats) -> None:
        """See `TissueResponse`."""
        stepper, old, force = self._stepper, self._start, self.model.unknowns(load)
        self.motion = stepper.advance(old, self._free + _Scaled(stepper).solve(force))
        self._mean_velocity, self._past = (self.motion.u - old.u) / stepper.step, stepper.step
        increment = TissueEnergyBalance(stepper)
        increment.add(old, self.motion, self._forces, force)
        for name in TERMS:
            self._energies[name] += getattr(increment, name)
        self._forces = force

    def displacement(self) -> Floats:
        """See `TissueResponse`."""
        motion = self.motion
        return np.zeros(self.model.ndofs) if motion is None else self.model.dof_vectors(motion.u)

    def energies(self) -> dict[str, float]:
        """See `TissueResponse`."""
        return dict(self._energies)


def dynamic_response(
    scene: Scene, model: TissueModel, expected: ExpectedLoads | None = None
) -> DynamicResponse:
    """Return the response of the tissue with inertia of a resolved scene.

    Raises
    ------
    CaseError
        The mass matrix cannot be lumped as the scene requires, or the tissue has no mass.
    """
    numbers = scene.discretization
    lumping = None if numbers.mass_matrix == "consistent" else numbers.mass_matrix
    system = TissueSystem(model, damping_of(scene.damping), lumping)
    gamma = numbers.newmark_gamma
    integrator: Implicit = GeneralizedAlpha(rho_inf=numbers.rho_inf)
    if numbers.integrator == "newmark":
        integrator = Newmark(beta=0.25 * (gamma + 0.5) ** 2, gamma=gamma)
    elif numbers.integrator == "hht":
        integrator = HHT(alpha=numbers.hht_alpha)
    return DynamicResponse(system, integrator, expected)


def damping_of(rayleigh: Rayleigh) -> Damping:
    """Return the damping that a scene prescribes by coefficients or by two damping ratios."""
    pairs = (rayleigh.frequencies, rayleigh.ratios)
    if not any(pairs):
        return Damping(mass_rate=rayleigh.mass_rate, stiffness_time=rayleigh.stiffness_time)
    first, second = rayleigh.frequencies
    return Damping.from_ratios((first, second), (rayleigh.ratios[0], rayleigh.ratios[1]))
