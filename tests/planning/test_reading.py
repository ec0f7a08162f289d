"""Results that need a complete insertion are None with a reason if the insertion ended early."""

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest

from needlefem import load_case, plan
from needlefem.errors import SimulationError
from needlefem.insertion import Insertion, Outcome, Simulation, Status
from needlefem.io import plan_record
from needlefem.planning import (
    Headline,
    InsertionReader,
    Planner,
    PlanStatus,
    Why,
    at_rupture,
    carry_out,
)
from needlefem.scene import Scene, TargetDraw, build_mesh, vary
from needlefem.studies import parameters, targets
from tests.conftest import ROOT

FAULTS = ROOT / "tests" / "faults"
BROKEN = Outcome(Status.NOT_CONVERGED, "no equilibrium at depth 0.01 m")
Break = Callable[[Callable[[Simulation, float], bool]], None]


@pytest.fixture
def breaking(monkeypatch: pytest.MonkeyPatch) -> Break:
    """Return what lets insertions break off halfway, by simulation and lateral entry (m)."""
    whole = Simulation.insert

    def install(breaks: Callable[[Simulation, float], bool]) -> None:
        def insert(self: Simulation, entry, *args, **keys) -> Insertion:  # type: ignore[no-untyped-def]
            found = whole(self, entry, *args, **keys)
            if not breaks(self, float(entry.point[0])):
                return found
            half = found.states[: len(found.states) // 2]
            return dataclasses.replace(found, states=half, outcome=BROKEN)

        monkeypatch.setattr(Simulation, "insert", insert)

    return install


def _level(organ: Scene) -> Callable[[Simulation, float], bool]:
    return lambda _, height: abs(height - organ.target[0]) < 1e-9


def test_evidence_of_a_broken_level_insertion_is_missing(organ: Scene, breaking: Break) -> None:
    whole = plan(organ)
    breaking(_level(organ))
    found = plan(organ)
    assert found.status is PlanStatus.PLANNED
    assert found.best.release_point == pytest.approx(whole.best.release_point, abs=1e-7)
    assert found.unplanned is None
    assert found.depth_only is None
    record = plan_record(found)
    for name in ("unplanned", "depth_only"):
        assert record[name] is None
        assert "ended early at" in record["missing"][name]
        assert BROKEN.sentence in record["missing"][name]
    assert record["estimate"] is not None


@pytest.mark.parametrize("search", ["golden", "grid"])
def test_searches_do_not_take_what_broke_off_for_good(
    organ: Scene, breaking: Break, search: str
) -> None:
    """Broken insertions on one side would end nearer to the target than whole ones miss it."""
    changes = {"planning.interval_tolerance": 2.5e-4, "planning.estimate": False}
    organ = vary(organ, changes)
    whole = plan(organ, search=search)
    breaking(lambda _, height: height > organ.target[0] + 4e-4)
    found = plan(organ, search=search)
    assert found.best.release_point == pytest.approx(whole.best.release_point, abs=3e-4)
    broken = [h[0] > 4e-4 for h, _ in found.solution.tried]
    assert any(broken)
    for (_, error), ended in zip(found.solution.tried, broken, strict=True):
        assert np.isinf(error[0]) == ended


@pytest.mark.parametrize("search", ["root", "golden", "grid"])
def test_a_plan_of_which_every_insertion_breaks_off(
    organ: Scene, breaking: Break, search: str
) -> None:
    breaking(lambda *_: True)
    found = plan(vary(organ, {"planning.interval_tolerance": 1e-3}), search=search)
    assert found.status is PlanStatus.NOT_CONVERGED
    assert BROKEN.sentence in found.sentence
    record = plan_record(found)
    for name in ("release_point", "unplanned", "depth_only", "energy", "validity", "estimate"):
        assert record[name] is None, name
    assert record["headline"]["placement_error"] is None
    assert set(record["missing"]) == {"unplanned", "depth_only", "energy", "validity", "estimate"}


def test_an_estimate_whose_own_insertion_breaks_off(organ: Scene, breaking: Break) -> None:
    steps = {"discretization.integrator": "quasi_static", "discretization.path_spacing": 3e-3}
    breaking(lambda simulation, _: simulation.scene.discretization.element != "P1")
    found = plan(vary(organ, steps))
    assert found.status is PlanStatus.PLANNED
    assert found.evidence.estimate is None
    assert "in the tissue for comparison, the insertion ended early" in found.sentence
    assert "placement error not estimated" in found.sentence


def test_an_accuracy_is_not_met_by_an_error_that_is_not_known(
    organ: Scene, breaking: Break
) -> None:
    breaking(lambda simulation, _: simulation.scene.discretization.path_spacing > 1.5e-3)
    thick = {"needle.tip_radius": 4e-3, "mesh.refine.corridor_width": 4e-3}
    finer = {**thick, "planning.accuracy": 1e-4}
    # the first spacing is 0.4 radii, 1.6 mm
    found = plan(vary(organ, {**finer}))
    assert found.status in (PlanStatus.NOT_CONVERGED, PlanStatus.NOT_ACCURATE)
    assert found.evidence.estimate is None


def test_studies_do_not_show_what_broke_off(organ: Scene, breaking: Break) -> None:
    found = plan(organ)
    drawn = vary(organ, {"targets": TargetDraw(region="organ", count=3, seed=1)})
    first = targets.draw_targets(drawn)[0]
    breaking(lambda _, height: abs(height - first[0]) < 1e-9 or height == 0.0)
    table = targets.target_table(drawn, targets.draw_targets(drawn))
    assert np.isfinite(table.unplanned_mean)
    assert len(table.unknown) == 1
    breaking(lambda *_: True)
    assert carry_out(organ, found) is None
    with pytest.raises(SimulationError, match="no plan to carry out"):
        parameters.robust(organ)


def test_targets_lie_in_all_parts_of_a_group() -> None:
    scene = load_case(FAULTS / "obstacle-of-parts" / "case.toml", ["obstacles={}"])
    drawn = vary(scene, {"targets": TargetDraw(region="ribs", count=400, seed=1)})
    points = targets.draw_targets(drawn)
    mesh = build_mesh(scene)
    cells = mesh.element_finder()(*points.T)
    found, counts = np.unique(cells, return_counts=True)
    assert set(found) <= set(mesh.subdomains["ribs"])
    corners = mesh.p[:, mesh.t[:, mesh.subdomains["ribs"]]].transpose(2, 1, 0)
    one, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    areas = 0.5 * np.abs(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0])
    mean = (areas[:, None] * corners.mean(axis=1)).sum(axis=0) / areas.sum()
    spread = points.std(axis=0) / np.sqrt(len(points))
    assert np.all(np.abs(points.mean(axis=0) - mean) < 4.0 * spread)  # drawn evenly by area
    assert counts.max() < 400
    within = scene.regions["ribs"].contour.contains(points)
    assert 0 < np.count_nonzero(within) < 400  # the contour is that of the largest part


def test_a_release_at_a_jump_is_no_plan(popping: Scene) -> None:
    """Material passed in a rupture cannot be a target; each search names the rupture."""
    planner = Planner(Simulation(popping), np.array(popping.target))
    snap = planner.insertion(np.zeros(1)).ruptures[0]
    tips = planner.insertion(np.zeros(1)).tips
    between = 0.5 * (tips[snap.first] + tips[snap.last])
    inside = vary(popping, {"target": tuple(between), "planning.interval_tolerance": 1e-3})
    for search in ("root", "golden", "grid"):
        found = plan(inside, search=search)
        assert found.status is PlanStatus.UNREACHABLE
        assert "the tip passes it in a rupture" in found.sentence
        depth = float(found.insertion.axis.axial_coordinate(found.best.release_point))
        if at_rupture(found.insertion, depth):
            assert found.evidence.validity is None
            assert found.evidence.estimate is None
            assert "rupture" in found.evidence.missing["validity"]
    nearest = InsertionReader(planner.insertion(np.zeros(1)), between).nearest()
    assert nearest.why is Why.JUMPED


def test_a_headline_names_the_parts_that_count() -> None:
    def error(**parts: float) -> str:
        whole = sum(parts.values())
        made = Headline(placement_error=whole, contains=parts, unknown="", validity=None)
        return made.error

    assert error(mesh=4.6e-4, path=1e-9, search=3e-10) == "at most about 0.46 mm: mesh"
    assert (
        error(mesh=2e-4, path=1e-4, search=1e-9) == "at most about 0.3 mm: mesh 0.2 mm, path 0.1 mm"
    )
