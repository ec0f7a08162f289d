import numpy as np
import pytest

from needlefem.alterovitz2003.plan import drift, own_plan, paper_plan, refined, unplanned
from needlefem.alterovitz2003.simulation import InTime, NodeSimulation
from needlefem.errors import CaseError
from needlefem.insertion import Status, TipTrajectory
from needlefem.planning import PlanStatus
from needlefem.scene import Scene, vary


@pytest.fixture
def coarse(organ: Scene) -> Scene:
    """Return the organ, shallow and coarse: an insertion takes a tenth of a second."""
    return vary(
        organ,
        {
            "mesh.divisions": (15, 15),
            "target": (0.0287, 0.011),
            "motion.max_depth": 0.022,
            "motion.speed": 1e-2,
        },
    )


def test_paper_plan_ends_near_ours_and_says_what_it_spent(coarse: Scene) -> None:
    paper = paper_plan(coarse, InTime(spread=True))
    ours = own_plan(coarse).plan
    assert paper.plan.status is PlanStatus.PLANNED
    assert paper.plan.best.release_point == pytest.approx(ours.best.release_point, abs=5e-4)
    assert paper.plan.best.placement_error < 1e-4
    assert paper.plan.insertions == 10
    assert paper.steps > 20 * paper.plan.insertions
    assert all(check.passed for check in paper.plan.evidence.preflight)


def test_forces_at_nodes_are_warned_of(coarse: Scene) -> None:
    narrow = vary(coarse, {"planning.offset_range": (0.0, 1e-4)})
    warnings = " ".join(paper_plan(narrow).plan.evidence.warnings)
    assert "forces act on nodes: the result does not converge under refinement" in warnings


def test_insertion_reads_like_a_march(coarse: Scene) -> None:
    """Touch, puncture, then material points in order; before the puncture it is the entry."""
    simulation = NodeSimulation(coarse)
    entry = simulation.entry_through(np.array(coarse.target))
    insertion = simulation.insert(entry)
    assert insertion.outcome.status is Status.COMPLETED
    assert insertion.states[0].depth == insertion.states[0].tip_force == 0.0
    assert insertion.tips[:2] == pytest.approx(np.array([entry.point, entry.point]))
    assert insertion.first_cut == 1
    assert np.all(np.diff(insertion.depths) > 0.0)
    steps = np.linalg.norm(np.diff(insertion.tips[2:], axis=0), axis=1)
    assert steps.min() > 0.2 * coarse.motion.speed / 30.0
    path = TipTrajectory(insertion)
    assert path.at_depth(0.5 * path.puncture_depth).point == pytest.approx(entry.point)
    assert path.at_depth(0.02).depth == pytest.approx(0.02, abs=1e-12)


def test_an_uncut_skin_is_a_status(coarse: Scene) -> None:
    shallow = NodeSimulation(vary(coarse, {"motion.max_depth": 1e-3}))
    reach, insertion = unplanned(shallow, np.array(coarse.target))
    assert insertion.outcome.status is Status.NOT_PUNCTURED
    assert reach is None


def test_drift_is_that_of_meshes_refined(coarse: Scene) -> None:
    first, second = drift(coarse, None)
    assert refined(coarse, 2).mesh.divisions == (30, 30)
    assert (first.refined, second.refined) == (1, 2)
    assert 0.0 < np.linalg.norm(first.placed_at - second.placed_at) < 1e-3


def test_other_elements_and_no_target_are_refused(coarse: Scene) -> None:
    with pytest.raises(CaseError, match="set it to 'P1'"):
        paper_plan(vary(coarse, {"discretization.element": "P2"}))
    with pytest.raises(CaseError, match="give a target"):
        paper_plan(vary(coarse, {"target": None}))
