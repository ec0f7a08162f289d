"""Checks of an integrator on one degree of freedom, and its energy drift on a tissue."""

from collections.abc import Callable, Collection

import numpy as np
from scipy.linalg import expm

from needlefem._arrays import Floats
from needlefem.checks.result import CheckResult, outcome
from needlefem.dynamics import (
    Integrator,
    KinematicState,
    MatrixSystem,
    Newmark,
    TissueEnergyBalance,
    TissueSystem,
    kinetic_energy,
)
from needlefem.dynamics.steppers import Load, iterate, last
from needlefem.errors import CaseError
from needlefem.fem.tissue_model import TissueModel


def energy_drift(model: TissueModel, step: float, count: int, lumping: str | None = None) -> float:
    """Return the largest relative change of energy over `count` free steps of `step` s.

    The integrator is the average acceleration without damping; the motion starts at rest from a
    smooth displacement. The energy is evaluated a hundred times.
    """
    system = TissueSystem(model, lumping=lumping)
    dynamics = Newmark().stepper(system, step)

    def energy_of(motion: KinematicState) -> float:
        return kinetic_energy(system, motion.v) + system.strain_energy(motion.u)

    shape = np.sin(np.pi * (model.nodes - model.nodes.min(axis=0)) / np.ptp(model.nodes, axis=0))
    field = np.zeros(model.ndofs)
    field[model.node_dofs] = np.prod(shape, axis=1)[:, None] * np.arange(1, model.dim + 1)
    start = model.unknowns(field)
    motion = dynamics.start(start, np.zeros_like(start))
    energy, drift = energy_of(motion), 0.0
    for number in range(1, count + 1):
        motion = dynamics.advance(motion, dynamics.free_displacement(motion))
        if number % max(1, count // 100) == 0:
            drift = max(drift, abs(energy_of(motion) / energy - 1.0))
    return drift


# Checks of an integrator on one degree of freedom.


DAMPED_RATIO = 0.1
"""Damping ratio in checks with damping."""
BRANCH_TIME = 0.7
"""Relaxation time of the viscoelastic oscillator, in units of that of its relaxed spring."""

GROWTH = 1e-7
"""Growth of a free motion per step that is round-off; coinciding eigenvalues have half of the
digits."""
GRID = np.geomspace(1e-2, 1e3, 101)
"""Products of step and angular frequency at which the stability is evaluated."""


class Oscillator(MatrixSystem):
    """Return a mass on a spring with angular frequency 1 and a given damping ratio."""

    def __init__(self, ratio: float = 0.0) -> None:
        one = np.ones((1, 1))
        super().__init__(one, one, 2.0 * ratio * one if ratio else None)


class Forgetful(MatrixSystem):
    """Return a mass on a spring with a parallel Maxwell branch of the same stiffness."""

    def __init__(self, time: float) -> None:
        one = np.ones((1, 1))
        super().__init__(one, one, branches=[(time, one)])


def amplification(integrator: Integrator, step: float, ratio: float = 0.0) -> Floats:
    """Return the matrix of a free step for ``(u, dt v, dt^2 a)``, shape (3, 3).

    `step` is the angular frequency times the time step.
    """
    stepper = integrator.stepper(Oscillator(ratio), step)
    scale = np.array([1.0, step, step**2])
    columns = []
    for unit in np.eye(3):
        u, v, a = (np.array([x]) for x in unit / scale)
        zero = np.zeros(1)
        moved = stepper.step_under_load(KinematicState(u, v, a), zero, zero)
        columns.append(scale * np.concatenate([moved.u, moved.v, moved.a]))
    return np.array(columns).T


def spectral_radius(integrator: Integrator, step: float, ratio: float = 0.0) -> float:
    """Return the spectral radius of a free step."""
    return float(np.abs(np.linalg.eigvals(amplification(integrator, step, ratio))).max())


def principal(integrator: Integrator, step: float, ratio: float = 0.0) -> complex:
    """Return the principal eigenvalue of a free step (in the upper half plane)."""
    values = np.linalg.eigvals(amplification(integrator, step, ratio))
    exact = np.exp(complex(-ratio, np.sqrt(1.0 - ratio**2)) * step)
    return complex(values[np.argmin(np.abs(values - exact))])


def period_error(integrator: Integrator, step: float) -> float:
    """Return the relative error of the period of a free undamped motion."""
    return step / abs(float(np.angle(principal(integrator, step)))) - 1.0


def _final_error(integrator: Integrator, count: int, load: Load | None, *, memory: bool) -> float:
    """Return the error of displacement and velocity at time 2, with or without a load."""
    system = Forgetful(BRANCH_TIME) if memory else Oscillator(DAMPED_RATIO)
    stepper = integrator.stepper(system, 2.0 / count)
    first = np.zeros(1) if load is None else load(0.0)
    motion = stepper.start(np.array([0.3]), np.array([-0.2]), first)
    found = last(iterate(stepper, motion, load, count))
    exact = _exact(2.0, pushed=load is not None, memory=memory)
    return float(np.linalg.norm(np.concatenate([found.u, found.v]) - exact))


def _push(time: float) -> Floats:
    return np.array([np.sin(1.7 * time)])


def _exact(time: float, *, pushed: bool, memory: bool) -> Floats:
    """Return displacement and velocity of the oscillator from its matrix exponential."""
    rate = np.zeros((5, 5))  # displacement, velocity, branch, load and its rate
    rate[0, 1], rate[1, 0] = 1.0, -1.0
    if memory:
        rate[1, 2], rate[2, 1], rate[2, 2] = -1.0, 1.0, -1.0 / BRANCH_TIME
    else:
        rate[1, 1] = -2.0 * DAMPED_RATIO
    rate[1, 3] = 1.0 if pushed else 0.0
    rate[3, 4], rate[4, 3] = 1.0, -(1.7**2)  # the load is harmonic
    found: Floats = expm(rate * time) @ np.array([0.3, -0.2, 0.0, 0.0, 1.7])
    return found[:2]


def order(integrator: Integrator, *, pushed: bool, memory: bool = False) -> float:
    """Return the observed order of convergence in time, with or without a load.

    The oscillator has a dashpot or a viscoelastic branch.
    """
    load = _push if pushed else None
    errors = [_final_error(integrator, count, load, memory=memory) for count in (400, 800)]
    return float(np.log2(errors[0] / errors[1]))


def check_integrator(
    integrator: Integrator, theory: float = 2.0, names: Collection[str] = ()
) -> tuple[CheckResult, ...]:
    """Return the results of the checks of an integrator with inertia: all, or those of `names`.

    Parameters
    ----------
    integrator : Integrator
    Theoretical order of convergence.
    names : collection of str
        Names of checks; all if empty.
    """
    loose = theory < 2.0
    checks: dict[str, tuple[str, Callable[[], float], float]] = {
        "order, free": (f"errors fall with power {theory:g} of the step",
                        lambda: abs(order(integrator, pushed=False) - theory), 0.05),
        "order, pushed": (f"errors under a load fall with power {theory:g} of the step",
                          lambda: abs(order(integrator, pushed=True) - theory), 0.05),
        "order, memory": (f"errors of viscoelastic tissue fall with power {theory:g} of the step",
                          lambda: abs(order(integrator, pushed=True, memory=True) - theory), 0.05),
        "stability": ("no free motion grows for steps below the critical step",
                      lambda: _largest_radius(integrator) - 1.0, GROWTH),
        "damping": ("a free motion decays with a tenth of critical damping",
                    lambda: _damping_error(integrator), 2e-2 if loose else 1e-3),
        "period": ("the period of slow motion is correct",
                   lambda: abs(period_error(integrator, 0.02)), 1e-4),
        "energy": ("the work equals kinetic and strain energy plus dissipation",
                   lambda: energy_taken(integrator), 2e-2 if loose else 1e-4),
        "free flight": ("a body without supports keeps its velocity",
                        lambda: _flight(integrator), 1e-12),
        "free fall": ("a constant force on a free body gives a constant acceleration",
                      lambda: _fall(integrator), 1e-10),
        "rest": ("a constant load with damping ends in equilibrium",
                 lambda: _equilibrium(integrator), 1e-9),
    }  # fmt: skip
    return tuple(
        outcome(name, requirement, measure(), bound)
        for name, (requirement, measure, bound) in checks.items()
        if name in names or not names
    )


def _damping_error(integrator: Integrator) -> float:
    decay = -np.log(abs(principal(integrator, 0.02, DAMPED_RATIO))) / 0.02
    return float(abs(decay / DAMPED_RATIO - 1.0))


def _largest_radius(integrator: Integrator) -> float:
    """Return the largest spectral radius over the accepted steps of the grid."""
    accepted = [float(step) for step in GRID if _accepts(integrator, float(step))]
    return max(spectral_radius(integrator, step) for step in accepted)


def _accepts(integrator: Integrator, step: float) -> bool:
    try:
        integrator.stepper(Oscillator(), step)
    except CaseError:  # explicit integrators refuse steps above their limit
        return False
    return True


def stability_limit(integrator: Integrator) -> float:
    """Return the largest accepted ``w dt`` for which no free motion grows.

    The result is infinite if no limit is found up to 1e3.
    """

    def holds(step: float) -> bool:
        if not _accepts(integrator, step):
            return False
        return spectral_radius(integrator, step) <= 1.0 + GROWTH

    beyond = next((float(step) for step in GRID if not holds(float(step))), np.inf)
    low, high = 0.0, beyond
    while np.isfinite(high) and high - low > 1e-6 * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if holds(middle) else (low, middle)
    return high


def energy_taken(integrator: Integrator) -> float:
    """Return the algorithmic dissipation of a damped oscillator, relative to the absolute work."""
    step = 0.01
    stepper = integrator.stepper(Oscillator(DAMPED_RATIO), step)
    balance = TissueEnergyBalance(stepper)
    motion = stepper.start(np.array([0.3]), np.array([-0.2]), _push(0.0))
    for number in range(2000):
        before, after = _push(step * number), _push(step * (number + 1))
        old, motion = motion, stepper.step_under_load(motion, before, after)
        balance.add(old, motion, before, after)
    return abs(balance.algorithmic) / balance.total_absolute_work + balance.residual


def measured(integrator: Integrator) -> dict[str, float]:
    """Return characteristic numbers of an integrator by name."""
    accepted = [step for step in (0.1, 1.0, 10.0, 1e3) if _accepts(integrator, step)]
    return {
        "order": order(integrator, pushed=True),
        "period error at dt = T/20": period_error(integrator, 0.1 * np.pi),
        "energy taken": energy_taken(integrator),
        "stability limit of w dt": stability_limit(integrator),
        **{f"spectral radius at w dt = {step:g}": spectral_radius(integrator, step)
           for step in accepted},
    }  # fmt: skip


def _loose() -> MatrixSystem:
    """Return a mass with a very weak spring."""
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
