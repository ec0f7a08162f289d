"""Steppers: integrators for one system and one time step, and functions that run them."""

import dataclasses
from collections.abc import Callable, Iterator
from typing import Protocol

import numpy as np

from needlefem._arrays import Floats
from needlefem.dynamics.system import MaxwellUpdate, System
from needlefem.fem.factorization import Factor


@dataclasses.dataclass(eq=False)
class KinematicState:
    """Displacement, velocity and acceleration of all unknowns; each of shape (n,).

    `parts` are the displacements of the springs of viscoelastic branches, shape (branches, n).
    """

    u: Floats
    v: Floats
    a: Floats
    parts: Floats = dataclasses.field(default_factory=lambda: np.zeros((0, 0)))


class Stepper(Protocol):
    """An integrator for one system and one time step."""

    system: System
    step: float

    def start(self, u: Floats, v: Floats, force: Floats | None = None) -> KinematicState:
        """Return the state with a given displacement and velocity under a force."""
        ...

    def step_under_load(
        self, motion: KinematicState, before: Floats, after: Floats
    ) -> KinematicState:
        """Return the state after a step; forces at the start and the end of it, shape (n,), N."""
        ...


@dataclasses.dataclass(frozen=True)
class AlphaParameters:
    """Parameters of the generalised-alpha family (J. Chung, G. M. Hulbert 1993).

    Equilibrium is required at ``1 - mass`` (inertia) and ``1 - force`` (other terms) of the step.
    """

    mass: float
    force: float
    beta: float
    gamma: float


def at_rest(system: System) -> KinematicState:
    """Return the undeformed system at rest."""
    zero = np.zeros(system.size)
    return KinematicState(zero, zero.copy(), zero.copy(), _relaxed(system))


def _relaxed(system: System) -> Floats:
    return np.zeros((len(system.branches), system.size))


def _start(system: System, u: Floats, v: Floats, force: Floats | None) -> KinematicState:
    """Return the state whose acceleration is in equilibrium; branches are relaxed."""
    rest = -system.products(None, v if system.damped else None, u)
    if force is not None:
        rest += force
    return KinematicState(
        u.copy(), v.copy(), system.factor(1.0, 0.0, 0.0).solve(rest), _relaxed(system)
    )


class ImplicitStepper:
    """A member of the generalised-alpha family; see `Stepper`.

    With ``a = (u - predicted) / (beta dt^2)`` and ``v = v0 + dt ((1 - gamma) a0 + gamma a)`` the
    only unknown is the displacement at the end of the step. The operator is
    ``(1 - m) M / (beta dt^2) + (1 - f) (gamma C / (beta dt) + K)``.
    """

    def __init__(self, system: System, step: float, weights: AlphaParameters) -> None:
        self.system, self.step, self.weights = system, step, weights
        kept, inertia = 1.0 - weights.force, 1.0 / (weights.beta * step**2)
        drag = weights.gamma * step * inertia
        self._memory = MaxwellUpdate(system.branches, step)
        self.factor: Factor = system.factor(
            (1.0 - weights.mass) * inertia,
            kept * drag,
            kept,
            [kept * gain for gain in self._memory.gains],
        )
        # coefficients of u, v and a in the right-hand side: rows that are applied in one product
        predicted, u, v, a = self._predictor(), *np.eye(3)
        self._known = system.operator(np.array([
            (1.0 - weights.mass) * inertia * predicted - weights.mass * a,
            kept * (drag * predicted - step * (1.0 - weights.gamma) * a) - v,
            -weights.force * u,
        ]) * np.array([[1.0], [system.damped], [1.0]]))  # fmt: skip
        acceleration = inertia * (2.0 * u - predicted)  # the coefficient of u is for its change
        velocity = v + step * ((1.0 - weights.gamma) * a + weights.gamma * acceleration)
        self._new = np.array([velocity, acceleration])

    def _predictor(self) -> Floats:
        """Return the coefficients of u, v and a in the displacement without new acceleration."""
        return np.array([1.0, self.step, self.step**2 * (0.5 - self.weights.beta)])

    def start(self, u: Floats, v: Floats, force: Floats | None = None) -> KinematicState:
        """See `Stepper`."""
        return _start(self.system, u, v, force)

    def at_rest(self) -> KinematicState:
        """Return the undeformed system at rest."""
        return at_rest(self.system)

    def free_displacement(self, motion: KinematicState, force: Floats | None = None) -> Floats:
        """Return the displacement after a step under a given force, shape (n,), m.

        `force` is the force at ``1 - weights.force`` of the step.
        """
        rhs = self._known(np.array([motion.u, motion.v, motion.a]))
        if self._memory:
            rhs -= self._memory.carried(motion.parts, motion.u, self.weights.force)
        if force is not None:
            rhs += force
        return self.factor.solve(rhs)

    def advance(self, motion: KinematicState, u: Floats) -> KinematicState:
        """Return the state after a step that ends at a given displacement."""
        change = u - motion.u
        v, a = self._new @ np.array([change, motion.v, motion.a])
        parts = self._memory.advance(motion.parts, change) if self._memory else motion.parts
        return KinematicState(u, v, a, parts)

    def step_under_load(
        self, motion: KinematicState, before: Floats, after: Floats
    ) -> KinematicState:
        """See `Stepper`."""
        share = self.weights.force
        force = after if share == 0.0 else (1.0 - share) * after + share * before
        return self.advance(motion, self.free_displacement(motion, force))


class ExplicitStepper:
    """Central differences in velocity form; see `Stepper`.

    ``u1 = u + dt v + dt^2 a / 2``. The new acceleration follows from equilibrium at u1; the damping
    force uses the velocity that contains half a step of the new acceleration. Only the mass matrix
    is factorised (with damping: ``M + dt C / 2``).
    """

    weights = AlphaParameters(0.0, 0.0, 0.0, 0.5)

    def __init__(self, system: System, step: float) -> None:
        self.system, self.step = system, step
        self._memory = MaxwellUpdate(system.branches, step)
        self.factor: Factor = system.factor(1.0, 0.5 * step if system.damped else 0.0, 0.0)

    def start(self, u: Floats, v: Floats, force: Floats | None = None) -> KinematicState:
        """See `Stepper`."""
        return _start(self.system, u, v, force)

    def step_under_load(
        self, motion: KinematicState, before: Floats, after: Floats
    ) -> KinematicState:
        """See `Stepper`."""
        del before  # equilibrium is required at the end of the step
        dt = self.step
        half = motion.v + 0.5 * dt * motion.a
        moved = dt * half
        u = motion.u + moved
        rest = after - self.system.products(None, half if self.system.damped else None, u)
        parts = motion.parts
        if self._memory:
            parts = self._memory.advance(parts, moved)
            rest -= self._memory.force(parts)
        a = self.factor.solve(rest)
        return KinematicState(u, half + 0.5 * dt * a, a, parts)


class StaticStepper:
    """Equilibrium after each step; the velocity is a difference quotient; see `Stepper`."""

    weights = AlphaParameters(0.0, 0.0, 0.0, 1.0)

    def __init__(self, system: System, step: float) -> None:
        self.system, self.step = system, step
        self._memory = MaxwellUpdate(system.branches, step)
        self.factor: Factor = system.factor(0.0, 0.0, 1.0, self._memory.gains)

    def start(self, u: Floats, v: Floats, force: Floats | None = None) -> KinematicState:
        """See `Stepper`; a force is applied suddenly and causes a displacement."""
        found, parts = u.copy(), _relaxed(self.system)
        if force is not None:
            shares = [1.0] * len(self.system.branches)
            found = self.system.factor(0.0, 0.0, 1.0, shares).solve(force)
            parts += found
        return KinematicState(found, v.copy(), np.zeros_like(v), parts)

    def free_displacement(self, motion: KinematicState, force: Floats | None = None) -> Floats:
        """Return the displacement after a step under the force at its end, shape (n,), m."""
        rhs = np.zeros_like(motion.u) if force is None else force.copy()
        if self._memory:
            rhs -= self._memory.carried(motion.parts, motion.u)
        return self.factor.solve(rhs)

    def advance(self, motion: KinematicState, u: Floats) -> KinematicState:
        """Return the state after a step that ends at a given displacement."""
        moved = u - motion.u
        parts = self._memory.advance(motion.parts, moved) if self._memory else motion.parts
        return KinematicState(u, moved / self.step, np.zeros_like(u), parts)

    def step_under_load(
        self, motion: KinematicState, before: Floats, after: Floats
    ) -> KinematicState:
        """See `Stepper`."""
        del before
        return self.advance(motion, self.free_displacement(motion, after))


# Functions that run a stepper under a load: a generator, and functions that collect its results.


Load = Callable[[float], Floats]
"""Force on all unknowns at a time (s), shape (n,), N."""


def iterate(
    stepper: Stepper, motion: KinematicState, load: Load | None, count: int
) -> Iterator[KinematicState]:
    """Yield the state after each of `count` steps from time 0.

    Without a load the force is zero. Only the last state is stored.
    """
    zero = np.zeros(stepper.system.size)
    before = zero if load is None else load(0.0)
    for number in range(1, count + 1):
        after = zero if load is None else load(number * stepper.step)
        motion = stepper.step_under_load(motion, before, after)
        before = after
        yield motion


def last(motions: Iterator[KinematicState]) -> KinematicState:
    """Return the last state of a run."""
    for motion in motions:
        found = motion
    return found


def record(motions: Iterator[KinematicState], watch: Callable[[KinematicState], Floats]) -> Floats:
    """Return `watch(state)` for each state, one row per step."""
    return np.array([watch(motion) for motion in motions])


def ramp(force: Floats, duration: float) -> Load:
    """Return a load that increases linearly to `force` and remains constant."""
    return lambda time: min(time / duration, 1.0) * force


def constant(force: Floats) -> Load:
    """Return a constant load from time 0."""
    return lambda _: force


def switched(force: Floats, on: float, off: float = np.inf) -> Load:
    """Return a load that is constant between the times `on` and `off` (s), and otherwise zero."""
    return lambda time: (1.0 if on <= time < off else 0.0) * force


def table(times: Floats, factors: Floats, force: Floats) -> Load:
    """Return `force` times a factor that is interpolated linearly in a table."""
    return lambda time: float(np.interp(time, times, factors)) * force


def together(*loads: Load) -> Load:
    """Return the sum of loads."""
    return lambda time: np.sum([load(time) for load in loads], axis=0)
