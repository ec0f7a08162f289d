from pathlib import Path

import numpy as np
import pytest

from needlefem import load_case, plan
from needlefem.bench import Entrant, race
from needlefem.bench.accuracy import sizes, steps
from needlefem.errors import CaseError
from needlefem.insertion import Simulation
from needlefem.mesh import signed_measures, uniformly_refined
from needlefem.planning import (
    MeshSizes,
    Planner,
    PlanStatus,
    ReferenceSolution,
    displacement_on,
    estimate,
    finer_tissue,
    path_error,
    placed_on,
)
from needlefem.planning import adaptive as reference
from needlefem.planning.error_estimate import HALVED
from needlefem.scene import FileMesh, Scene, Stage, TargetDraw, build_mesh, resolve, vary
from needlefem.studies.accuracy import requests


@pytest.fixture
def coarse(organ: Scene) -> Scene:
    """Return the organ on few quadratic elements that fit it."""
    return vary(
        organ,
        {
            "discretization.element": "P2",
            "mesh.divisions": (12, 12),
            "mesh.interfaces": "fitted",
        },
    )


@pytest.fixture
def thick(organ: Scene) -> Scene:
    """Return the organ with a needle that few elements resolve."""
    return vary(organ, {"needle.tip_radius": 4e-3, "mesh.refine.corridor_width": 4e-3})


@pytest.fixture
def cheap(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make the tissue that is taken as exact a coarse one."""
    monkeypatch.setattr(reference, "REFERENCE_SQUARES", {"triangle": 12, "quadrilateral": 8})
    monkeypatch.setattr(reference, "CORRIDOR", 0.5)
    monkeypatch.setattr(reference, "CONTOUR", 1.0)
    monkeypatch.setattr(reference, "PATH", 0.5)


@pytest.mark.parametrize("element", ["P1", "P2"])
def test_forces_on_the_finer_tissue_say_what_an_insertion_there_would(
    coarse: Scene, element: str
) -> None:
    simulation = Simulation(vary(coarse, {"discretization.element": element}))
    found = Planner(simulation, np.array(coarse.target)).plan()
    finer, _, _ = finer_tissue(simulation)
    offset = displacement_on(finer, simulation, found)
    placed = placed_on(finer, found) - found.best.placed_at
    assert np.linalg.norm(placed) > 1e-5
    assert np.linalg.norm(offset - placed) < 0.25 * np.linalg.norm(placed)


def test_same_tissue_leaves_the_placement_where_it_is(coarse: Scene) -> None:
    simulation = Simulation(coarse)
    found = Planner(simulation, np.array(coarse.target)).plan()
    assert np.linalg.norm(displacement_on(Simulation(coarse), simulation, found)) < 1e-12


def test_estimate_falls_with_the_elements(coarse: Scene) -> None:
    said = plan(coarse).evidence.estimate
    finer = plan(vary(coarse, {"mesh.divisions": (24, 24)})).evidence.estimate
    assert 0.0 < finer.error < 0.7 * said.error
    assert said.compared_to == "P2 on cells half as large"


def test_linear_elements_are_compared_with_quadratic_ones(organ: Scene) -> None:
    said = plan(organ).evidence.estimate
    assert said.compared_to == "P2 on the same cells"
    assert said.error > 1e-4


def test_stepped_insertions_are_estimated_by_a_whole_one(coarse: Scene) -> None:
    marched = plan(coarse).evidence.estimate
    steps = {"discretization.integrator": "quasi_static", "discretization.path_spacing": 2e-3}
    stepped = plan(vary(coarse, steps)).evidence.estimate
    assert stepped.error == pytest.approx(marched.error, rel=0.25)


def test_an_insertion_that_breaks_off_after_steps_has_no_estimate(gel: Scene) -> None:
    soft = {"materials.gel.youngs_modulus": 4e3, "motion.max_depth": 0.045}
    found = plan(vary(gel, soft))  # path following, time stepping, then cutting would add energy
    assert len(found.insertion.states[-1].friction_force) < len(found.insertion.states) - 2
    assert found.status is PlanStatus.NOT_CONVERGED
    assert found.evidence.estimate is None
    assert found.evidence.missing["estimate"]


def test_estimate_is_left_out_when_not_wanted_or_nothing_is_cut(organ: Scene) -> None:
    evidence = plan(vary(organ, {"planning.estimate": False})).evidence
    assert evidence.estimate is None
    assert "estimate" not in evidence.timings
    assert plan(vary(organ, {"motion.max_depth": 1e-4})).evidence.estimate is None


def test_halved_cells_follow_the_contour(coarse: Scene) -> None:
    mesh, contour = build_mesh(coarse), coarse.regions["organ"].contour
    finer = uniformly_refined(mesh, [contour])
    inner, outer = (finer.t2f[:, cells] for cells in finer.subdomains.values())
    between = np.unique(finer.facets[:, np.intersect1d(inner, outer)])
    assert contour.distance(finer.p.T[between]).max() < 1e-12
    assert contour.distance(mesh.refined().p.T[between]).max() > 1e-5
    assert np.all(signed_measures(finer) * signed_measures(mesh.refined()) > 0.0)
    assert set(finer.boundaries) == set(mesh.boundaries)


def test_estimate_sees_edges_beside_the_contour(coarse: Scene) -> None:
    rough = vary(coarse, {"discretization.element": "Q2", "mesh.pattern": "quadrilateral"})
    simulation = Simulation(rough)
    found = Planner(simulation, np.array(rough.target)).plan()
    blind = displacement_on(finer_tissue(simulation)[0], simulation, found)
    assert estimate(simulation, found).error > 2.0 * HALVED * np.linalg.norm(blind)


def test_path_error_is_of_second_order(coarse: Scene) -> None:
    moves = []
    for spacing in (1e-3, 2.5e-4):
        simulation = Simulation(vary(coarse, {"discretization.path_spacing": spacing}))
        found = Planner(simulation, np.array(coarse.target)).plan()
        moves.append(path_error(simulation, found))
        assert estimate(simulation, found, path=True).path == moves[-1]
    assert moves[1] < 0.25 * moves[0]


def test_accuracy_chooses_element_and_sizes(thick: Scene) -> None:
    found = plan(vary(thick, {"planning.accuracy": 9e-6}))
    first, *_, last = found.evidence.refinement_history
    assert found.status is PlanStatus.PLANNED
    assert first.at_most > 9e-6 >= last.at_most == found.evidence.estimate.at_most
    assert first.element == last.element == "P2"
    assert last.unknowns > first.unknowns
    assert found.insertion.scene.mesh.interfaces == "fitted"


def test_accuracy_out_of_reach_has_a_status(thick: Scene) -> None:
    wanted = {"planning.accuracy": 1e-9, "planning.max_unknowns": 5000}
    found = plan(vary(thick, wanted))
    assert found.status is PlanStatus.NOT_ACCURATE
    assert found.sentence.startswith("the accuracy 1e-06 mm needs more than ")
    assert "planning.max_unknowns" in found.sentence
    assert found.best is not None


def test_accuracy_plans_for_the_target_given(thick: Scene) -> None:
    target = np.array([0.031, 0.018])
    found = plan(vary(thick, {"planning.accuracy": 1e-3}), target)
    assert found.best.placed_at == pytest.approx(target, abs=2e-8)
    assert found.insertion.scene.target == pytest.approx(target)


def test_accuracy_needs_a_box_and_a_length(organ: Scene, tmp_path: Path) -> None:
    file = FileMesh(path=tmp_path / "mesh.msh", unit=1.0)
    with pytest.raises(CaseError, match=r"planning\.accuracy: a mesh from a file"):
        MeshSizes.first(vary(organ, {"mesh": file}))
    case = Path(__file__).parents[2] / "cases" / "prostate" / "case.toml"
    with pytest.raises(CaseError, match=r"planning\.accuracy: -0\.0001 is out of range"):
        load_case(case, ["planning.accuracy=-0.1 mm"])
    with pytest.raises(CaseError, match=r"planning\.accuracy"):
        load_case(case, ["planning.accuracy=1 s"])


@pytest.mark.usefixtures("cheap")
def test_placements_on_the_exact_tissue_are_interpolated(thick: Scene) -> None:
    exact = ReferenceSolution(thick, np.array(thick.target))
    found = plan(thick)
    own = placed_on(reference.reference(thick, found.target), found)
    # a parabola through three insertions: off by nanometres, depending on the release between them
    assert exact.error(found) == pytest.approx(np.linalg.norm(own - found.target), rel=1e-4)


@pytest.mark.usefixtures("cheap")
def test_benchmark_marks_the_front(thick: Scene) -> None:
    exact = ReferenceSolution(thick, np.array(thick.target))
    quadratic = vary(thick, {"discretization.element": "P2", "mesh.interfaces": "fitted"})
    entered = [
        Entrant("P2", "the case's own", lambda: plan(quadratic)),
        Entrant("P1", "P1", lambda: plan(thick)),
    ]
    table = race(quadratic, entered, exact)
    errors = [row[3] for row in table.rows]
    assert errors[0] < errors[1]
    assert table.rows[0][-1] == "*"
    assert table.summary["beaten"] == 0
    assert 'id="ringed"' in next(iter(table.charts.values()))


def test_benchmark_varies_sizes_steps_kernels_and_regimes(coarse: Scene) -> None:
    assert set(sizes(coarse.mesh)) == {"as it is", "x 2", "x 1/2"}
    refined = vary(coarse, {"mesh.refine.corridor_size": 1e-3, "mesh.divisions": (7, 7)})
    changed = sizes(refined.mesh)
    assert len(changed) == 6
    assert changed["refined x 1/2, elsewhere x 2"]["mesh.refine.corridor_size"] == 5e-4
    assert changed["elsewhere x 2"]["mesh.divisions"] == (4, 4)
    names = steps(resolve(coarse).scene)
    assert {"path spacing x 2", "kernel points x 4", "generalized_alpha"} <= set(names)


@pytest.mark.usefixtures("cheap")
def test_study_counts_what_holds(thick: Scene) -> None:
    drawn = vary(thick, {"targets": TargetDraw(region="organ", seed=2)})
    (table,) = requests(drawn, (5e-4,), count=1)
    assert table.passed
    assert table.summary == {"met_0.5": 1, "holds_0.5": 1, "near_0.5": 1}


def test_what_the_needle_does_afterwards_does_not_make_the_estimate_dearer(
    coarse: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    stages = (Stage(depth=0.03), Stage(dwell=1.0), Stage(depth=0.0))
    alone = plan(coarse)
    monkeypatch.setattr("needlefem.planning.error_estimate._complete_insertion", None)
    moved = plan(vary(coarse, {"motion.stages": stages}))
    assert alone.evidence is not None
    assert moved.evidence is not None
    assert alone.evidence.estimate is not None
    assert moved.evidence.estimate is not None
    assert moved.evidence.estimate.error == pytest.approx(alone.evidence.estimate.error)
