import itertools
from collections.abc import Callable

import numpy as np
import pytest

from needlefem import simulate
from needlefem.fem import CachedCompliance, DirectCompliance
from needlefem.insertion import (
    Insertion,
    Simulation,
    Status,
    TipTrajectory,
    displacements,
    energy_terms,
    validity,
)
from needlefem.insertion.tip_solver import TipSolver, not_found, smallest_turning
from needlefem.scene import Scene, Support, vary

Push = Callable[[Scene], Insertion]


def test_every_state_is_in_equilibrium_with_the_needle_on_its_line(
    organ: Scene, insert: Push
) -> None:
    """The full system, solved with the recorded forces, puts all points where the needle is."""
    insertion = insert(organ)
    model, axis = insertion.model, insertion.axis
    for number in (1, 5, len(insertion.states) - 1):
        state = insertion.states[number]
        field = model.nodal(displacements(insertion, [number])[:, 0])
        tip = state.tip + state.tip_weights @ field[state.tip_nodes]
        assert axis.axial_coordinate(tip) == pytest.approx(state.depth, abs=1e-10)
        assert axis.lateral_offset(tip) == pytest.approx([0.0], abs=1e-10)
        for segment, lateral, moved in zip(
            insertion.segments, state.lateral_force, state.segment_displacement, strict=False
        ):
            mean = axis.frame @ (segment.weights @ field[segment.nodes])
            assert mean == pytest.approx(moved, abs=1e-10)
            assert mean[1:] + segment.compliance * lateral == pytest.approx(
                -segment.offset, abs=1e-10
            )


def test_forces_are_those_of_the_model(organ: Scene, insert: Push) -> None:
    last = insert(organ).states[-1]
    assert last.tip_force == pytest.approx(organ.needle.cutting_force)
    lengths = last.friction_force[1:] / organ.needle.shaft_friction
    assert lengths[:-1] == pytest.approx(organ.discretization.path_spacing)
    assert 0.0 < lengths[-1] < organ.discretization.path_spacing  # the last ends at the depth
    assert last.friction_force[0] == 0.0


def test_path_leans_where_an_organ_turns(organ: Scene, insert: Push) -> None:
    plain = vary(organ, {"regions": {}})
    lean = [abs(insert(scene).tips[-1, 0] - 0.0287) for scene in (organ, plain)]
    assert lean[0] > 3.0 * lean[1]


def test_no_friction_no_cutting_force_jump(gel: Scene, insert: Push) -> None:
    insertion = insert(vary(gel, {"needle.shaft_friction": 0.0}))
    assert insertion.outcome.status is Status.COMPLETED
    assert insertion.states[-1].force == pytest.approx(gel.needle.cutting_force)


def test_a_condensed_corridor_gives_the_same_path(
    organ: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    plain = simulate(organ)
    monkeypatch.setattr("needlefem.insertion.tissue_response.MOST_SHARED_UNKNOWNS", 0)
    monkeypatch.setattr("needlefem.insertion.tissue_response.DENSE", np.inf)  # it costs nothing
    monkeypatch.setattr("needlefem.insertion.simulation.CORRIDOR", 0.5)  # it leaves this one
    narrow = Simulation(vary(organ, {"planning.offset_range": (0.0, 1e-9)}))
    found = narrow.move(narrow.entry_of_case())
    assert isinstance(narrow.responses, CachedCompliance)
    assert narrow.responses.solves < narrow.responses.size
    assert found.tips == pytest.approx(plain.tips, abs=1e-11)


def test_direct_responses_give_the_same_path(organ: Scene) -> None:
    shared, direct = Simulation(organ), Simulation(organ)
    direct.responses = DirectCompliance(direct.model)
    paths = [s.insert(s.entry_of_case()).tips for s in (shared, direct)]
    assert paths[0] == pytest.approx(paths[1], abs=1e-11)


def test_responses_are_chosen_by_the_number_of_loads(
    organ: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("needlefem.insertion.tissue_response.MOST_SHARED_UNKNOWNS", 0)
    monkeypatch.setattr("needlefem.insertion.tissue_response.DENSE", 0.3)  # products of high cost
    found = []
    for insertions in (1, 100):
        simulation = Simulation(organ, expected_insertions=insertions)
        insertion = simulation.insert(simulation.entry_of_case())
        found.append((simulation.responses, insertion.tips))
    (once, one_path), (often, other_path) = found
    assert isinstance(once, DirectCompliance)
    assert isinstance(often, CachedCompliance)
    assert once.solves < 1.2 * 16 * len(one_path)
    assert one_path == pytest.approx(other_path, abs=1e-11)


@pytest.mark.parametrize("integrator", ["path_following", "newmark"])
def test_few_loads_on_many_nodes_are_solved_for_one_by_one(
    organ: Scene, monkeypatch: pytest.MonkeyPatch, integrator: str
) -> None:
    changes = {"discretization.integrator": integrator, "discretization.path_spacing": 4e-3}
    density = {"materials.gel.density": 1000.0, "materials.stiff.density": 1000.0}
    scene = vary(organ, {**changes, **density, "motion.max_depth": 0.012})
    paths = []
    for margin in (1e-9, np.inf):
        monkeypatch.setattr("needlefem.insertion.tissue_response.MARGIN", margin)
        simulation = Simulation(scene)
        run = simulation.insertion_run(simulation.entry_of_case())
        paths.append(np.array([state.tip for state in run.iterate()]))
        kind = CachedCompliance if margin > 1.0 else DirectCompliance
        assert isinstance(run.tissue_response.responses, kind)
    assert paths[0] == pytest.approx(paths[1], abs=1e-11)


def test_stopping_early_keeps_the_path(gel: Scene) -> None:
    simulation = Simulation(gel)
    insertion = simulation.insert(simulation.entry_of_case(), lambda state: state.depth > 0.01)
    assert insertion.outcome.status is Status.STOPPED
    assert 0.01 < insertion.depths[-1] < 0.013


def test_needle_that_does_not_puncture(gel: Scene, insert: Push) -> None:
    insertion = insert(vary(gel, {"motion.max_depth": 5e-4}))
    assert insertion.outcome.status is Status.NOT_PUNCTURED
    assert insertion.depths[-1] == pytest.approx(5e-4)
    assert 0.0 < insertion.states[-1].tip_force < gel.needle.cutting_force
    assert TipTrajectory(insertion).at_depth(5e-4).point == pytest.approx(insertion.tips[0])
    assert energy_terms(insertion).residual < 1e-12


def test_needle_that_leaves_the_tissue(gel: Scene, insert: Push) -> None:
    free = {"walls": Support(faces=("y_min", "y_max"))}
    insertion = insert(vary(gel, {"supports": free, "motion.max_depth": 0.2}))
    assert insertion.outcome.status is Status.LEFT_TISSUE
    assert insertion.tips[-1, 1] == pytest.approx(0.06, abs=3e-3)


def test_snap_lands_where_resistance_is_back(popping: Scene, insert: Push) -> None:
    insertion = insert(popping)
    assert len(insertion.ruptures) == 1
    snap = insertion.ruptures[0]
    states = insertion.states
    inside = states[snap.first + 1 : snap.last]
    assert all(
        state.tip_phase == "rupture" and state.tip_force > state.cutting_force for state in inside
    )
    assert all(state.depth == snap.depth for state in inside)
    landing = states[snap.last]
    assert landing.tip_force == pytest.approx(landing.cutting_force, rel=1e-6)
    assert landing.depth == snap.depth
    energies = energy_terms(insertion)
    assert energies.rupture > 0.0
    assert energies.residual < 1e-10


def test_snap_ends_where_the_branch_at_cutting_force_comes_back(popping: Scene) -> None:
    """On a straight path the landing is where depth at cutting force is back at the snap's.

    Independent of the jump itself: the branch is followed with depth falling and rising again.
    """
    centred = vary(
        popping,
        {
            "regions.organ.contour": popping.regions["organ"].contour.moved(
                np.array([-0.006, 0.0])
            ),
            "motion.entry": (0.03, 0.0),
            "mesh.pattern": "crossed",
        },
    )
    simulation = Simulation(centred)
    entry = simulation.entry_of_case()
    insertion = simulation.insert(entry)
    snap = insertion.ruptures[0]
    from needlefem.insertion import PathFollowing

    path_following = PathFollowing(simulation.instrument(entry), simulation.responses, 1.0)
    for _ in path_following._puncture():
        pass
    depth, tips = [path_following.states[-1].depth], [path_following.states[-1].tip[1]]
    path_following._check_slip = lambda *_: None  # type: ignore[method-assign]
    while not (len(depth) > 3 and depth[-1] > snap.depth and min(depth[-20:]) < depth[-1] - 1e-4):
        state = path_following._accept(path_following._solve(simulation.instrument(entry).spacing))
        depth.append(state.depth)
        tips.append(state.tip[1])
        if tips[-1] > insertion.states[snap.last].tip[1] + 3e-3:
            break
    after = np.flatnonzero(np.array(tips) > insertion.states[snap.first].tip[1] + 2e-3)
    back = np.interp(snap.depth, np.array(depth)[after], np.array(tips)[after])
    assert insertion.states[snap.last].tip[1] == pytest.approx(back, abs=2e-4)


def test_a_snap_begins_at_the_largest_depth(popping: Scene) -> None:
    """Steps of many lengths from the state before it reach no depth beyond."""
    simulation = Simulation(popping)
    entry = simulation.entry_of_case()
    snap = simulation.insert(entry).ruptures[0]
    from needlefem.insertion import PathFollowing

    path_following = PathFollowing(simulation.instrument(entry), simulation.responses, 1.0)
    list(itertools.islice(path_following.iterate(), snap.first))
    low, high, highest = 0.02, 1.0, 0.0
    for _ in range(4):  # nested scans: depth has a kink at its maximum
        shares = np.linspace(low, high, 41)
        depths = [
            path_following._solve(share * popping.discretization.path_spacing).depth
            for share in shares
        ]
        peak = int(np.argmax(depths))
        assert 0 < peak < len(shares) - 1
        low, high, highest = shares[peak - 1], shares[peak + 1], depths[peak]
    assert snap.depth == pytest.approx(highest, abs=5e-9)
    assert snap.depth > path_following.states[-1].depth + 1e-7


def test_material_jumped_over_is_never_reached(popping: Scene, insert: Push) -> None:
    insertion = insert(popping)
    snap, path = insertion.ruptures[0], TipTrajectory(insertion)
    before, after = insertion.states[snap.first].tip, insertion.states[snap.last].tip
    assert path.at_target_depth(0.5 * (before + after)) is None
    assert path.at_target_depth(before - np.array([0.0, 1e-3])) is not None
    assert path.at_target_depth(after + np.array([0.0, 1e-3])) is not None
    assert path.at_depth(snap.depth - 1e-6).point[1] <= before[1]
    assert path.at_depth(snap.depth + 1e-6).point[1] == pytest.approx(after[1], abs=1e-5)


def test_shaft_point_that_sticks_ends_the_march(gel: Scene) -> None:
    simulation = Simulation(gel)
    from needlefem.insertion import PathFollowing

    path_following = PathFollowing(
        simulation.instrument(simulation.entry_of_case()), simulation.responses, 0.03
    )
    states = path_following.iterate()
    for _ in range(6):
        next(states)
    last = path_following.states[-1]
    ahead = last.segment_displacement + np.array(
        [-1e-2, 0.0]
    )  # as if the points had been further back
    path_following.states[-1] = vary(last, {"segment_displacement": ahead})  # type: ignore[arg-type,assignment]
    list(states)
    assert path_following.outcome.status is Status.STICK_DETECTED
    assert "stops slipping at depth" in path_following.outcome.sentence
    assert len(path_following.states) == 6


def test_no_equilibrium_is_a_status(gel: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("needlefem.insertion.tip_solver.MOST_ITERATIONS", 0)
    insertion = simulate(gel)
    assert insertion.outcome.status is Status.NOT_CONVERGED
    assert len(insertion.states) == 2


def test_step_solver_learns(gel: Scene) -> None:
    simulation = Simulation(gel)
    insertion = simulation.insert(simulation.entry_of_case())
    assert insertion.contact_solves <= 5 * len(insertion.states)
    assert isinstance(TipSolver, type)


@pytest.mark.parametrize("element", ["P1", "P2"])
def test_the_balance_closes_by_both_formulas(organ: Scene, insert: Push, element: str) -> None:
    insertion = insert(vary(organ, {"discretization.element": element}))
    consistent, trapezoidal = energy_terms(insertion), energy_terms(insertion, trapezoidal=True)
    assert consistent.strain_energy_mismatch < 1e-12
    assert consistent.residual < 1e-12
    assert trapezoidal.residual < 5e-3
    assert trapezoidal.cutting == pytest.approx(consistent.cutting, rel=2e-2)
    assert consistent.rupture == 0.0


def test_validity_counts_folds(gel: Scene, insert: Push) -> None:
    mild = validity(insert(gel), -1)
    assert mild.inverted_cells == 0
    assert mild.largest_strain < 0.3
    assert mild.warnings() == []
    soft = vary(gel, {"materials.gel.youngs_modulus": 3e3, "motion.max_depth": 0.035})
    wild = validity(insert(soft), -1)
    assert wild.largest_strain > 0.3
    assert "beyond small strain" in wild.warnings()[0]


def test_the_last_step_ends_at_the_depth_in_soft_tissue(gel: Scene) -> None:
    soft = vary(gel, {"materials.gel.youngs_modulus": 6e3, "motion.max_depth": 0.045})
    simulation = Simulation(soft)
    insertion = simulation.insert(simulation.entry_of_case())
    assert insertion.outcome.status is Status.COMPLETED
    assert insertion.states[-1].depth == 0.045


@pytest.mark.parametrize("part", [0.1, 0.5, 0.9])
def test_a_predicted_last_step_is_that_found_by_bracketing(
    organ: Scene, monkeypatch: pytest.MonkeyPatch, part: float
) -> None:
    whole = Simulation(organ)
    depths = whole.insert(whole.entry_of_case()).depths
    depth = float(depths[-3] + part * (depths[-2] - depths[-3]))
    scene = vary(organ, {"motion.max_depth": depth})
    simulation = Simulation(scene, whole.model)
    predicted = simulation.insert(simulation.entry_of_case())
    assert predicted.states[-1].depth == depth
    monkeypatch.setattr("needlefem.insertion.path_following.SURE", 0.0)
    bracketed = Simulation(scene, whole.model)
    found = bracketed.insert(bracketed.entry_of_case())
    assert predicted.tips == pytest.approx(found.tips, abs=1e-11)
    assert predicted.states[-1].force == pytest.approx(found.states[-1].force, rel=1e-8)
    assert predicted.contact_solves < found.contact_solves


def test_a_march_nearby_predicts_the_last_step(organ: Scene) -> None:
    simulation = Simulation(organ)
    beside = np.array(organ.target) + np.array([1e-6, 0.0])
    simulation.insert(simulation.entry_through(np.array(organ.target)))
    guided = simulation.insert(simulation.entry_through(beside))
    assert guided.states[-1].depth == organ.motion.max_depth
    alone = Simulation(organ, simulation.model)
    found = alone.insert(alone.entry_through(beside))
    assert guided.tips[-1] == pytest.approx(found.tips[-1], abs=1e-11)


def test_the_smallest_turning_of_two_lateral_directions() -> None:
    matrix = np.array([[1.0, 0.3], [0.1, 0.2]])
    found = smallest_turning(lambda across: matrix @ across + 1e-4, np.array([1e-3, 0.0]), 2e-3)
    assert found == pytest.approx(min(np.linalg.eigvals(matrix)))


def test_a_step_without_equilibrium_names_its_remedy() -> None:
    plane, space = np.array([0.01, 0.02]), np.array([0.01, 0.02, 0.03])
    strained = not_found(1e-3, space, 0.1, 3.0)
    assert "lower the cutting force there, to about 1.5 N, " in strained
    assert "1.5 N/m" in not_found(1e-3, plane, -1.0, 3.0)
    assert "path_spacing" in not_found(1e-3, plane, 0.9, 3.0)
    assert "path_spacing" in not_found(1e-3, plane, float("nan"), 3.0)
