"""Integrators made ready for one system and one step."""

import dataclasses
from typing import Protocol

import numpy as np

from needlefem.arrays import Floats
from needlefem.dynamics.systems import System
from needlefem.fem.factor import Factor


@dataclasses.dataclass(eq=False)
class Motion:
    """Displacement, velocity and acceleration of all unknowns; each of shape (n,)."""

    u: Floats
    v: Floats
    a: Floats


class Stepper(Protocol):
    """One integrator, one system, one step."""

    system: System
    step: float

    def start(self, u: Floats, v: Floats, force: Floats | None = None) -> Motion:
        """Return the motion that starts from displacement and velocity under a force."""
        ...

    def advance_under(self, motion: Motion, before: Floats, after: Floats) -> Motion:
        """Return the motion a step later; forces at the step's start and end, shape (n,), N."""
        ...


@dataclasses.dataclass(frozen=True)
class Weights:
    """Parameters of the generalised-alpha family (J. Chung, G. M. Hulbert 1993).

    Balance is asked for at ``1 - mass`` (inertia) and ``1 - force`` (all else) of the step.
    """

    mass: float
    force: float
    beta: float
    gamma: float


def at_rest(system: System) -> Motion:
    """Return the undeformed system at rest."""
    zero = np.zeros(system.size)
    return Motion(zero, zero.copy(), zero.copy())


def _start(system: System, u: Floats, v: Floats, force: Floats | None) -> Motion:
    """Return the motion whose acceleration balances the forces."""
    rest = -(system.stiffness_times(u))
    if system.damped:
        rest = rest - system.damping_times(v)
    if force is not None:
        rest = rest + force
    return Motion(u.copy(), v.copy(), system.factor(1.0, 0.0, 0.0).solve(rest))


class ImplicitStepper:
    """A member of the generalised-alpha family; see `Stepper`.

    ``a = (u - predicted) / (beta dt^2)`` and ``v = v0 + dt ((1 - gamma) a0 + gamma a)`` leave the
    displacement at the step's end as the one unknown, with the operator
    ``(1 - m) M / (beta dt^2) + (1 - f) (gamma C / (beta dt) + K)``.
    """

    def __init__(self, system: System, step: float, weights: Weights) -> None:
        self.system, self.step, self.weights = system, step, weights
        self._inertia = 1.0 / (weights.beta * step**2)
        self._drag = weights.gamma / (weights.beta * step)
        kept = 1.0 - weights.force
        self.factor: Factor = system.factor(
            (1.0 - weights.mass) * self._inertia, kept * self._drag, kept
        )

    def start(self, u: Floats, v: Floats, force: Floats | None = None) -> Motion:
        """See `Stepper`."""
        return _start(self.system, u, v, force)

    def at_rest(self) -> Motion:
        """Return the undeformed system at rest."""
        return at_rest(self.system)

    def _predicted(self, motion: Motion) -> Floats:
        dt, beta = self.step, self.weights.beta
        found: Floats = motion.u + dt * motion.v + dt**2 * (0.5 - beta) * motion.a
        return found

    def free_motion(self, motion: Motion, force: Floats | None = None) -> Floats:
        """Return the displacement after a step under a force alone, shape (n,), m.

        `force` is that at ``1 - weights.force`` of the step.
        """
        w, system = self.weights, self.system
        predicted = self._predicted(motion)
        inertia = (1.0 - w.mass) * self._inertia * predicted
        if w.mass:
            inertia = inertia - w.mass * motion.a
        rhs = system.mass_times(inertia)
        if system.damped:
            velocity = motion.v + self.step * (1.0 - w.gamma) * motion.a - self._drag * predicted
            rhs = rhs - system.damping_times((1.0 - w.force) * velocity + w.force * motion.v)
        if w.force:
            rhs = rhs - w.force * system.stiffness_times(motion.u)
        if force is not None:
            rhs = rhs + force
        return self.factor.solve(rhs)

    def advance(self, motion: Motion, u: Floats) -> Motion:
        """Return the motion after a step that ends at a displacement."""
        a = self._inertia * (u - self._predicted(motion))
        gamma = self.weights.gamma
        v = motion.v + self.step * ((1.0 - gamma) * motion.a + gamma * a)
        return Motion(u, v, a)

    def advance_under(self, motion: Motion, before: Floats, after: Floats) -> Motion:
        """See `Stepper`."""
        share = self.weights.force
        force = after if share == 0.0 else (1.0 - share) * after + share * before
        return self.advance(motion, self.free_motion(motion, force))


class ExplicitStepper:
    """Central differences in velocity form; see `Stepper`.

    ``u1 = u + dt v + dt^2 a / 2``; the new acceleration balances the forces there, with half a
    step of it in the velocity that damping sees. The mass alone is factorised (with damping:
    ``M + dt C / 2``).
    """

    def __init__(self, system: System, step: float) -> None:
        self.system, self.step = system, step
        self.factor: Factor = system.factor(1.0, 0.5 * step if system.damped else 0.0, 0.0)

    def start(self, u: Floats, v: Floats, force: Floats | None = None) -> Motion:
        """See `Stepper`."""
        return _start(self.system, u, v, force)

    def advance_under(self, motion: Motion, before: Floats, after: Floats) -> Motion:
        """See `Stepper`."""
        del before  # balance is asked for at the step's end
        dt = self.step
        half = motion.v + 0.5 * dt * motion.a
        u = motion.u + dt * half
        rest = after - self.system.stiffness_times(u)
        if self.system.damped:
            rest = rest - self.system.damping_times(half)
        a = self.factor.solve(rest)
        return Motion(u, half + 0.5 * dt * a, a)


class StaticStepper:
    """Equilibrium after every step; velocity is the difference; see `Stepper`."""

    def __init__(self, system: System, step: float) -> None:
        self.system, self.step = system, step
        self.factor: Factor = system.factor(0.0, 0.0, 1.0)

    def start(self, u: Floats, v: Floats, force: Floats | None = None) -> Motion:
        """See `Stepper`; the displacement is that of equilibrium under the force, if given."""
        found = u.copy() if force is None else self.factor.solve(force)
        return Motion(found, v.copy(), np.zeros_like(v))

    def advance_under(self, motion: Motion, before: Floats, after: Floats) -> Motion:
        """See `Stepper`."""
        del before
        u = self.factor.solve(after)
        return Motion(u, (u - motion.u) / self.step, np.zeros_like(u))
