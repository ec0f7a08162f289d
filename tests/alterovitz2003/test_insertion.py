import numpy as np
import pytest

from needlefem.alterovitz2003.movable_mesh import MovableMesh
from needlefem.alterovitz2003.moving_tissue import MovingTissue, TissueInTime
from needlefem.alterovitz2003.node_chain import LEAST_AREA
from needlefem.alterovitz2003.simulation import ConformingInsertion
from needlefem.dynamics import Damping, Newmark, TissueSystem
from needlefem.errors import CaseError, SimulationError
from needlefem.fem import LinearFunctionals, TissueModel
from needlefem.insertion import Simulation, Status, TipPhase
from needlefem.insertion import TipTrajectory as CutPath
from needlefem.scene import Scene, vary

CALM = Newmark(beta=0.3025, gamma=0.6)
DAMPING = Damping(mass_rate=5.0, stiffness_time=2e-3)
STEP = 1.0 / 30.0
SPEED = 5e-3


def tissue_of(simulation: Simulation, **options: bool) -> TissueInTime:
    return TissueInTime(simulation.model, CALM, STEP, DAMPING, **options)


def inserted(
    simulation: Simulation, tissue: TissueInTime, height: float, *, spread: bool = True
) -> ConformingInsertion:
    entry = simulation.entry_through(np.array([height, 0.02]))
    return ConformingInsertion(simulation.instrument(entry), tissue, spread=spread)


def depths_to(depth: float) -> np.ndarray:
    return np.arange(1, int(np.ceil(depth / (SPEED * STEP))) + 1) * SPEED * STEP


def least_ratio(mesh: MovableMesh) -> float:
    every = np.arange(len(mesh.cells))
    return float(mesh.ratios(every, mesh.corners(every)).min())


def moved_model(model: TissueModel, mesh: MovableMesh) -> TissueModel:
    """Return the tissue assembled anew by scikit-fem on the moved nodes."""
    import dataclasses

    points = model.mesh.p.copy()
    vertex = np.zeros(model.nnodes, dtype=int)
    vertex[model.cell_nodes] = model.mesh.t.T
    points[:, vertex] = mesh.points.T
    moved = dataclasses.replace(model.mesh, doflocs=points)
    return TissueModel(moved, model.element, model.materials, model.supports, model.axes)


def test_element_matrices_are_those_of_scikit_fem(organ: Scene) -> None:
    simulation = Simulation(organ)
    insertion = inserted(simulation, tissue_of(simulation), 0.0287)
    list(insertion.iterate(depths_to(0.02)))
    mesh, model = insertion.chain.mesh, simulation.model
    assert len(mesh.moved) > 5
    again = moved_model(model, mesh)
    nodes, stiffness, mass = mesh.change()
    dofs = model.node_dofs[nodes].ravel()
    difference = (again.stiffness.matrix - model.stiffness.matrix).toarray()
    scale = abs(again.stiffness.matrix).max()
    assert difference[np.ix_(dofs, dofs)] == pytest.approx(stiffness, abs=1e-12 * scale)
    difference[np.ix_(dofs, dofs)] = 0.0
    assert abs(difference).max() <= 1e-12 * scale
    lumped = again.lumped_mass("row-sum") - model.lumped_mass("row-sum")
    assert lumped[dofs] == pytest.approx(mass, abs=1e-12 * lumped.max())


@pytest.mark.parametrize("refactor", [False, True])
def test_responses_of_updated_matrices_are_those_of_assembled_ones(
    organ: Scene, *, refactor: bool
) -> None:
    """The tip's node moved on top of a frozen correction, against a new model and factor."""
    simulation = Simulation(organ)
    shared = tissue_of(simulation, refactor=refactor)
    insertion = inserted(simulation, shared, 0.0287, spread=False)
    list(insertion.iterate(depths_to(0.02)))
    tissue, node = insertion.tissue, insertion.chain.tip_node
    point = insertion.chain.tip + np.array([1e-4, 3e-4])
    tissue.begin()
    response = tissue.respond(point, LinearFunctionals(np.array([node]), np.ones((1, 1))))
    insertion.chain.mesh.place(node, point)
    again = moved_model(simulation.model, insertion.chain.mesh)
    system = TissueSystem(again, DAMPING, lumping="row-sum")
    factor = CALM.stepper(system, STEP).factor
    nodes = np.append(insertion.chain.nodes, node)
    rows = np.zeros((2 * len(nodes), len(again.free_dofs)))
    equation = np.full(again.ndofs, -1)
    equation[again.free_dofs] = np.arange(len(again.free_dofs))
    axial, lateral = (np.array([equation[again.node_dofs[n]] for n in nodes])[:, i] for i in (1, 0))
    order = np.concatenate([axial[:-1], lateral[:-1], axial[-1:], lateral[-1:]])
    rows[np.arange(len(order)), order] = 1.0
    expected = rows @ factor.solve(np.ascontiguousarray(rows.T))
    assert response.compliance == pytest.approx(expected, abs=1e-12 * expected.max())


def test_correcting_and_factorising_give_the_same_insertion(organ: Scene) -> None:
    simulation = Simulation(organ)
    tips = []
    for refactor in (False, True):
        tissue = tissue_of(simulation, refactor=refactor)
        insertion = inserted(simulation, tissue, 0.0287)
        tips.append([state.tip for state in insertion.iterate(depths_to(0.02))])
    assert np.array(tips[0]) == pytest.approx(np.array(tips[1]), abs=1e-9)


def test_a_step_of_the_moved_tissue_is_newmarks(organ: Scene) -> None:
    """The motion after a step solves the step's equation with matrices assembled anew."""
    simulation = Simulation(organ)
    insertion = inserted(simulation, tissue_of(simulation), 0.0287, spread=False)
    list(insertion.iterate(depths_to(0.015)))
    tissue: MovingTissue = insertion.tissue
    system = TissueSystem(
        moved_model(simulation.model, insertion.chain.mesh), DAMPING, lumping="row-sum"
    )
    stepper = CALM.stepper(system, STEP)
    tissue.begin()
    tip = LinearFunctionals(np.array([insertion.chain.tip_node]), np.ones((1, 1)))
    response = tissue.respond(insertion.chain.tip, tip)
    start = tissue.motion
    tissue.finish(response, np.zeros(len(response.free)))
    free = stepper.free_displacement(start)
    assert tissue.motion.u == pytest.approx(free, abs=1e-11 * np.abs(free).max())


@pytest.mark.parametrize("direction", [(0.0, 1.0), (0.28, 0.96)])
@pytest.mark.parametrize("pattern", ["diagonal", "crossed"])
def test_no_cell_turns_over_at_any_height(
    gel: Scene, pattern: str, direction: tuple[float, float]
) -> None:
    changes = {"mesh.pattern": pattern, "motion.direction": direction, "mesh.divisions": (14, 14)}
    simulation = Simulation(vary(gel, changes))
    tissue = tissue_of(simulation)
    for height in np.random.default_rng(7).uniform(0.024, 0.036, size=3):
        insertion = inserted(simulation, tissue, float(height), spread=False)
        least = [least_ratio(tissue.mesh) for _ in insertion.iterate(depths_to(0.02))]
        may = [Status.COMPLETED, *([Status.NO_NODE] if pattern == "crossed" else [])]
        assert insertion.outcome.status in may
        assert min(least) >= 0.5 * LEAST_AREA
        assert len(tissue.mesh.moved) > 2


def test_shaft_nodes_lie_on_the_axis_and_forces_within_limits(organ: Scene) -> None:
    simulation = Simulation(organ)
    insertion = inserted(simulation, tissue_of(simulation), 0.0287, spread=False)
    *_, last = insertion.iterate(depths_to(0.02))
    chain, tissue = insertion.chain, insertion.tissue
    nodes = np.append(chain.nodes, chain.tip_node)
    moved = tissue.moved(LinearFunctionals(nodes, np.eye(len(nodes))))
    where = chain.mesh.points[nodes] + moved
    assert insertion.axis.lateral_offset(where)[:, 0] == pytest.approx(0.0, abs=2e-6)
    assert insertion.axis.axial_coordinate(where[-1]) == pytest.approx(last.depth, abs=2e-6)
    limit = organ.needle.shaft_friction * chain.shares(chain.tip)
    assert np.all(np.abs(last.friction_force) <= limit * (1.0 + 1e-9))
    assert np.sum(last.friction_force) == pytest.approx(
        organ.needle.shaft_friction * last.inserted_length
    )
    assert last.tip_force == pytest.approx(organ.needle.cutting_force)


def test_nodes_return_home_when_the_needle_is_gone(organ: Scene) -> None:
    simulation = Simulation(organ)
    tissue = tissue_of(simulation)
    insertion = inserted(simulation, tissue, 0.0287, spread=False)
    there = depths_to(0.015)
    deepest = list(insertion.iterate(there))[-1]
    moved = len(tissue.mesh.moved)
    back = np.concatenate([there[-2::-1], np.full(200, 0.0) - 1e-3])
    states, least = [], []
    for state in insertion.iterate(back):
        states.append(state)
        least.append(least_ratio(tissue.mesh))
    assert moved > 3
    assert min(least) > 0.0
    assert states[0].tip_phase is TipPhase.RETRACTED
    assert (
        min(state.friction_force.sum() for state in states if len(state.friction_force))
        < 0.0
        < deepest.force
    )
    mesh = MovableMesh(simulation.model)
    assert not len(tissue.mesh.moved)
    assert np.array_equal(tissue.mesh.points, mesh.points)
    assert np.array_equal(tissue.mesh.stiffness, mesh.stiffness)
    still = insertion.tissue.motion
    assert np.abs(still.u).max() < 1e-3 * deepest.depth
    with pytest.raises(SimulationError, match="can't be inserted again"):
        insertion.advance(0.01)


def test_holding_keeps_what_sticks(gel: Scene) -> None:
    simulation = Simulation(gel)
    insertion = inserted(simulation, tissue_of(simulation), 0.0287)
    pushed = list(insertion.iterate(depths_to(0.012)))[-1]
    held = list(insertion.iterate(np.full(60, pushed.depth)))[-1]
    assert held.tip == pytest.approx(pushed.tip, abs=1e-5)
    assert 0.0 < held.tip_force <= pushed.tip_force * (1.0 + 1e-9)


def test_embedded_and_conforming_agree_under_refinement(organ: Scene) -> None:
    """Same kernel, both at P1: where the needle is after 1.8 cm."""
    apart = []
    for divisions in (15, 24, 38):
        simulation = Simulation(vary(organ, {"mesh.divisions": (divisions, divisions)}))
        entry = simulation.entry_through(np.array([0.0287, 0.02]))
        path = CutPath(simulation.insert(entry, lambda state: state.depth > 0.02))
        insertion = inserted(simulation, tissue_of(simulation), 0.0287)
        *_, last = insertion.iterate(depths_to(0.018))
        apart.append(np.linalg.norm(last.tip - path.at_depth(last.depth).point))
    assert apart[0] > apart[1] > apart[2]
    assert apart[2] < 2e-4


def test_no_place_for_a_node_is_a_status(gel: Scene) -> None:
    """A block with nodes on its faces alone: the path so far is that to the skin's puncture."""
    simulation = Simulation(vary(gel, {"mesh.divisions": (2, 1)}))
    insertion = inserted(simulation, tissue_of(simulation), 0.0287, spread=False)
    states = list(insertion.iterate(depths_to(0.2)))
    assert insertion.outcome.status is Status.NO_NODE
    assert "no node can be moved to (2.87" in insertion.outcome.sentence
    assert states[-1].tip == pytest.approx([0.0287, 0.0])
    assert states[-1].tip_force > gel.needle.cutting_force


def test_other_elements_are_refused(gel: Scene) -> None:
    simulation = Simulation(vary(gel, {"discretization.element": "P2"}))
    with pytest.raises(CaseError, match="only nodes of P1 triangles can be moved"):
        tissue_of(simulation)
