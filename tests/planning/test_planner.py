import re

import numpy as np
import pytest

from needlefem import plan
from needlefem.errors import CaseError, CheckFailedError
from needlefem.insertion import Simulation
from needlefem.materials import Viscoelastic
from needlefem.planning import Planner, PlanStatus, carry_out
from needlefem.scene import Scene, vary


def test_plan_hits_and_carrying_it_out_hits_again(organ: Scene) -> None:
    found = plan(organ)
    assert found.status is PlanStatus.PLANNED
    assert found.best.placement_error <= 1e-8
    assert found.insertions <= 7
    again = carry_out(organ, found)
    assert again.point == pytest.approx(organ.target, abs=2e-8)


def test_plan_comes_with_its_evidence(organ: Scene) -> None:
    evidence = plan(organ).evidence
    assert all(check.passed for check in evidence.preflight)
    assert evidence.energy.residual < 1e-10
    assert evidence.validity.inverted_cells == 0
    assert set(evidence.timings) == {"model", "preflight", "search", "estimate", "evidence"}
    assert "dynamics" in evidence.skipped


def test_unplanned_falls_short_and_depth_alone_misses_sideways(organ: Scene) -> None:
    found = plan(organ)
    target = np.array(organ.target)
    assert found.unplanned.release_point == pytest.approx(target)
    assert found.unplanned.placed_at[1] < target[1]
    assert (
        found.best.placement_error
        < found.depth_only.placement_error
        < found.unplanned.placement_error
    )
    assert found.depth_only.release_point[0] == pytest.approx(target[0])


def test_searches_agree(organ: Scene) -> None:
    planner = Planner(Simulation(organ), np.array(organ.target))
    by_root = planner.plan("root")
    by_golden, by_grid = planner.plan("golden"), planner.plan("grid")
    assert by_golden.best.release_point == pytest.approx(by_root.best.release_point, abs=1e-4)
    assert by_grid.best.release_point == pytest.approx(by_root.best.release_point, abs=1e-4)
    assert by_golden.insertions > by_root.insertions


def test_other_solutions_are_looked_for_on_request(organ: Scene) -> None:
    found = plan(organ, all_solutions=True)
    assert found.other_solutions == ()
    assert found.scan_insertions > 0
    assert plan(organ).other_solutions is None


def test_target_out_of_the_range_is_said(organ: Scene) -> None:
    found = plan(vary(organ, {"planning.offset_range": (5e-4, 2e-3)}))
    assert found.status is PlanStatus.OUTSIDE_RANGE
    assert "no lateral offset between +0.05 and +0.2 cm from the target reaches" in found.sentence


@pytest.mark.parametrize("search", ["root", "golden", "grid"])
@pytest.mark.parametrize("depth", [1e-4, 0.01, 0.022])
def test_max_depth_bounds_every_plan_and_is_named(organ: Scene, search: str, depth: float) -> None:
    shallow = vary(organ, {"motion.max_depth": depth, "planning.interval_tolerance": 5e-4})
    found = plan(shallow, search=search)
    assert found.status is PlanStatus.BEYOND_MAX_DEPTH
    assert f"motion.max_depth = {100 * depth:.4g} cm" in found.sentence
    for release in (found.best, found.unplanned, found.depth_only):
        if release is not None:
            assert float(found.level.axis.axial_coordinate(release.release_point)) <= depth + 1e-9
    proposed = re.search(r'set motion.max_depth to "([\d.]+) cm"', found.sentence)
    again = plan(vary(shallow, {"motion.max_depth": 1e-2 * float(proposed[1])}), search=search)
    assert again.status is PlanStatus.PLANNED


def test_target_before_puncture_is_said(organ: Scene) -> None:
    found = plan(vary(organ, {"motion.max_depth": 1e-4}))
    assert found.best is None
    assert found.missing["unplanned"].startswith("a release at 2 cm is beyond")
    assert found.missing["depth_only"].startswith("the skin is cut beyond")
    assert set(found.evidence.missing) == {"estimate", "energy", "validity"}


def test_target_outside_the_tissue_is_refused(organ: Scene) -> None:
    with pytest.raises(CaseError, match=r"target.point: \(2, 7\) cm is outside the tissue"):
        plan(vary(organ, {"target": (0.02, 0.07)}))
    with pytest.raises(CaseError, match="give a target"):
        plan(vary(organ, {"target": None}))


def test_wrong_entry_is_refused_though_a_plan_chooses_its_own(organ: Scene) -> None:
    with pytest.raises(CaseError, match="is not on the skin"):
        plan(vary(organ, {"motion.entry": (0.02, 0.01)}))


def test_nothing_is_planned_on_a_tissue_that_fails_a_check(organ: Scene) -> None:
    simulation = Simulation(organ)
    broken = simulation.model.stiffness.matrix  # no longer symmetric, nor blind to rigid motion
    broken.data[100] *= 1.0 + 1e-6
    with pytest.raises(CheckFailedError, match="refused: check 'rigid motion' gives"):
        simulation.check()


def test_oblique_needle(organ: Scene) -> None:
    found = plan(vary(organ, {"motion.direction": (0.28, 0.96)}))
    assert found.status is PlanStatus.PLANNED
    assert found.best.placement_error <= 1e-8


def test_a_plan_by_steps_is_that_of_the_march(organ: Scene) -> None:
    marched = plan(organ)
    stepped = plan(vary(organ, {"discretization.integrator": "quasi_static"}))
    assert stepped.status == marched.status
    assert stepped.best is not None
    assert marched.best is not None
    assert stepped.best.release_point == pytest.approx(marched.best.release_point, abs=1e-6)


def test_viscoelastic_tissue_is_planned_in_time(organ: Scene) -> None:
    laws = {
        name: Viscoelastic(
            youngs_modulus=law.youngs_modulus, poissons_ratio=0.45, shares=(0.3,), times=(1.0,)
        )
        for name, law in organ.materials.items()
    }
    found = plan(vary(organ, {"materials": laws, "discretization.time_step": 0.16}))
    elastic = plan(organ)
    assert found.best is not None
    assert elastic.best is not None
    assert found.best.placement_error < 1e-8
    apart = np.linalg.norm(found.best.release_point - elastic.best.release_point)
    assert 1e-5 < apart < 1e-3  # stiffer while it is pushed: less deep
