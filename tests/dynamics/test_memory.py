import dataclasses

import numpy as np
import pytest

from needlefem.checks import rectangle
from needlefem.dynamics import Newmark, QuasiStatic, TissueSystem, constant, iterate, last
from needlefem.elements import CATALOGUE
from needlefem.errors import CaseError
from needlefem.insertion import Simulation
from needlefem.materials import (
    Branch,
    Isotropic,
    Viscoelastic,
    branches_of,
    load_factor,
    relaxation_factor,
)
from needlefem.scene import Scene, vary

LAW = Viscoelastic(youngs_modulus=3.0, poissons_ratio=0.3, density=1.0, shares=(0.4,), times=(2.0,))


def test_limits_of_a_step() -> None:
    assert (load_factor(0.0, 1.0), relaxation_factor(0.0, 1.0)) == (1.0, 1.0)
    assert (load_factor(np.inf, 1.0), relaxation_factor(np.inf, 1.0)) == (0.0, 0.0)
    assert load_factor(1e-9, 1.0) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"shares": (0.4, 0.2)}, "2 shares and 1 times; give one share and one time"),
        ({"shares": (1.0,)}, "material.shares: 1 is out of range; it must be above 0 and below 1"),
        ({"shares": (0.6, 0.4), "times": (2.0, 9.0)}, "shares add up to 1; keep the sum below 1"),
    ],
)
def test_wrong_series_are_answered(changes: dict[str, object], message: str) -> None:
    with pytest.raises(CaseError, match=message):
        dataclasses.replace(LAW, **changes)  # type: ignore[arg-type]


def test_moduli_at_once_and_in_the_end() -> None:
    shear = LAW.lame()[1]
    assert LAW.shear_modulus(0.0) == pytest.approx(shear / 0.6)
    assert LAW.shear_modulus(1e3) == pytest.approx(shear)
    assert LAW.complex_shear_modulus(1e6).real == pytest.approx(shear / 0.6)
    assert LAW.complex_shear_modulus(1e-9).imag == pytest.approx(0.0, abs=1e-6)


def test_what_can_not_relax_is_refused() -> None:
    with pytest.raises(CaseError, match="use plane strain"):
        branches_of(LAW, 2, "stress")

    class Squeezed(Isotropic):
        def branches(self) -> tuple[Branch, ...]:
            return (Branch(1.0, np.eye(6)),)

    with pytest.raises(CaseError, match="resistance to a change of shape may relax"):
        branches_of(Squeezed(youngs_modulus=1.0, poissons_ratio=0.3), 2, "strain")


def test_viscoelastic_tissue_is_stepped(gel: Scene) -> None:
    law = Viscoelastic(youngs_modulus=30e3, poissons_ratio=0.45, shares=(0.4,), times=(2.0,))
    scene = vary(gel, {"materials": {"gel": law}})
    assert Simulation(scene).scene.discretization.integrator == "quasi_static"
    with pytest.raises(
        CaseError, match="'path_following', but viscoelastic tissue depends on time"
    ):
        Simulation(vary(scene, {"discretization.integrator": "path_following"}))


def test_fast_motion_is_stiff_and_slow_motion_is_relaxed() -> None:
    model = rectangle(CATALOGUE["P2"], LAW, 3)
    system = TissueSystem(model)
    force = system.traction("y_max", lambda points: np.tile([0.0, 0.01], (len(points), 1)))
    rest = np.zeros(system.size)
    stepper = QuasiStatic().stepper(system, 0.5)
    begin = stepper.start(rest, rest, force)
    end = last(iterate(stepper, begin, constant(force), 200)).u
    elastic = Isotropic(youngs_modulus=3.0, poissons_ratio=0.3, density=1.0)
    relaxed = TissueSystem(rectangle(CATALOGUE["P2"], elastic, 3)).factor(0, 0, 1).solve(force)
    assert end == pytest.approx(relaxed, rel=1e-6)
    assert np.abs(begin.u).max() < 0.75 * np.abs(end).max()


def test_vibration_dies_out_by_relaxation_alone() -> None:
    model = rectangle(CATALOGUE["Q1"], LAW, 3)
    system = TissueSystem(model, lumping="row-sum")
    start = system.unknowns(lambda points: 0.01 * points)
    stepper = Newmark().stepper(system, 0.1)
    motion = last(iterate(stepper, stepper.start(start, 0.0 * start), None, 4000))
    assert np.abs(motion.u).max() < 1e-3 * np.abs(start).max()
