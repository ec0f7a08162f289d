"""Plans keep away from obstacles, and say what these cost."""

import numpy as np
import pytest

from needlefem import plan
from needlefem.errors import CaseError
from needlefem.geometry import Contour
from needlefem.insertion import Simulation
from needlefem.needle import InsertionAxis, distance
from needlefem.planning import Plan, Planner, PlanStatus
from needlefem.scene import Obstacle, Region, Scene, Support, vary


def rod(low: float, high: float) -> Contour:
    """Return a bar across the way of needles, from 5 to 8 mm deep."""
    return Contour(np.array([[low, 0.005], [high, 0.005], [high, 0.008], [low, 0.008]]))


def behind(scene: Scene, *bars: Contour) -> Scene:
    """Return a scene with bars that the needle has to keep 1 mm away from."""
    names = [f"bar {number}" for number in range(len(bars))]
    obstacles = {
        name: Obstacle(contour=bar, clearance=1e-3) for name, bar in zip(names, bars, strict=True)
    }
    return vary(scene, {"obstacles": obstacles})


def kept(found: Plan, bar: Contour) -> float:
    """Return the distance of the planned needle to a bar."""
    return distance(
        InsertionAxis(found.best.release_point, found.insertion.axis.direction), 0.0, bar
    )


@pytest.fixture
def organ(organ: Scene) -> Scene:
    """Return the organ, coarse: what is tested is geometry and the search."""
    return vary(
        organ,
        {
            "mesh.divisions": (12, 12),
            "needle.tip_radius": 5e-3,
            "discretization.path_spacing": 2.5e-3,
            "planning.interval_tolerance": 3e-4,
        },
    )


@pytest.fixture
def free(organ: Scene) -> Plan:
    return plan(organ)


def test_an_obstacle_out_of_the_way_changes_nothing(organ: Scene, free: Plan) -> None:
    found = plan(behind(organ, rod(0.04, 0.05)))
    assert found.status is PlanStatus.PLANNED
    assert found.blocked is None
    assert np.array_equal(found.best.release_point, free.best.release_point)
    assert found.insertions == free.insertions
    (passing,) = found.passings
    assert passing.distance == pytest.approx(0.04 - free.best.release_point[0], abs=1e-12)


def test_the_best_height_allowed_is_at_the_edge(organ: Scene, free: Plan) -> None:
    height = free.best.release_point[0]
    bar = rod(height - 0.01, height - 0.0005)
    found = plan(behind(organ, bar))
    assert found.status is PlanStatus.BLOCKED
    assert found.best.release_point[0] == pytest.approx(height + 0.0005, abs=1e-9)
    assert kept(found, bar) == pytest.approx(1e-3, abs=1e-9)
    assert found.best.placement_error > 100.0 * found.blocked.release.placement_error
    assert found.blocked.release.release_point == pytest.approx(free.best.release_point)
    assert found.blocked.passing.distance == pytest.approx(0.0005, abs=1e-9)
    assert "'bar 0'" in found.sentence
    assert "0.05 cm" in found.sentence


def test_golden_section_is_blocked_alike(organ: Scene, free: Plan) -> None:
    height = free.best.release_point[0]
    scene = behind(organ, rod(height - 0.01, height - 0.0005))
    by_root, by_golden = plan(scene), plan(scene, search="golden")
    assert by_golden.status is PlanStatus.BLOCKED
    assert by_golden.best.release_point == pytest.approx(by_root.best.release_point, abs=3e-4)


def test_with_all_heights_blocked_the_target_is_unreachable(organ: Scene, free: Plan) -> None:
    found = plan(behind(organ, rod(0.01, 0.05)))
    assert found.status is PlanStatus.UNREACHABLE
    assert found.best is None
    assert found.passings == ()
    assert "goes through 'bar 0'" in found.sentence


def test_heights_between_two_obstacles_are_found(organ: Scene, free: Plan) -> None:
    height = free.best.release_point[0]
    found = plan(behind(organ, rod(0.0, height - 0.00101), rod(height + 0.00101, 0.06)))
    assert found.status is PlanStatus.PLANNED
    assert found.blocked is None
    narrow = plan(behind(organ, rod(0.0, height - 0.0013), rod(height + 0.0009, 0.06)))
    assert narrow.status is PlanStatus.BLOCKED
    assert narrow.best.release_point[0] == pytest.approx(height - 0.0001, abs=1e-9)


def test_a_deeper_release_may_meet_what_a_shallower_one_does_not(organ: Scene, free: Plan) -> None:
    height, depth = free.best.release_point
    ahead = rod(height - 0.02, height + 0.02).moved(np.array([0.0, depth + 0.0009 - 0.005]))
    found = plan(behind(organ, ahead))
    assert found.status is PlanStatus.UNREACHABLE
    off = ahead.moved(np.array([0.0, 0.0002]))
    assert plan(behind(organ, off)).status is PlanStatus.PLANNED


def test_other_directions_are_tried_in_turn(organ: Scene) -> None:
    scene = behind(organ, rod(0.0245, 0.0335))
    assert plan(scene).status is PlanStatus.UNREACHABLE
    turned = vary(scene, {"planning.directions": ((0.05, 1.0), (0.6, 1.0), (2.0, 1.0))})
    found = plan(turned)
    assert found.status is PlanStatus.PLANNED
    assert found.insertion.axis.direction == pytest.approx(np.array([0.6, 1.0]) / 1.36**0.5)
    assert [refusal.status for refusal in found.rejected_directions] == [PlanStatus.UNREACHABLE] * 2
    assert found.rejected_directions[0].direction == (0.0, 1.0)
    assert kept(found, scene.obstacles["bar 0"].contour) > 1e-3


def test_blocked_solutions_are_not_among_the_others(organ: Scene, free: Plan) -> None:
    height = free.best.release_point[0]
    bar = rod(height - 0.01, height - 0.0005)
    planner = Planner(Simulation(behind(organ, bar)), np.array(organ.target))
    assert planner.plan("root", all_solutions=True).other_solutions == ()


def test_a_held_region_does_not_move_and_an_obstacle_that_may_is_warned_of(gel: Scene) -> None:
    bone = rod(0.035, 0.045)
    scene = vary(
        gel,
        {
            "regions": {"bone": Region(contour=bone, material="gel")},
            "obstacles": {"bone": Obstacle(contour=bone, region="bone", clearance=1e-3)},
        },
    )
    assert any("'bone' is not supported" in text for text in plan(scene).evidence.warnings)
    held = vary(scene, {"supports": {**gel.supports, "bone": Support(regions=("bone",))}})
    found = plan(held)
    assert not any("held" in text for text in found.evidence.warnings)
    model = found.insertion.model
    nodes = np.unique(model.cell_nodes[model.mesh.subdomains["bone"]])
    assert np.isin(model.node_dofs[nodes], model.held_dofs).all()


def test_a_needle_can_not_enter_through_held_tissue(gel: Scene) -> None:
    plate = Contour(np.array([[0.02, 0.0], [0.04, 0.0], [0.04, 0.006], [0.02, 0.006]]))
    scene = vary(
        gel,
        {
            "regions": {"plate": Region(contour=plate, material="gel")},
            "supports": {**gel.supports, "plate": Support(regions=("plate",))},
        },
    )
    with pytest.raises(CaseError, match="is fixed by a support"):
        plan(scene)
