import math

import pytest

from needlefem import build_model, plan
from needlefem.elements import CATALOGUE
from needlefem.errors import CaseError
from needlefem.insertion import Simulation
from needlefem.scene import Rayleigh, Scene, Stage, resolve, slowest_wave, vary, with_element
from needlefem.scene.resolve import cell_shape, damping_time, fastest


@pytest.mark.parametrize(
    ("pattern", "ratio", "chosen"),
    [
        ("diagonal", 0.45, "P2"),
        ("diagonal", 0.495, "P2-P1"),
        ("crossed", 0.5, "P2-P1"),
        ("quadrilateral", 0.45, "Q2"),
        ("quadrilateral", 0.4999, "Q2-Q1"),
    ],
)
def test_auto_takes_what_does_not_lock(gel: Scene, pattern: str, ratio: float, chosen: str) -> None:
    scene = vary(
        gel,
        {
            "mesh.pattern": pattern,
            "materials.gel.poissons_ratio": ratio,
            "discretization.element": "auto",
        },
    )
    resolved = resolve(scene)
    assert resolved.scene.discretization.element == chosen
    assert resolved.reasons["element"].startswith(chosen)
    assert not any("locks" in sentence for sentence in resolved.warnings)


@pytest.mark.parametrize(
    ("element", "ratio", "cure"),
    [("P1", 0.48, "P2"), ("P1", 0.495, "P2-P1"), ("Q1", 0.46, "Q2"), ("Q2", 0.495, "Q2-Q1")],
)
def test_locking_is_warned_with_the_cure(gel: Scene, element: str, ratio: float, cure: str) -> None:
    scene = vary(with_element(gel, element), {"materials.gel.poissons_ratio": ratio})
    (sentence,) = [s for s in resolve(scene).warnings if "locks" in s]
    assert sentence.startswith(f"{element} locks at Poisson's ratio {ratio} of 'gel'")
    assert sentence.endswith(f"use {cure}")


def test_plane_stress_does_not_lock(gel: Scene) -> None:
    scene = vary(gel, {"materials.gel.poissons_ratio": 0.5, "plane": "stress"})
    assert not any("locks" in sentence for sentence in resolve(scene).warnings)
    assert build_model(scene).stiffness.compressibility.min() > 0.0


@pytest.mark.parametrize("name", CATALOGUE)
def test_with_element_gives_its_cells(gel: Scene, name: str) -> None:
    scene = with_element(gel, name)
    assert cell_shape(scene) == CATALOGUE[name].cell
    assert build_model(scene).element is CATALOGUE[name]


def test_wrong_cells_are_refused_with_the_cure(gel: Scene) -> None:
    with pytest.raises(CaseError, match="Q1 is not defined on triangles; use a mesh of quadril"):
        build_model(vary(gel, {"discretization.element": "Q1"}))


def test_incompressible_tissue_needs_a_pressure(gel: Scene) -> None:
    scene = vary(gel, {"materials.gel.poissons_ratio": 0.5, "discretization.element": "P2"})
    with pytest.raises(
        CaseError, match="P2 can't be used for incompressible tissue; use a mixed element"
    ):
        Simulation(scene).model.factor  # noqa: B018


@pytest.mark.parametrize("name", ["MINI", "P2-P1", "Q2-Q1"])
def test_incompressible_tissue_is_planned_in(organ: Scene, name: str) -> None:
    changes = {"materials.gel.poissons_ratio": 0.5, "materials.stiff.poissons_ratio": 0.5}
    found = plan(vary(with_element(organ, name), changes))
    assert found.status == "planned"
    assert found.best is not None
    assert found.best.placement_error <= 1e-8
    assert found.evidence is not None
    assert found.evidence.energy is not None
    assert found.evidence.energy.residual <= 1e-6


def test_incompressible_tissue_must_not_be_enclosed(gel: Scene) -> None:
    scene = vary(
        with_element(gel, "P2-P1"),
        {
            "materials.gel.poissons_ratio": 0.5,
            "supports.walls.faces": ("y_min", "y_max", "z_min", "z_max"),
        },
    )
    with pytest.raises(CaseError, match="incompressible tissue is enclosed on all sides"):
        build_model(scene).factor  # noqa: B018


def test_the_paper_still_has_its_warning(paper_scene: Scene) -> None:
    assert any("P1 locks" in sentence for sentence in resolve(paper_scene).warnings)


@pytest.mark.parametrize(
    ("changes", "chosen", "why"),
    [
        ({}, "path_following", "0.005 m/s are slow for a shear wave of 3.2"),
        ({"motion.speed": 0.2}, "generalized_alpha", "6.2 % of the shear wave's"),
        (
            {"motion.stages": (Stage(depth=0.01, speed=0.1),)},
            "generalized_alpha",
            "inertia matters",
        ),
        ({"damping": Rayleigh(stiffness_time=0.1)}, "generalized_alpha", "0.1 s of 6 s"),
        ({"damping": Rayleigh(stiffness_time=1e-3)}, "path_following", "one friction limit"),
        (
            {"needle.static_friction_ratio": 1.5},
            "quasi_static",
            "friction depends on slip; 0.005",
        ),
        (
            {"materials.gel.density": 0.0, "motion.speed": 1.0},
            "path_following",
            "a shear wave of inf",
        ),
        ({"discretization.integrator": "newmark"}, "newmark", "asked for"),
        (
            {"motion.speed": 0.2, "discretization.integrator": "path_following"},
            "path_following",
            "asked for",
        ),
    ],
)
def test_the_integrator_follows_from_speeds_and_times(
    gel: Scene, changes: dict[str, object], chosen: str, why: str
) -> None:
    resolved = resolve(vary(gel, changes))
    assert resolved.scene.discretization.integrator == chosen
    assert why in resolved.reasons["integrator"]
    assert ("dynamics" in resolved.skipped) is (chosen in {"path_following", "quasi_static"})


def test_numbers_known_beforehand(gel: Scene) -> None:
    wave = math.sqrt(30e3 / 2.9 / 1000.0)
    assert slowest_wave(gel) == pytest.approx(wave)
    table = vary(gel, {"motion.times": (0.0, 1.0, 1.5), "motion.depths": (0.0, 0.01, 0.03)})
    assert fastest(table.motion) == pytest.approx(0.04)
    damped = vary(gel, {"damping": Rayleigh(mass_rate=7.0, stiffness_time=1e-3)})
    assert damping_time(damped) == pytest.approx(1e-3 + 7.0 * (0.03 / (math.pi * wave)) ** 2)
    ratios = vary(gel, {"damping": Rayleigh(frequencies=(2.0, 10.0), ratios=(0.05, 0.05))})
    assert damping_time(ratios) == pytest.approx(0.05 / (2.0 * math.pi))


def test_a_model_is_built_of_a_scene_that_leaves_its_element_open(gel: Scene) -> None:
    assert build_model(vary(gel, {"discretization.element": "auto"})).element.name == "P2"
