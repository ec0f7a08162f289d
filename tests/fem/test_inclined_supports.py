"""Supports along any direction: the results of a turned tissue are the turned results."""

import numpy as np
import pytest

from needlefem import build_model
from needlefem._arrays import SkfemMesh
from needlefem.checks import square_mesh
from needlefem.elements import CATALOGUE
from needlefem.errors import CaseError
from needlefem.fem import (
    BoundaryValueProblem,
    CachedCompliance,
    CondensedCorridor,
    Corridor,
    DirectCompliance,
)
from needlefem.insertion import Simulation, energy_terms, tissue_response
from needlefem.materials import Isotropic, Viscoelastic
from needlefem.planning import estimate
from needlefem.planning.adaptive import PlanRequest, attempt_plan
from needlefem.scene import Scene, Support, build_mesh, vary, with_element
from needlefem.stress import turned_mesh, turned_scene

ANGLE = 0.6
TURN = np.array([[np.cos(ANGLE), -np.sin(ANGLE)], [np.sin(ANGLE), np.cos(ANGLE)]])


@pytest.mark.parametrize("name", CATALOGUE)
def test_block_on_an_inclined_plane_of_rollers(name: str) -> None:
    """Uniaxial stress is exact on any mesh: rollers below and at one side, pressed from above."""
    element, law = CATALOGUE[name], Isotropic(youngs_modulus=1e4, poissons_ratio=0.3)
    mesh = turned_mesh(square_mesh(element, 4), TURN)
    below, side = TURN @ [0.0, 1.0], TURN @ [1.0, 0.0]
    problem = BoundaryValueProblem(mesh, element, law)
    problem.fix(lambda x: x @ below < 1e-9, direction=below)
    problem.fix(lambda x: x @ side < 1e-9, direction=-2.0 * side)
    problem.apply_traction(lambda _, normals: -100.0 * normals, lambda x: x @ below > 1.0 - 1e-9)
    found = problem.solve().at(np.array([TURN @ [1.0, 1.0]]))[0] @ TURN
    modulus, ratio = 1e4 / (1.0 - 0.3**2), 0.3 / (1.0 - 0.3)  # plane strain
    assert found == pytest.approx([100.0 / modulus * ratio, -100.0 / modulus], rel=1e-9)


def test_prescribed_displacement_on_an_inclined_plane() -> None:
    """A linear field prescribed along two oblique directions at each node is a patch test."""
    element, law = CATALOGUE["P2"], Isotropic(youngs_modulus=1e4, poissons_ratio=0.3)
    gradient = np.array([[0.01, 0.02], [-0.03, 0.005]])
    problem = BoundaryValueProblem(square_mesh(element, 3), element, law)
    for direction in ([1.0, 0.4], [-0.3, 1.0]):
        problem.fix(None, lambda x: x @ gradient.T, direction=direction)
    solved = problem.solve()
    assert solved.l2_error(lambda x: x @ gradient.T) < 1e-12


STIFF = Isotropic(youngs_modulus=30e3, poissons_ratio=0.45, density=1000.0)
SLOW = Viscoelastic(
    youngs_modulus=30e3, poissons_ratio=0.45, density=1000.0, shares=(0.5,), times=(1.0,)
)
IN_TIME = {"motion.speed": 0.05, "discretization.time_step": 0.02}
TISSUES = {
    "elastic": {"materials.gel": STIFF},
    "viscoelastic": {"materials.gel": SLOW, "discretization.integrator": "quasi_static"} | IN_TIME,
    "dynamic": {"materials.gel": STIFF, "discretization.integrator": "generalized_alpha"} | IN_TIME,
}


def beside_rollers(gel: Scene, element: str, tissue: str) -> tuple[Scene, Scene, SkfemMesh]:
    """Return a scene whose needle touches nodes of rollers, its image, and the image's mesh."""
    changes = {
        "mesh.divisions": (12, 12),
        "discretization.path_spacing": 2e-3,
        "supports": {
            "rollers": Support(faces=("y_min",), fixed=("y",)),
            "floor": Support(faces=("z_max",)),
        },
        "motion.entry": (0.004, 0.0),
        "motion.max_depth": 0.02,
        "target": (0.004, 0.012),
    }
    scene = with_element(vary(gel, changes | TISSUES[tissue]), element)
    return scene, turned_scene(scene, TURN), turned_mesh(build_mesh(scene), TURN)


@pytest.mark.parametrize("element", ["P1", "P2", "Q2-Q1"])
@pytest.mark.parametrize("tissue", TISSUES)
def test_insertion_beside_rollers_turns_with_the_scene(
    gel: Scene, element: str, tissue: str
) -> None:
    """The needle touches nodes of the rollers, so that their frames enter its contact."""
    scene, image, mesh = beside_rollers(gel, element, tissue)
    turned = build_model(image, mesh)
    assert turned.frames is not None
    found = Simulation(scene)
    other = Simulation(image, turned)
    inserted = [s.insert(s.entry_of_case()) for s in (found, other)]
    assert inserted[0].outcome.status == inserted[1].outcome.status == "completed"
    rollers = np.flatnonzero(np.isin(found.model.nodes[:, 0], 0.0))
    touched = np.concatenate([piece.nodes for piece in inserted[0].segments])
    assert np.isin(touched, rollers).any()
    assert inserted[1].tips == pytest.approx(inserted[0].tips @ TURN.T, abs=1e-10)
    forces = [[state.force for state in insertion.states] for insertion in inserted]
    assert forces[1] == pytest.approx(forces[0], rel=1e-8)
    balances = [energy_terms(insertion) for insertion in inserted]
    assert abs(balances[1].residual) <= 1e-9 * balances[1].total_absolute_work
    assert balances[1].strain == pytest.approx(balances[0].strain, rel=1e-8)


@pytest.mark.parametrize("element", ["P1", "P2"])
@pytest.mark.parametrize("direct", [False, True])
def test_plan_beside_rollers_turns_with_the_scene(
    gel: Scene, monkeypatch: pytest.MonkeyPatch, element: str, *, direct: bool
) -> None:
    """The error estimate, and compliance by single loads, know the frames too."""
    if direct:
        monkeypatch.setattr(tissue_response, "MOST_SHARED_UNKNOWNS", 0)
    scene, image, mesh = beside_rollers(gel, element, "elastic")
    plans, estimates = [], []
    for one, model in ((scene, None), (image, build_model(image, mesh))):
        simulation = Simulation(one, model)
        request = PlanRequest(target=np.array(one.target))
        plans.append(attempt_plan(simulation, request).plan)
        estimates.append(estimate(simulation, plans[-1]).error)
    first, second = (p.best for p in plans)
    assert first is not None
    assert second is not None
    assert second.release_point == pytest.approx(TURN @ first.release_point, abs=1e-10)
    assert estimates[1] == pytest.approx(estimates[0], rel=0.02)


def test_compliance_is_that_of_the_whole_factor_along_the_axes(gel: Scene) -> None:
    """A condensed corridor and single loads return the displacement of `TissueModel.solve`."""
    _, image, mesh = beside_rollers(gel, "P2", "elastic")
    model = build_model(image, mesh)
    assert model.frames is not None
    nodes = np.flatnonzero(model.nodes @ (TURN @ [1.0, 0.0]) < 0.004)
    corridor = Corridor(np.zeros(2), TURN @ [0.0, 0.06], 0.009)
    force = np.random.default_rng(3).normal(size=(len(nodes), 2))
    field = np.zeros((model.nnodes, 2))
    field[nodes] = force
    whole = model.nodal(model.solve(model.dof_vector(field)))[nodes]
    columns = CachedCompliance(model, columns=CondensedCorridor(model, corridor))
    for responses in (columns, CachedCompliance(model), DirectCompliance(model)):
        rows = responses.rows(nodes)
        loads = model.frames.local_loads(nodes, force.reshape(1, -1))
        found = responses.respond(rows, loads).at(rows)
        moved = model.frames.along_axes(nodes, found.reshape(-1, 2))
        assert moved == pytest.approx(whole, abs=1e-10 * np.abs(whole).max())


def test_directions_are_checked(gel: Scene) -> None:
    with pytest.raises(CaseError, match="supports.NAME.direction: .* has no length"):
        Support(faces=("z_max",), direction=(0.0, 0.0))
    with pytest.raises(CaseError, match="supports.NAME.fixed: given together with a direction"):
        Support(faces=("z_max",), direction=(0.0, 1.0), fixed=("y",))
    three = Support(faces=("z_max",), direction=(0.0, 1.0, 0.0))
    with pytest.raises(CaseError, match="supports.walls.direction: 3 numbers; give 2"):
        vary(gel, {"supports.walls": three})
    rollers = Support(faces=("z_max", "y_min"), direction=(1.0, 1.0))
    with pytest.raises(CaseError, match="leave 1 rigid motions"):
        build_model(vary(gel, {"supports": {"walls": rollers}}))
