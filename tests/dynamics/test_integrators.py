from typing import Any

import numpy as np
import pytest

from needlefem.checks import Oscillator, rectangle, spectral_radius, stability_limit
from needlefem.dynamics import (
    HHT,
    CentralDifference,
    Damping,
    GeneralizedAlpha,
    Integrator,
    MatrixSystem,
    Newmark,
    QuasiStatic,
    TissueEnergyBalance,
    TissueSystem,
    at_rest,
    constant,
    critical_step,
    integrator_class,
    iterate,
    last,
    ramp,
    switched,
    table,
    together,
)
from needlefem.elements import CATALOGUE
from needlefem.errors import CaseError
from needlefem.materials import Isotropic

ONE = np.ones((1, 1))
GEL = Isotropic(youngs_modulus=1.0, poissons_ratio=0.3, density=1.0)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Newmark(beta=0.1, gamma=0.5), "not unconditionally stable; keep 2 beta"),
        (lambda: Newmark(gamma=0.4), "gamma 0.4"),
        (lambda: HHT(alpha=0.1), "alpha 0.1 is out of range; keep -1/3 to 0"),
        (lambda: GeneralizedAlpha(rho_inf=1.5), "rho_inf 1.5 is out of range; keep 0 to 1"),
        (lambda: integrator_class("newmerk", "--integrator"), "did you mean 'newmark'"),
        (lambda: Damping.from_ratios((2.0, 2.0), (0.1, 0.1)), "give two different ones"),
    ],
)
def test_what_can_not_be_used_is_answered(make, message: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(CaseError, match=message):
        make()


def test_a_step_above_the_limit_is_refused_and_named() -> None:
    system = MatrixSystem(ONE, 4.0 * ONE)
    assert critical_step(system) == pytest.approx(1.0)
    with pytest.raises(CaseError, match=r"1\.01 s is above the stable 1 s"):
        CentralDifference().stepper(system, 1.01)


@pytest.mark.parametrize("ratio", [0.0, 0.1, 1.0, 3.0])
def test_the_limit_is_the_same_with_damping(ratio: float) -> None:
    explicit = CentralDifference(refuse_unstable=False)
    assert critical_step(Oscillator(ratio)) == pytest.approx(2.0)
    assert spectral_radius(explicit, 1.999, ratio) <= 1.0 + 1e-12
    assert spectral_radius(explicit, 2.001, ratio) > 1.0 + 1e-4


def test_measured_stability_limits() -> None:
    assert stability_limit(CentralDifference()) == pytest.approx(2.0, abs=1e-5)
    assert stability_limit(CentralDifference(refuse_unstable=False)) == pytest.approx(2.0, abs=1e-5)
    assert stability_limit(Newmark()) == np.inf


def test_branches_lower_the_limit() -> None:
    one, branched = MatrixSystem(ONE, ONE), MatrixSystem(ONE, ONE, branches=[(1.0, 3.0 * ONE)])
    assert critical_step(branched) == pytest.approx(0.5 * critical_step(one))


@pytest.mark.parametrize("element", ["P2", "P2-P1"])
def test_products_are_those_of_the_matrices(element: str) -> None:
    model = rectangle(CATALOGUE[element], GEL, 2)
    damping = Damping(mass_rate=0.3, stiffness_time=0.7)
    system = TissueSystem(model, damping)
    a, v, u = np.random.default_rng(2).normal(size=(3, system.size))
    drag = 0.3 * system.mass_times(v) + 0.7 * system.stiffness_times(v)
    whole = system.mass_times(a) + drag + system.stiffness_times(u)
    assert system.products(a, v, u) == pytest.approx(whole, abs=1e-12)
    assert system.products(None, v, None) == pytest.approx(drag, abs=1e-12)
    assert not system.products(None, None, None).any()
    solved = system.factor(2.0, 1.0, 3.0).solve(2.0 * system.mass_times(u) + (
        0.3 * system.mass_times(u) + 0.7 * system.stiffness_times(u)
    ) + 3.0 * system.stiffness_times(u))  # fmt: skip
    assert solved == pytest.approx(u, abs=1e-9)


def test_a_tissue_without_mass_has_no_dynamics() -> None:
    law = Isotropic(youngs_modulus=1.0, poissons_ratio=0.3, density=0.0)
    with pytest.raises(CaseError, match="has no density, which inertia needs"):
        TissueSystem(rectangle(CATALOGUE["P1"], law, 2))


def test_an_unknown_face_is_answered() -> None:
    system = TissueSystem(rectangle(CATALOGUE["P1"], GEL, 2))
    with pytest.raises(CaseError, match=r"no face 'y_mux'; did you mean 'y_max'\?"):
        system.traction("y_mux", np.zeros_like)


def test_body_force_and_traction_carry_their_totals() -> None:
    model = rectangle(CATALOGUE["P2"], GEL, 3, (2.0, 1.0))
    system = TissueSystem(model, lumping=None)
    pull = system.traction("y_max", lambda points: np.tile([5.0, 0.0], (len(points), 1)))
    assert pull.sum() == pytest.approx(5.0)
    weight = model.body_load(lambda points: np.tile([0.0, 3.0], (len(points), 1)))
    assert weight.sum() == pytest.approx(6.0)


def test_loads_in_time() -> None:
    force = np.array([2.0])
    assert ramp(force, 4.0)(1.0) == pytest.approx(0.5)
    assert ramp(force, 4.0)(9.0) == pytest.approx(2.0)
    pulse = switched(force, 1.0, 2.0)
    assert [pulse(time)[0] for time in (0.9, 1.0, 1.9, 2.0)] == [0.0, 2.0, 2.0, 0.0]
    assert switched(force, 1.0)(1e9) == pytest.approx(2.0)
    steps = table(np.array([0.0, 1.0, 3.0]), np.array([0.0, 1.0, 0.0]), force)
    assert steps(2.0) == pytest.approx(1.0)
    assert together(steps, constant(force))(2.0) == pytest.approx(3.0)


def test_slow_motion_is_quasi_static() -> None:
    model = rectangle(CATALOGUE["Q1"], GEL, 3)
    system = TissueSystem(model, Damping(mass_rate=0.5))
    force = system.traction("y_max", lambda points: np.tile([0.0, 0.01], (len(points), 1)))
    slow = ramp(force, 2000.0)
    rest = np.zeros(system.size)
    ends = []
    for integrator in (GeneralizedAlpha(rho_inf=0.5), QuasiStatic()):
        stepper = integrator.stepper(system, 5.0)
        ends.append(last(iterate(stepper, stepper.start(rest, rest), slow, 500)).u)
    assert ends[0] == pytest.approx(ends[1], abs=1e-6 * np.abs(ends[1]).max())


@pytest.mark.parametrize("integrator", [
    Newmark(), HHT(), GeneralizedAlpha(), CentralDifference(), QuasiStatic(),
])  # fmt: skip
def test_steps_factorise_nothing(integrator: Integrator, monkeypatch: pytest.MonkeyPatch) -> None:
    system = TissueSystem(rectangle(CATALOGUE["P2"], GEL, 3), Damping(stiffness_time=0.1))
    counted: list[int] = []
    real = type(system).factor

    def counting(self: TissueSystem, *shares: Any) -> Any:
        counted.append(1)
        return real(self, *shares)

    monkeypatch.setattr(TissueSystem, "factor", counting)
    stepper = integrator.stepper(system, 1e-3)
    assert len(counted) == 1
    force = np.ones(system.size)
    last(iterate(stepper, at_rest(system), constant(force), 50))
    assert len(counted) == 1


def test_ledger_of_a_damped_fall_into_rest() -> None:
    system = MatrixSystem(ONE, ONE, 0.5 * ONE)
    stepper = Newmark().stepper(system, 0.1)
    force = np.array([1.0])
    motion, balance = stepper.start(np.zeros(1), np.zeros(1), force), TissueEnergyBalance(stepper)
    for _ in range(1000):
        old, motion = motion, stepper.step_under_load(motion, force, force)
        balance.add(old, motion, force, force)
    assert balance.work == pytest.approx(1.0, abs=1e-9)
    assert balance.strain == pytest.approx(0.5, abs=1e-9)
    assert balance.damping == pytest.approx(0.5, abs=1e-9)
    assert balance.residual < 1e-12
