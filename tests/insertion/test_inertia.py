"""A needle stepped in tissue with inertia and damping."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from needlefem import build_model
from needlefem.contact import SlipWeakeningFriction
from needlefem.dynamics import AlphaParameters, Damping, GeneralizedAlpha, Newmark, TissueSystem
from needlefem.errors import CaseError
from needlefem.insertion import (
    DynamicResponse,
    Insertion,
    Simulation,
    Status,
    TimeStep,
    TimeStepping,
    TipPhase,
    energy_terms,
)
from needlefem.insertion.response_in_time import bound_radius, damping_of
from needlefem.materials import Viscoelastic
from needlefem.scene import DYNAMIC, Rayleigh, Scene, Stage, vary

SOME = Rayleigh(mass_rate=5.0, stiffness_time=2e-3)
EACH = pytest.mark.parametrize("integrator", DYNAMIC)


def moved(scene: Scene, integrator: str, **changes: object) -> Insertion:
    """Return the scene's whole motion by an integrator; changes are those of the motion."""
    found = {f"motion.{name}": value for name, value in changes.items()}
    simulation = Simulation(vary(scene, {"discretization.integrator": integrator, **found}))
    return simulation.move(simulation.entry_of_case())


@EACH
def test_as_speed_falls_it_becomes_quasi_static(organ: Scene, integrator: str) -> None:
    coarse = {"mesh.divisions": (10, 10), "motion.max_depth": 6e-3, "damping": SOME}
    scene = vary(organ, coarse)
    still = moved(scene, "quasi_static").states[-1].tip
    apart = []
    for speed in (0.5, 0.05, 0.005):
        steps = {"discretization.time_step": 2e-4 / speed}
        found = moved(vary(scene, steps), integrator, speed=speed)
        apart.append(float(np.linalg.norm(found.states[-1].tip - still)))
    assert apart == sorted(apart, reverse=True)
    assert apart[2] <= 1e-5


@EACH
@pytest.mark.parametrize("speed", [0.005, 0.05])
def test_the_energy_balance_closes_and_contact_adds_none(
    gel: Scene, integrator: str, speed: float
) -> None:
    stages = (
        Stage(depth=0.01),
        Stage(dwell=0.1),
        Stage(depth=0.008),
        Stage(depth=0.012),
        Stage(depth=0.0),
    )
    found = moved(vary(gel, {"damping": SOME}), integrator, stages=stages, speed=speed)
    energies = energy_terms(found)
    assert found.outcome.status is Status.COMPLETED
    assert energies.residual <= 1e-11
    assert energies.largest_energy_gain <= 1e-9
    assert min(energies.kinetic, energies.damping, energies.friction, energies.cutting) > 0.0


def test_tissue_that_swings_on_and_off_the_tip_gives_nothing(gel: Scene) -> None:
    """At the mouth of a hole from which a needle was drawn, in steps too long for it."""
    stages = (Stage(depth=0.01), Stage(depth=0.0), Stage(dwell=0.4))
    changes = {
        "damping": SOME, "discretization.time_step": 0.02, "motion.stages": stages,
        "motion.speed": 0.05, "discretization.integrator": "newmark",
    }  # fmt: skip
    found = moved(vary(gel, changes), "newmark")
    assert sum(state.tip_phase is TipPhase.OUTSIDE for state in found.states) >= 3
    assert energy_terms(found).largest_energy_gain <= 1e-9
    assert energy_terms(found).residual <= 1e-11


def test_undamped_motion_loses_energy_to_friction_and_cutting_alone(gel: Scene) -> None:
    found = moved(gel, "generalized_alpha", max_depth=0.01, speed=0.2)
    energies = energy_terms(found)
    assert energies.damping == 0.0
    assert abs(energies.algorithmic_dissipation) <= 1e-2 * energies.work
    assert energies.residual <= 1e-11


def test_static_friction_weakens_with_inertia(gel: Scene) -> None:
    changes = {"needle.static_friction_ratio": 1.5, "needle.slip_weakening_distance": 1e-3}
    stages = (Stage(depth=0.01), Stage(dwell=0.5), Stage(depth=0.006))
    plain = moved(gel, "newmark", stages=stages)
    harder = moved(vary(gel, changes), "newmark", stages=stages)
    assert min(s.force for s in harder.states) < min(s.force for s in plain.states)
    assert energy_terms(harder).residual <= 1e-11


def test_catching_costs_energy(gel: Scene) -> None:
    """Tissue that swings back is caught by the needle at its own velocity."""
    stages = (Stage(depth=0.01), Stage(dwell=0.02), Stage(depth=0.006), Stage(dwell=0.02))
    coarse = {"mesh.divisions": (10, 10), "discretization.path_spacing": 3e-3}
    scene = vary(gel, coarse | {"discretization.time_step": 1e-3})
    found = moved(scene, "generalized_alpha", stages=stages, speed=0.3)
    grips = [
        np.any((new.slipping[: old.full_segments] == 0) & (old.slipping[: old.full_segments] != 0))
        for old, new in zip(found.states, found.states[1:], strict=False)
        if new.full_segments >= old.full_segments > 1
    ]
    assert any(grips)
    assert energy_terms(found).contact_activation > 0.0
    assert energy_terms(found).residual <= 1e-11


def test_what_sticks_has_the_needles_velocity(gel: Scene) -> None:
    simulation = Simulation(vary(gel, {"discretization.integrator": "generalized_alpha"}))
    stages = (Stage(depth=0.01), Stage(depth=0.0098))
    motion = vary(simulation.scene, {"motion.stages": stages}).motion
    course = simulation.insertion_run(simulation.entry_of_case(), motion)
    old = None
    for state in course.iterate():
        if old is not None and state.slipping is not None and state.depth < old.depth:
            whole = min(old.full_segments, state.full_segments)
            stuck = np.flatnonzero((state.slipping[:whole] == 0) & (old.slipping[:whole] == 0))
            way = state.segment_displacement[stuck, 0] - old.segment_displacement[stuck, 0]
            assert way == pytest.approx(state.depth - old.depth, abs=1e-12)
        old = state
    assert old is not None
    assert old.tip_phase is not TipPhase.OUTSIDE


def test_a_snap_is_survived(popping: Scene) -> None:
    still = moved(popping, "quasi_static", max_depth=0.021)
    found = moved(popping, "generalized_alpha", max_depth=0.021)
    assert still.ruptures
    before = [state.tip[1] for state in found.states if state.depth < 0.016]
    assert max(before) < 0.005
    assert min(found.states[-1].tip[1], still.states[-1].tip[1]) > 0.018
    assert found.outcome.status is Status.COMPLETED
    assert energy_terms(found).residual <= 1e-11


def test_viscoelastic_tissue_has_inertia_too(gel: Scene) -> None:
    law = Viscoelastic(youngs_modulus=20e3, poissons_ratio=0.45, shares=(0.4,), times=(0.5,))
    scene = vary(gel, {"materials.gel": law})
    found = moved(scene, "generalized_alpha", stages=(Stage(depth=0.01), Stage(dwell=1.0)))
    energies = energy_terms(found)
    assert energies.viscoelastic > 0.0
    assert energies.residual <= 1e-11


@pytest.mark.parametrize("mass", ["consistent", "row-sum", "hrz"])
def test_any_mass_that_the_element_has(gel: Scene, mass: str) -> None:
    scene = vary(gel, {"discretization.mass_matrix": mass})
    assert energy_terms(moved(scene, "newmark", max_depth=0.005, speed=0.1)).residual <= 1e-11


def test_a_mass_that_it_does_not_have_is_refused(popping: Scene) -> None:
    with pytest.raises(CaseError, match="P2"):
        moved(vary(popping, {"discretization.mass_matrix": "row-sum"}), "newmark")


# what rings


def test_bound_motion_of_average_acceleration_rings() -> None:
    assert bound_radius(AlphaParameters(0.0, 0.0, 0.25, 0.5)) == pytest.approx(1.0, abs=1e-7)
    assert bound_radius(AlphaParameters(1 / 3, 4 / 9, 25 / 81, 11 / 18)) == pytest.approx(
        0.8, abs=1e-7
    )


@pytest.mark.parametrize(
    "changes",
    [
        {"discretization.integrator": "newmark", "discretization.newmark_gamma": 0.5},
        {"discretization.integrator": "hht", "discretization.hht_alpha": 0.0},
        {"discretization.integrator": "generalized_alpha", "discretization.rho_inf": 1.0},
    ],
)
def test_average_acceleration_is_refused(gel: Scene, changes: dict[str, object]) -> None:
    simulation = Simulation(vary(gel, changes))
    with pytest.raises(CaseError, match="newmark_gamma above 0.5, hht_alpha below 0, or rho"):
        simulation.insert(simulation.entry_of_case())


@pytest.fixture
def pressed(gel: Scene) -> Callable[..., np.ndarray]:
    """Return a function that presses on the skin at once and holds: the tip's force in time."""
    model = build_model(gel)

    def hold(integrator: object, **options: bool) -> np.ndarray:
        simulation = Simulation(vary(gel, {"needle.cutting_force": 1e6}), model)
        tissue_response = DynamicResponse(
            TissueSystem(model, Damping(mass_rate=400.0)), integrator, **options
        )
        instrument = simulation.instrument(simulation.entry_of_case())
        stepping = TimeStepping(instrument, tissue_response, model, SlipWeakeningFriction())
        time_steps = [TimeStep(1e-3 * n, 5e-4, 1e-3) for n in range(1, 301)]
        return np.array([state.tip_force for state in stepping.iterate(time_steps)])

    return hold


def test_the_tips_force_rings_where_it_is_not_refused(pressed: Callable[..., np.ndarray]) -> None:
    ringing = pressed(Newmark(), refuse_ringing=False)
    calm = pressed(GeneralizedAlpha(rho_inf=0.8))
    assert np.ptp(ringing[-20:]) > np.mean(calm[-20:])
    assert np.ptp(calm[-20:]) < 1e-3 * np.mean(calm[-20:])


# what a case says


def test_damping_by_ratios() -> None:
    found = damping_of(Rayleigh(frequencies=(2.0, 10.0), ratios=(0.05, 0.05)))
    assert found.ratio(2.0) == pytest.approx(0.05)
    assert found.mass_rate == pytest.approx(1.0471975512)


@pytest.mark.parametrize(
    ("said", "message"),
    [
        ({"frequencies": (2.0, 10.0)}, "2 frequencies and 0 ratios; give two of both"),
        ({"ratios": (0.1, 0.1)}, "0 frequencies and 2 ratios; give two of both"),
        ({"mass_rate": 1.0, "ratios": (0.1, 0.1)}, "mass_rate or stiffness_time as well"),
        ({"frequencies": (2.0, 2.0), "ratios": (0.1, 0.1)}, "give two different ones"),
        ({"frequencies": (2.0, 10.0), "ratios": (0.1, 0.01)}, "ratios: .* negative"),
        ({"frequencies": (2.0, 10.0), "ratios": (0.01, 0.1)}, "ratios: .* negative"),
    ],
)
def test_damping_by_halves_is_refused(said: dict[str, Any], message: str) -> None:
    with pytest.raises(CaseError, match=f"damping.*{message}"):
        Rayleigh(**said)


@pytest.mark.parametrize("ratios", [(0.1, 0.021), (0.1, 0.49)])
def test_ratios_are_admitted_up_to_where_a_coefficient_vanishes(
    ratios: tuple[float, float],
) -> None:
    found = damping_of(Rayleigh(frequencies=(2.0, 10.0), ratios=ratios))
    assert min(found.mass_rate, found.stiffness_time) >= 0.0
    assert found.ratio(2.0) == pytest.approx(ratios[0])
    assert found.ratio(10.0) == pytest.approx(ratios[1])
