"""Results travel between processes, and are as good as before."""

import copy
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import needlefem as nf
from needlefem.alterovitz2003.plan import paper_plan
from needlefem.errors import CaseError
from needlefem.insertion import Insertion, Simulation, energy_terms, validity
from needlefem.insertion import TipTrajectory as CutPath
from needlefem.planning import Plan, Planner
from needlefem.scene import Scene, Stage, vary
from tests.conftest import ROOT

BYTES = 700
"""Most bytes a scalar unknown of a pickled plan: mesh, points and where they are found."""
Copy = Callable[[Any], Any]


def sent(found: Any) -> Any:
    """Return what another process gets."""
    return pickle.loads(pickle.dumps(found))


def load(name: str, *overrides: str) -> Scene:
    """Return a case of the repository."""
    return nf.load_case(ROOT / "cases" / name / "case.toml", overrides)


SCENES: dict[str, Callable[[], Scene]] = {
    "elastic": lambda: load("gel"),
    "quadrilaterals": lambda: load(
        "gel", "discretization.element=Q1", "mesh.pattern=quadrilateral"
    ),
    "out again": lambda: vary(
        load("gel"), {"motion.stages": (Stage(depth=0.012, release="seed"), Stage(depth=-1e-3))}
    ),
    "with inertia": lambda: load(
        "gel", "discretization.integrator=generalised-alpha", 'motion.max_depth="4 mm"'
    ),
}


def same(one: Insertion, other: Insertion) -> None:
    """Compare what can be asked of an insertion."""
    assert one.outcome == other.outcome
    assert np.array_equal(one.tips, other.tips)
    assert one.puncture_depth == other.puncture_depth
    assert [event.kind for event in one.events] == [event.kind for event in other.events]
    assert [tuple(seed.point) for seed in one.seeds] == [tuple(s.point) for s in other.seeds]
    assert energy_terms(one).work == pytest.approx(energy_terms(other).work, rel=1e-12)
    assert energy_terms(one).strain == pytest.approx(
        energy_terms(other).strain, rel=1e-9, abs=1e-12
    )
    last = len(one.states) - 1
    strains = [validity(insertion, last).largest_strain for insertion in (one, other)]
    assert strains[0] == pytest.approx(strains[1], rel=1e-9)
    depth = 0.5 * float(one.depths.max())
    reached = [CutPath(insertion).at_depth(depth) for insertion in (one, other)]
    assert (reached[0] is None) == (reached[1] is None)
    if reached[0] is not None and reached[1] is not None:
        assert np.array_equal(reached[0].point, reached[1].point)


@pytest.mark.parametrize("made", [sent, copy.deepcopy])
@pytest.mark.parametrize("name", SCENES)
def test_insertions_travel(name: str, made: Copy) -> None:
    insertion = nf.simulate(SCENES[name]())
    same(made(insertion), insertion)


@pytest.mark.parametrize("made", [sent, copy.deepcopy])
def test_plans_travel(made: Copy, tmp_path: Path) -> None:
    plan = nf.plan(load("gel", "planning.estimate=false"))
    other: Plan = made(plan)
    assert (other.status, other.sentence) == (plan.status, plan.sentence)
    assert plan.best is not None
    assert other.best is not None
    assert np.array_equal(other.best.release_point, plan.best.release_point)
    assert np.array_equal(other.best.placed_at, plan.best.placed_at)
    assert other.evidence is not None
    assert plan.evidence is not None
    assert other.evidence.energy == plan.evidence.energy
    same(other.insertion, plan.insertion)
    images = []
    for number, found in enumerate((plan, other)):
        path = nf.render(found.insertion, tmp_path / f"{number}.png", depth=0.01)
        with Image.open(path) as picture:
            images.append(np.asarray(picture.convert("RGB")))
    assert np.array_equal(*images)


def test_plans_of_the_papers_method_travel() -> None:
    plan = paper_plan(load("prostate-2003", "planning.interval_tolerance=2 mm")).plan
    other = sent(plan)
    assert np.array_equal(other.insertion.tips, plan.insertion.tips)
    assert other.best is not None
    assert np.array_equal(other.best.placed_at, plan.best.placed_at)  # type: ignore[union-attr]


def test_a_pickled_plan_is_small() -> None:
    """Neither factors nor matrices, whatever was asked for before."""
    plan = nf.plan(load("gel", "planning.estimate=false"))
    model = plan.insertion.model
    _ = model.factor, model.stiffness.matrix, model.interpolation.surface
    assert len(pickle.dumps(plan)) < BYTES * model.ndofs + 60_000


def test_simulations_and_planners_go_on_elsewhere() -> None:
    scene = load("gel")
    simulation = Simulation(scene, watch=lambda state: None)
    entry = simulation.entry_of_case()
    first = simulation.insert(entry)
    other = sent(simulation).insert(entry)
    assert other.tips == pytest.approx(first.tips, abs=1e-12)
    assert scene.target is not None
    planner = Planner(simulation, np.array(scene.target))
    here, there = planner.plan(), sent(planner).plan()
    assert here.best is not None
    assert there.best is not None
    assert there.best.placed_at == pytest.approx(here.best.placed_at, abs=1e-9)


def test_a_model_gives_the_same_displacements_elsewhere() -> None:
    model = nf.build_model(Simulation(load("gel")).scene)
    load_vector = np.zeros(model.ndofs)
    load_vector[model.free_dofs[::7]] = 1.0
    assert np.array_equal(sent(model).solve(load_vector), model.solve(load_vector))


def test_errors_travel_with_their_parts() -> None:
    """A worker's error must not be lost on its way, or the pool waits for ever."""
    error = sent(CaseError("key", "problem", "remedy"))
    assert (error.key, error.problem, error.remedy) == ("key", "problem", "remedy")
    assert str(error) == "key: problem; remedy"
