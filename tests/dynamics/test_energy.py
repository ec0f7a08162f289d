"""The energy ledger of time integration: its terms against a continuous solution, its residual."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from needlefem._arrays import Floats
from needlefem.dynamics import (
    HHT,
    AlphaParameters,
    CentralDifference,
    GeneralizedAlpha,
    Integrator,
    MatrixSystem,
    MaxwellUpdate,
    Newmark,
    QuasiStatic,
    TissueEnergyBalance,
)
from needlefem.dynamics import energy as module

MASS = np.array([[2.0, 0.3], [0.3, 1.0]])
STIFFNESS = np.array([[5.0, -2.0], [-2.0, 3.0]])
DAMPING = np.array([[0.4, -0.1], [-0.1, 0.2]])
BRANCH = np.array([[1.0, -0.5], [-0.5, 2.0]])
TIME = 0.7
FIRST = np.array([0.2, -0.1]), np.array([0.5, 0.3])
DYNAMIC = [
    Newmark(), Newmark(beta=0.4, gamma=0.7), HHT(alpha=-0.2), GeneralizedAlpha(rho_inf=0.5),
    CentralDifference(),
]  # fmt: skip


def push(time: float) -> Floats:
    return np.array([np.sin(1.3 * time), np.cos(0.4 * time) - 0.5])


def system(*, branches: bool = True) -> MatrixSystem:
    return MatrixSystem(MASS, STIFFNESS, DAMPING, [(TIME, BRANCH)] if branches else [])


def moved(integrator: Integrator, step: float, end: float) -> TissueEnergyBalance:
    """Return the ledger of a forced motion."""
    stepper = integrator.stepper(system(), step)
    balance, motion = TissueEnergyBalance(stepper), stepper.start(*FIRST, push(0.0))
    for number in range(round(end / step)):
        before, after = push(step * number), push(step * (number + 1))
        old, motion = motion, stepper.step_under_load(motion, before, after)
        balance.add(old, motion, before, after)
    return balance


def continuous(end: float) -> dict[str, float]:
    """Return the same terms from the differential equations, by a method of order eight."""

    def rate(time: float, y: Floats) -> Floats:
        u, v, part = y[:2], y[2:4], y[4:6]
        force = push(time)
        a = np.linalg.solve(MASS, force - DAMPING @ v - STIFFNESS @ u - BRANCH @ part)
        powers = [force @ v, v @ DAMPING @ v, part @ BRANCH @ part / TIME]
        return np.concatenate([v, a, v - part / TIME, powers])

    start = np.concatenate([*FIRST, np.zeros(5)])
    end_state = solve_ivp(rate, (0.0, end), start, method="DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
    u, v, part = end_state[:2], end_state[2:4], end_state[4:6]
    return {
        "work": end_state[6],
        "damping": end_state[7],
        "relaxation": end_state[8],
        "kinetic": 0.5 * (v @ MASS @ v - FIRST[1] @ MASS @ FIRST[1]),
        "strain": 0.5 * (u @ STIFFNESS @ u - FIRST[0] @ STIFFNESS @ FIRST[0]),
        "stored": 0.5 * part @ BRANCH @ part,
    }


@pytest.mark.parametrize("integrator", DYNAMIC)
def test_terms_tend_to_those_of_the_differential_equation(integrator: Integrator) -> None:
    found, wanted = moved(integrator, 2e-3, 4.0), continuous(4.0)
    for name, value in wanted.items():
        limit = 5e-3 * found.total_absolute_work
        assert getattr(found, name) == pytest.approx(value, abs=limit), name
    assert abs(found.algorithmic) <= 5e-3 * found.total_absolute_work
    assert found.residual <= 1e-10


@pytest.mark.parametrize("integrator", DYNAMIC)
def test_long_steps_lose_to_the_integrator_what_is_missing_elsewhere(
    integrator: Integrator,
) -> None:
    found = moved(integrator, 0.25, 50.0)
    assert found.residual <= 1e-12
    taken = abs(found.algorithmic) / found.total_absolute_work
    assert taken > 1e-4 or (integrator == Newmark() and taken <= 1e-12)


def test_undamped_newmark_takes_what_its_known_balance_says() -> None:
    """The free motion's ``d(T + V + (b - g/2) dt^2 a.Ma / 2)`` is never above zero."""
    beta, gamma, step = 0.4, 0.7, 0.3
    stepper = Newmark(beta=beta, gamma=gamma).stepper(MatrixSystem(MASS, STIFFNESS), step)
    balance, motion = TissueEnergyBalance(stepper), stepper.start(*FIRST)
    none, late = np.zeros(2), step**2 * (beta - 0.5 * gamma)
    for _ in range(20):
        old, motion = motion, stepper.step_under_load(motion, none, none)
        before = balance.algorithmic
        balance.add(old, motion, none, none)
        du, da = motion.u - old.u, motion.a - old.a
        kept = 0.5 * late * (motion.a @ MASS @ motion.a - old.a @ MASS @ old.a)
        lost = (gamma - 0.5) * (du @ STIFFNESS @ du + late * da @ MASS @ da)
        assert balance.algorithmic - before == pytest.approx(kept + lost, abs=1e-14)


@pytest.mark.parametrize("integrator", [GeneralizedAlpha(), CentralDifference()])
@pytest.mark.parametrize("wrong", ["kinetic", "damping", "relaxation", "stored", "strain"])
def test_a_wrong_term_shows_in_the_residual(
    integrator: Integrator, wrong: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def changed(function: Callable[..., float]) -> Callable[..., float]:
        return lambda *arguments, **options: 1.001 * function(*arguments, **options)

    if wrong == "kinetic":
        monkeypatch.setattr(module, "kinetic_energy", changed(module.kinetic_energy))
    elif wrong == "strain":
        name = "strain_energy"
        monkeypatch.setattr(MatrixSystem, name, changed(MatrixSystem.strain_energy))
    elif wrong in ("relaxation", "stored"):
        name = {"relaxation": "lost", "stored": "energy"}[wrong]
        monkeypatch.setattr(MaxwellUpdate, name, changed(getattr(MaxwellUpdate, name)))
    found = moved(integrator, 0.05, 4.0)
    if wrong == "damping":
        found.damping *= 1.001
    assert found.residual > 1e-6


def test_a_force_that_the_motion_does_not_have_shows_in_the_residual() -> None:
    stepper = GeneralizedAlpha().stepper(system(), 0.05)
    balance, motion = TissueEnergyBalance(stepper), stepper.start(*FIRST, push(0.0))
    new = stepper.step_under_load(motion, push(0.0), push(0.05))
    balance.add(motion, new, push(0.0), 1.01 * push(0.05))
    assert balance.residual > 1e-5


def test_equilibrium_step_by_step_takes_nothing() -> None:
    stepper = QuasiStatic().stepper(system(), 0.1)
    balance, motion = TissueEnergyBalance(stepper), stepper.start(np.zeros(2), np.zeros(2))
    force = np.zeros(2)
    for number in range(1, 40):
        before, force = force, push(0.1 * number)
        old, motion = motion, stepper.step_under_load(motion, before, force)
        balance.add(old, motion, before, force)
    assert abs(balance.algorithmic) <= 1e-13 * balance.total_absolute_work
    assert balance.residual <= 1e-13


def test_what_a_foreign_integrator_takes_is_missing() -> None:
    class Foreign:
        """A stepper of unknown making, which loses a hundredth of the velocity in every step."""

        def __init__(self) -> None:
            self._own = Newmark().stepper(system(branches=False), 0.1)
            self.system, self.step = self._own.system, self._own.step

    stepper = Foreign()
    assert not hasattr(stepper, "weights")
    assert stepper._own.weights == AlphaParameters(0.0, 0.0, 0.25, 0.5)
    balance, none = TissueEnergyBalance(stepper), np.zeros(2)  # type: ignore[arg-type]
    motion = stepper._own.start(*FIRST)
    new = stepper._own.step_under_load(motion, none, none)
    new.v *= 0.99
    balance.add(motion, new, none, push(0.1))
    assert balance.algorithmic == 0.0
    assert balance.residual > 1e-3
