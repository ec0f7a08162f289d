"""Responses of tissue that depends on time: viscoelastic tissue, and tissue with inertia.

The operator of a step depends on its duration. The operators of the latest durations are kept.
"""

import dataclasses
from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from functools import cached_property, partial
from typing import Generic, Protocol, TypeVar

import numpy as np

from needlefem._arrays import Floats, Ints, Vector
from needlefem.contact.condensed_contact import ContactSegment
from needlefem.dynamics import (
    Damping,
    GeneralizedAlpha,
    KinematicState,
    Newmark,
    TissueEnergyBalance,
    TissueSystem,
)
from needlefem.dynamics.steppers import AlphaParameters, ImplicitStepper, StaticStepper, at_rest
from needlefem.errors import CaseError, SimulationError
from needlefem.fem.compliance import ComplianceOperator
from needlefem.fem.factorization import Factor
from needlefem.fem.interpolation import LinearFunctionals
from needlefem.fem.tissue_model import TissueModel
from needlefem.insertion.result import Insertion
from needlefem.insertion.state import State, load
from needlefem.insertion.tissue_response import ExpectedLoads, responses_of
from needlefem.scene import DYNAMIC, Rayleigh, Scene

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
        force = self.model.unknowns(load)
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
            force = self.model.unknowns(self.model.dof_vector(load))
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
        stepper, old, force = self._stepper, self._start, self.model.unknowns(load)
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


# Displacement in states of an insertion that has ended. It does not follow from the forces of one
# state: the steps of the insertion are repeated with the stored forces.


Steps = Iterator[tuple[float, Floats]]
"""Durations, s, and the needle's forces at their ends, shape (ndofs,)."""
SAME = 1e-6
"""How far the tip's displacement may be off what the state says of it, over the largest one."""


def _inertial(insertion: Insertion) -> bool:
    return insertion.scene.discretization.integrator in DYNAMIC


def gone_through(insertion: Insertion, numbers: Ints) -> Floats:
    """Return the displacements in some states, shape (ndofs, n), m.

    Parameters
    ----------
    insertion : Insertion
        With all of its states.
    numbers : array, shape (n,)
        Of the states.

    Raises
    ------
    SimulationError
        States before are missing.
    """
    model, frame = insertion.model, insertion.axis.frame
    states = insertion.states[: int(np.max(numbers)) + 1]
    times = np.array([state.time for state in states])
    forces = (load(model, frame, state, insertion.pieces) for state in states[1:])
    steps = ((float(d), f) for d, f in zip(np.diff(times), forces, strict=True))
    moved = _swung(insertion, steps) if _inertial(insertion) else _crept(insertion, steps)
    found, now = np.zeros((model.ndofs, len(numbers))), np.zeros(len(model.free_dofs))
    for number, state in enumerate(states):
        if number:
            now = next(moved)
        asked = np.flatnonzero(numbers == number)
        if asked.size:
            found[:, asked] = model.dof_vectors(now)[:, None]
            _compare(insertion, state, found[:, asked[0]])
    return found


def _compare(insertion: Insertion, state: State, moved: Floats) -> None:
    """Raise a `SimulationError` if a displacement is not that of a state."""
    nodal = insertion.model.nodal(moved)
    tip = LinearFunctionals(state.tip_nodes, state.tip_weights[None]).of(nodal)[0]
    apart = abs(float(tip @ insertion.axis.direction) - state.tip_displacement)
    if apart > SAME * max(float(np.abs(nodal).max()), abs(state.tip_displacement)):
        raise SimulationError(
            "the displacement of tissue that depends on time can't be found again: keep all "
            "states of the insertion"
        )


def _swung(insertion: Insertion, steps: Steps) -> Iterator[Floats]:
    """Yield what tissue with inertia does, shape (free dofs,), m."""
    medium = dynamic_response(insertion.scene, insertion.model)
    now = np.zeros(len(insertion.model.free_dofs))
    for duration, force in steps:
        if duration > 0.0:
            medium.begin(duration)
            medium.finish(force)
            assert medium.motion is not None
            now = medium.motion.u
        yield now


def _crept(insertion: Insertion, steps: Steps) -> Iterator[Floats]:
    """Yield what tissue with a memory does, shape (free dofs,), m."""
    model, system = insertion.model, TissueSystem(insertion.model)
    start = motion = at_rest(system)
    steppers: LeastRecentlyUsed[str, StaticStepper] = LeastRecentlyUsed()
    stepper: StaticStepper | None = None
    for duration, force in steps:
        if duration > 0.0:
            start, step = motion, duration
            stepper = steppers.get(f"{step:.9e}", partial(StaticStepper, system, step))
        if stepper is not None:  # forces that follow at the same time act from the same start on
            free = model.unknowns(force)
            motion = stepper.step_under_load(start, free, free)
        yield motion.u
