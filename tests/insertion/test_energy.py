"""No motion of a needle creates energy; each energy term is computed from its own definition."""

import dataclasses

import numpy as np
import pytest

from needlefem.insertion import Insertion, PathFollowing, Simulation, Status, TipPhase, energy_terms
from needlefem.materials import Isotropic, Viscoelastic
from needlefem.scene import Scene, Stage, vary

MOTIONS = {
    "in and out": (0.012, -0.004),
    "in and out twice": (0.008, -0.003, 0.013, -0.003),
    "to and fro": (0.01, 0.004, 0.013, 0.002, 0.006, -0.004),
}
SLOW = Viscoelastic(
    youngs_modulus=30e3, poissons_ratio=0.45, density=1000.0, shares=(0.5,), times=(1.0,)
)
STIFF = Isotropic(youngs_modulus=30e3, poissons_ratio=0.45, density=1000.0)
TISSUES = {
    "elastic": {"materials.gel": STIFF, "discretization.integrator": "quasi_static"},
    "viscoelastic": {"materials.gel": SLOW, "discretization.integrator": "quasi_static"},
    "dynamic": {
        "materials.gel": STIFF, "discretization.integrator": "generalized_alpha",
        "motion.speed": 0.05, "discretization.time_step": 0.01,
    },
    "dynamic and viscoelastic": {
        "materials.gel": SLOW, "discretization.integrator": "newmark",
        "motion.speed": 0.05, "discretization.time_step": 0.01,
    },
}  # fmt: skip


def moved(gel: Scene, tissue: str, depths: tuple[float, ...], **changes: object) -> Insertion:
    coarse = {"mesh.divisions": (10, 10), "discretization.path_spacing": 3e-3}
    stages = tuple(Stage(depth=depth) for depth in depths)
    scene = vary(gel, coarse | TISSUES[tissue] | {"motion.stages": stages} | changes)
    simulation = Simulation(scene)
    return simulation.move(simulation.entry_of_case())


@pytest.mark.parametrize("tissue", TISSUES)
@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("give", [0.0, 1e8])
def test_no_step_creates_energy(gel: Scene, tissue: str, motion: str, give: float) -> None:
    found = moved(gel, tissue, MOTIONS[motion], **{"needle.tangential_penalty": give})
    energies = energy_terms(found)
    assert found.outcome.status is Status.COMPLETED
    assert energies.largest_energy_gain <= 1e-9
    assert energies.residual <= 1e-11
    assert energies.strain_energy_mismatch <= 1e-11
    assert min(energies.friction, energies.cutting) > 0.0


@pytest.mark.parametrize("depths", [(0.01, -0.005), (0.01, -0.005, 0.008, -0.002)])
def test_pressing_elastic_skin_without_cutting_it_takes_no_work(
    gel: Scene, depths: tuple[float, ...]
) -> None:
    found = moved(gel, "elastic", depths, **{"needle.cutting_force": 1e9})
    energies = energy_terms(found)
    assert abs(energies.work) <= 1e-12 * energies.total_absolute_work
    changes = [n for n, s in enumerate(found.states[1:], 1) if _leaves(found, n) and s.depth < 1e-4]
    assert changes
    for number in changes:
        assert found.states[number].depth == pytest.approx(0.0, abs=1e-12)


def _leaves(found: Insertion, number: int) -> bool:
    return (
        found.states[number].tip_phase is TipPhase.OUTSIDE is not found.states[number - 1].tip_phase
    )


@pytest.mark.parametrize("tissue", ["viscoelastic", "dynamic", "dynamic and viscoelastic"])
@pytest.mark.parametrize("cut", [False, True])
def test_the_step_in_which_the_tip_leaves_the_skin_ends_there(
    gel: Scene, tissue: str, cut: bool
) -> None:
    """Long steps leave it where short ones do."""
    changes: dict[str, object] = {} if cut else {"needle.cutting_force": 1e9}
    places, forces = [], []
    for step in (0.02, 0.0025) if "dynamic" in tissue else (0.2, 0.025):
        changes["discretization.time_step"] = step
        found = moved(gel, tissue, (0.008, -0.008), **changes)
        leaves = [n for n in range(1, len(found.states)) if _leaves(found, n)]
        places.append(found.states[leaves[-1]].depth)
        forces.append(max(abs(state.force) for state in found.states))
        assert found.states[leaves[-1]].force == 0.0
    assert places[0] == pytest.approx(places[1], abs=4e-4)
    assert forces[0] == pytest.approx(forces[1], rel=0.1)


def test_a_viscoelastic_snap_is_accounted_for_state_by_state(popping: Scene) -> None:
    slow = Viscoelastic(
        youngs_modulus=popping.materials["gel"].youngs_modulus,  # type: ignore[attr-defined]
        poissons_ratio=0.45, density=1000.0, shares=(0.4,), times=(1.0,),
    )  # fmt: skip
    scene = vary(popping, {"materials.gel": slow, "discretization.integrator": "quasi_static"})
    simulation = Simulation(scene)
    found = simulation.move(simulation.entry_of_case())
    assert any(state.tip_phase == "rupture" for state in found.states)
    assert energy_terms(found).residual <= 1e-11


def test_slow_insertions_with_inertia_spend_what_quasi_static_ones_do(gel: Scene) -> None:
    """Term by term: what one of them had too much, another would lack."""
    depths = (0.012,)
    still = energy_terms(moved(gel, "elastic", depths, **{"materials.gel": STIFF}))
    slow = {"motion.speed": 0.002, "discretization.time_step": 0.1}
    swung = energy_terms(moved(gel, "dynamic", depths, **slow))
    for name in ("work", "strain", "friction", "cutting"):
        ours, theirs = getattr(swung, name), getattr(still, name)
        assert ours == pytest.approx(theirs, rel=0.01), name
    assert abs(swung.contact_activation - still.contact_activation) <= 1e-3 * still.work
    assert np.isclose(swung.residual, 0.0, atol=1e-11)


@pytest.mark.parametrize("trapezoidal", [False, True])
def test_an_exactly_straight_path_is_cut_as_well(gel: Scene, trapezoidal: bool) -> None:
    """On a line of symmetry one coordinate of the tip never changes."""
    scene = vary(gel, {"target": (0.03, 0.02), "mesh.pattern": "crossed"})
    simulation = Simulation(scene)
    found = simulation.insert(simulation.entry_of_case())
    tips = found.tips
    assert np.abs(tips[:, 0] - 0.03).max() <= 1e-12
    straight = [
        dataclasses.replace(state, tip=np.array([0.03, state.tip[1]])) for state in found.states
    ]
    energies = energy_terms(
        dataclasses.replace(found, states=tuple(straight)), trapezoidal=trapezoidal
    )
    deepest = found.states[-1].tip[1]
    assert energies.cutting == pytest.approx(50.0 * deepest, rel=0.5)
    assert energies.residual <= (1e-2 if trapezoidal else 1e-9)
    assert energies.largest_energy_gain <= 1e-12
    assert energies.total_absolute_work == pytest.approx(energies.work)


def test_path_following_ends_before_a_step_in_which_the_tip_would_give_energy(
    organ: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Soft tissue that is hard to cut moves faster than the tip; the check detects it."""
    soft = vary(
        organ,
        {
            "materials.gel.youngs_modulus": 3e3,
            "needle.cutting_force": 80.0,
            "needle.shaft_friction": 2e3,
            "motion.max_depth": 0.035,
        },
    )
    simulation = Simulation(soft)
    entry = simulation.entry_of_case()

    def followed() -> Insertion:
        path_following = PathFollowing(simulation.instrument(entry), simulation.responses, 0.035)
        assert len(list(path_following.iterate())) > 2
        return path_following.result(soft, simulation.model)

    checked = followed()
    assert checked.outcome.status is Status.STICK_DETECTED
    assert "the tissue moves faster than the tip that cuts it" in checked.outcome.sentence
    assert energy_terms(checked).largest_energy_gain <= 1e-9
    monkeypatch.setattr(PathFollowing, "_check_energy", lambda *_: None)
    unchecked = followed()
    assert len(unchecked.states) > len(checked.states)
    assert energy_terms(unchecked).largest_energy_gain > 1e-6
