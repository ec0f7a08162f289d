import numpy as np
import pytest

from needlefem import build_model
from needlefem.checks import energy_drift
from needlefem.dynamics import Damping, Newmark, TissueSystem, kinetic_energy
from needlefem.errors import CaseError
from needlefem.scene import Scene, vary

CALM = Newmark(beta=0.3025, gamma=0.6)


def energy(dynamics: object, motion: object) -> float:
    system = dynamics.system
    return kinetic_energy(system, motion.v) + system.strain_energy(motion.u)


def test_one_mode_has_newmarks_period(gel: Scene) -> None:
    """Average acceleration turns a mode by 2 atan(w dt / 2) a step (T. J. R. Hughes 2000)."""
    from scipy.linalg import eigh

    model = build_model(vary(gel, {"mesh.divisions": (4, 4)}))
    squares, shapes = eigh(
        model.free_block(model.stiffness.matrix).toarray(), model.free_block(model.mass).toarray()
    )
    shape, omega = shapes[:, 0], np.sqrt(squares[0])
    dynamics = Newmark().stepper(TissueSystem(model), 0.3 / omega)
    motion = dynamics.start(shape, np.zeros_like(shape))
    for _ in range(50):
        motion = dynamics.advance(motion, dynamics.free_displacement(motion))
    amplitude = float(shape @ (dynamics.system.mass @ motion.u))
    assert amplitude == pytest.approx(np.cos(50 * 2.0 * np.arctan(0.15)), abs=1e-8)


def test_rayleigh_damping_slows_down(gel: Scene) -> None:
    model = build_model(vary(gel, {"mesh.divisions": (4, 4)}))
    rest = np.random.default_rng(1).normal(size=len(model.free_dofs))
    energies = []
    for damping in (Damping(), Damping(mass_rate=10.0, stiffness_time=1e-3)):
        dynamics = Newmark().stepper(TissueSystem(model, damping), 1e-3)
        motion = dynamics.start(rest, np.zeros_like(rest))
        start = energy(dynamics, motion)
        for _ in range(100):
            motion = dynamics.advance(motion, dynamics.free_displacement(motion))
        energies.append(energy(dynamics, motion) / start)
    assert energies[0] == pytest.approx(1.0, abs=1e-10)
    assert energies[1] < 0.5


def test_a_constant_force_ends_in_static_equilibrium(gel: Scene) -> None:
    model = build_model(vary(gel, {"mesh.divisions": (4, 4)}))
    force = np.random.default_rng(1).normal(size=len(model.free_dofs))
    dynamics = CALM.stepper(TissueSystem(model, Damping(mass_rate=50.0)), 0.1)
    motion = dynamics.at_rest()
    for _ in range(400):
        motion = dynamics.advance(motion, dynamics.free_displacement(motion, force))
    assert motion.u == pytest.approx(model.factor.solve(force), rel=1e-6, abs=1e-12)


def test_lumped_mass_keeps_energy_too(gel: Scene) -> None:
    model = build_model(vary(gel, {"mesh.divisions": (4, 4)}))
    assert energy_drift(model, 1e-3, 200) < 1e-11
    lumped = TissueSystem(model, lumping="row-sum")
    assert lumped.mass.nnz == len(model.free_dofs)


def test_unstable_parameters_are_refused() -> None:
    with pytest.raises(CaseError, match="keep 2 beta >= gamma >= 1/2"):
        Newmark(beta=0.0, gamma=0.5)


def test_tissue_without_mass_is_refused(gel: Scene) -> None:
    model = build_model(vary(gel, {"materials.gel.density": 0.0}))
    with pytest.raises(CaseError, match="has no density, which inertia needs"):
        TissueSystem(model)
