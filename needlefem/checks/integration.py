"""Properties of an integrator, measured on one degree of freedom."""

import numpy as np

from needlefem.arrays import Floats
from needlefem.checks.result import CheckResult, outcome
from needlefem.dynamics import Damping, Integrator, MatrixSystem, Motion
from needlefem.dynamics.histories import Load, iterate, last
from needlefem.errors import CaseError

DAMPED_RATIO = 0.1
"""Share of critical damping in the checks that need some."""


class Oscillator(MatrixSystem):
    """One mass on a spring of angular frequency 1, damped by a share of the critical."""

    def __init__(self, ratio: float = 0.0) -> None:
        one = np.ones((1, 1))
        super().__init__(one, one, 2.0 * ratio * one if ratio else None)
        self.rayleigh = Damping(mass_rate=2.0 * ratio)


def amplification(integrator: Integrator, step: float, ratio: float = 0.0) -> Floats:
    """Return the matrix that takes ``(u, dt v, dt^2 a)`` over a free step, shape (3, 3).

    `step` is the angular frequency times the time step.
    """
    stepper = integrator.stepper(Oscillator(ratio), step)
    scale = np.array([1.0, step, step**2])
    columns = []
    for unit in np.eye(3):
        u, v, a = (np.array([x]) for x in unit / scale)
        zero = np.zeros(1)
        moved = stepper.advance_under(Motion(u, v, a), zero, zero)
        columns.append(scale * np.concatenate([moved.u, moved.v, moved.a]))
    return np.array(columns).T


def spectral_radius(integrator: Integrator, step: float, ratio: float = 0.0) -> float:
    """Return the largest eigenvalue of a free step, absolute."""
    return float(np.abs(np.linalg.eigvals(amplification(integrator, step, ratio))).max())


def principal(integrator: Integrator, step: float, ratio: float = 0.0) -> complex:
    """Return the eigenvalue of a free step that stands for the motion (upper half plane)."""
    values = np.linalg.eigvals(amplification(integrator, step, ratio))
    exact = np.exp(complex(-ratio, np.sqrt(1.0 - ratio**2)) * step)
    return complex(values[np.argmin(np.abs(values - exact))])


def period_error(integrator: Integrator, step: float) -> float:
    """Return the relative error of the period of a free, undamped motion."""
    return step / abs(float(np.angle(principal(integrator, step)))) - 1.0


def _final_error(integrator: Integrator, count: int, load: Load | None) -> float:
    """Return the error of displacement and velocity at time 2, damped, pushed or free."""
    system, step = Oscillator(DAMPED_RATIO), 2.0 / count
    stepper = integrator.stepper(system, step)
    first = np.zeros(1) if load is None else load(0.0)
    motion = stepper.start(np.array([0.3]), np.array([-0.2]), first)
    found = last(iterate(stepper, motion, load, count))
    return float(np.linalg.norm(np.concatenate([found.u, found.v]) - _exact(2.0, load is not None)))


def _push(time: float) -> Floats:
    return np.array([np.sin(1.7 * time)])


def _exact(time: float, pushed: bool) -> Floats:
    """Return displacement and velocity of the oscillator, by its matrix exponential."""
    rate = np.zeros((4, 4))
    rate[0, 1], rate[1, 0], rate[1, 1] = 1.0, -1.0, -2.0 * DAMPED_RATIO
    rate[1, 2] = 1.0 if pushed else 0.0
    rate[2, 3], rate[3, 2] = 1.0, -(1.7**2)  # the push is itself an oscillator
    values, vectors = np.linalg.eig(rate)
    start = np.array([0.3, -0.2, 0.0, 1.7])
    state = vectors @ (np.exp(values * time) * np.linalg.solve(vectors, start.astype(complex)))
    found: Floats = state.real[:2]
    return found


def order(integrator: Integrator, *, pushed: bool) -> float:
    """Return the observed order of convergence in time, damped; pushed or free."""
    load = _push if pushed else None
    coarse, fine = (_final_error(integrator, count, load) for count in (400, 800))
    return float(np.log2(coarse / fine))


def check_integrator(integrator: Integrator, theory: float = 2.0) -> tuple[CheckResult, ...]:
    """Run every check of an integrator that moves mass; `theory` is its order."""
    free, pushed = order(integrator, pushed=False), order(integrator, pushed=True)
    return (
        outcome("order, free", f"errors fall with power {theory:g} of the step",
                abs(free - theory), 0.05),
        outcome("order, pushed", f"so they do under a load: power {theory:g}",
                abs(pushed - theory), 0.05),
        outcome("stability", "no free motion grows, for steps below the stable one",
                max(spectral_radius(integrator, step) for step in _steps(integrator)) - 1.0, 1e-7),
        outcome("damping", "a tenth of critical damping shows in a free motion",
                abs(-np.log(abs(principal(integrator, 0.02, DAMPED_RATIO))) / 0.02 / DAMPED_RATIO
                    - 1.0), 1e-3 if theory >= 2.0 else 2e-2),
        outcome("period", "the period of slow motion is right",
                abs(period_error(integrator, 0.02)), 1e-4),
        outcome("free flight", "a body that nothing holds flies straight on", _flight(integrator),
                1e-12),
        outcome("free fall", "a constant force on it gives a constant acceleration",
                _fall(integrator), 1e-10),
        outcome("rest", "a load that is held ends in equilibrium", _equilibrium(integrator), 1e-9),
    )  # fmt: skip


def _steps(integrator: Integrator) -> tuple[float, ...]:
    """Return steps that the integrator accepts, up to 1e3 times the period's."""
    accepted = []
    for step in (0.1, 1.0, 1.9, 10.0, 1e3):
        try:
            integrator.stepper(Oscillator(), step)
        except CaseError:  # explicit ones refuse what is above their limit
            continue
        accepted.append(step)
    return tuple(accepted)


def _loose() -> MatrixSystem:
    """Return a mass that almost nothing holds."""
    return MatrixSystem(np.ones((1, 1)), 1e-30 * np.ones((1, 1)))


def _flight(integrator: Integrator) -> float:
    stepper = integrator.stepper(_loose(), 0.1)
    motion = stepper.start(np.array([1.0]), np.array([2.0]))
    found = last(iterate(stepper, motion, None, 50))
    return float(abs(found.u[0] - 11.0) + abs(found.v[0] - 2.0))


def _fall(integrator: Integrator) -> float:
    stepper = integrator.stepper(_loose(), 0.1)
    force = np.array([3.0])
    motion = stepper.start(np.zeros(1), np.zeros(1), force)
    found = last(iterate(stepper, motion, lambda _: force, 50))
    return float(abs(found.u[0] - 37.5) + abs(found.v[0] - 15.0))


def _equilibrium(integrator: Integrator) -> float:
    stepper = integrator.stepper(Oscillator(0.5), 0.2)
    force = np.array([2.0])
    motion = stepper.start(np.zeros(1), np.zeros(1), force)
    return float(abs(last(iterate(stepper, motion, lambda _: force, 400)).u[0] - 2.0))
