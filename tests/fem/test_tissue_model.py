import numpy as np
import pytest
from scipy.sparse import csc_array

from needlefem import build_model
from needlefem.elements import CATALOGUE, element_row
from needlefem.errors import CaseError, SimulationError
from needlefem.fem import (
    CachedCompliance,
    CondensedCorridor,
    Corridor,
    DirectCompliance,
    GroupedFactor,
    InverseColumnsOnDemand,
    SuperLUFactor,
    cholmod,
    factorise,
)
from needlefem.insertion import Simulation
from needlefem.materials import Isotropic
from needlefem.scene import Scene, Support, vary, with_element


@pytest.mark.parametrize("name", CATALOGUE)
def test_uniaxial_strain_of_two_layers(gel: Scene, name: str) -> None:
    """A pressed stack: displacement is stress times the sum of length over modulus."""
    from needlefem.geometry import Contour
    from needlefem.scene import Region

    half = Contour(np.array([[0.0, 0.0], [0.06, 0.0], [0.06, 0.03], [0.0, 0.03]]))
    soft, stiff = (
        Isotropic(youngs_modulus=1e4, poissons_ratio=0.3),
        Isotropic(youngs_modulus=1e7, poissons_ratio=0.2),
    )
    scene = vary(
        gel,
        {
            "materials": {"gel": soft, "stiff": stiff},
            "regions": {"layer": Region(contour=half, material="stiff")},
            "supports": {
                "sides": Support(faces=("y_min", "y_max"), fixed=("y",)),
                "floor": Support(faces=("z_max",)),
            },
            "supports.floor": Support(faces=("z_max",), fixed=("z",)),
        },
    )
    model = build_model(with_element(scene, name))
    stress = 100.0
    top = model.basis.boundary("z_min")
    from skfem import LinearForm

    load = LinearForm(lambda v, _: stress * v[1]).assemble(top)
    moved = model.displacement_at(model.solve(load), np.array([[0.02, 0.0], [0.03, 0.03]]))
    moduli = [lam + 2.0 * mu for lam, mu in (soft.lame(), stiff.lame())]
    expected = [stress * 0.03 / moduli[0] + stress * 0.03 / moduli[1], stress * 0.03 / moduli[0]]
    assert moved[:, 1] == pytest.approx(expected, rel=1e-9)
    assert moved[:, 0] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("name", CATALOGUE)
def test_mass_has_the_right_total(gel: Scene, name: str) -> None:
    model = build_model(with_element(gel, name))
    total = 2 * 1000.0 * 0.06**2
    assert model.mass.sum() == pytest.approx(total)
    for scheme in element_row(name).lumpings:
        lumped = model.lumped_mass(scheme)
        assert lumped.sum() == pytest.approx(total)
        assert lumped.min() > 0.0


def test_row_sums_of_quadratic_triangles_are_refused(gel: Scene) -> None:
    model = build_model(vary(gel, {"discretization.element": "P2"}))
    with pytest.raises(CaseError, match="'row-sum' is not admissible for P2; use hrz"):
        model.lumped_mass("row-sum")


@pytest.mark.parametrize(
    ("support", "free"),
    [
        (Support(faces=()), 3),
        (Support(faces=("z_max",), fixed=("z",)), 1),
        (Support(faces=("y_min", "y_max"), fixed=("y",)), 1),
    ],
)
def test_free_rigid_motions_are_counted(gel: Scene, support: Support, free: int) -> None:
    with pytest.raises(CaseError, match=f"leave {free} rigid motions of the tissue free"):
        build_model(vary(gel, {"supports": {"walls": support}}))


def test_unknown_faces_and_axes_are_named(gel: Scene) -> None:
    with pytest.raises(CaseError, match="no face 'top'; known here: y_max, y_min, z"):
        build_model(vary(gel, {"supports": {"walls": Support(faces=("top",))}}))
    with pytest.raises(CaseError, match="supports.walls.fixed: no axis 'x'; known here: y, z"):
        vary(gel, {"supports": {"walls": Support(faces=("z_max",), fixed=("x",))}})


def test_contour_outside_the_mesh_is_refused(organ: Scene) -> None:
    moved = organ.regions["organ"].contour.moved(np.array([0.03, 0.0]))
    with pytest.raises(CaseError, match="the contour leaves the mesh"):
        build_model(vary(organ, {"regions.organ.contour": moved}))


def test_region_fields_are_continuous_and_bounded(organ: Scene) -> None:
    model = build_model(vary(organ, {"discretization.element": "P2"}))
    field = model.per_node({"background": 10.0, "organ": 50.0})
    points = np.random.default_rng(1).uniform(0.0, 0.06, (500, 2))
    values = model.interpolation.at(points).of(field)
    assert values.min() >= 10.0 - 1e-9
    assert values.max() <= 50.0 + 1e-9
    step = np.array([1e-9, 0.0])
    assert model.interpolation.at(points[points[:, 0] < 0.059] + step).of(field) == pytest.approx(
        values[points[:, 0] < 0.059], abs=1e-3
    )


def test_shared_and_direct_responses_are_the_same(organ: Scene) -> None:
    simulation = Simulation(organ)
    model = simulation.model
    nodes = np.array([3, 77, 140, 200])
    loads = np.random.default_rng(5).normal(size=(3, 2 * len(nodes)))
    results = []
    for responses in (CachedCompliance(model), DirectCompliance(model)):
        rows = responses.rows(nodes)
        results.append(responses.respond(rows, loads).at(rows))
    assert results[0] == pytest.approx(results[1], rel=1e-10)
    assert results[0].shape == (8, 3)


def test_shared_responses_grow_without_changing(organ: Scene) -> None:
    model = Simulation(organ).model
    grown, at_once = CachedCompliance(model), CachedCompliance(model)
    first, second = np.array([50, 51, 90]), np.array([90, 200, 13])
    grown.rows(first)
    before = grown.compliance.copy()
    grown.rows(second)
    assert np.array_equal(grown.compliance[:6, :6], before)
    at_once.rows(np.array([50, 51, 90, 200, 13]))
    assert grown.compliance == pytest.approx(at_once.compliance, rel=1e-10)
    assert np.array_equal(grown.compliance, grown.compliance.T)


def test_a_condensed_corridor_gives_the_columns_of_the_whole(organ: Scene) -> None:
    simulation = Simulation(organ)
    model = simulation.model
    entry = simulation.entry_of_case().point
    corridor = Corridor(entry, entry + 0.02 * simulation.direction, 0.009)
    columns, whole = (
        CondensedCorridor(model, corridor),
        InverseColumnsOnDemand(model.factor, len(model.free_dofs)),
    )
    inner = np.flatnonzero(columns.inner())
    near = inner[:: max(len(inner) // 7, 1)]
    assert columns.between(near, near) == pytest.approx(whole.between(near, near), rel=1e-10)
    assert 0 < columns.solves < len(inner)  # only what lies around is solved for
    beside = np.flatnonzero(~columns.inner())[[0, -1]]
    both = np.concatenate([near, beside])  # a needle elsewhere: the corridor is widened
    assert columns.between(both, beside) == pytest.approx(whole.between(both, beside), rel=1e-10)
    assert np.all(columns.inner()[both])


def test_held_nodes_do_not_respond(gel: Scene) -> None:
    model = Simulation(gel).model
    held = np.flatnonzero(np.all(np.isin(model.node_dofs, model.held_dofs), axis=1))[:2]
    for responses in (CachedCompliance(model), DirectCompliance(model)):
        rows = responses.rows(held)
        loads = np.ones((1, len(rows)))
        assert np.all(responses.respond(rows, loads).at(rows) == 0.0)


def test_cholmod_solves_as_superlu_does(organ: Scene) -> None:
    if cholmod() is None:
        pytest.skip("the extra 'cholmod' is not installed")
    model = Simulation(organ).model
    matrix = model.stiffness.system(model.free_dofs)[0]
    loads = np.random.default_rng(6).normal(size=(matrix.shape[0], 3))
    ours, theirs = (factorise(matrix, backend=name) for name in ("superlu", "cholmod"))
    assert theirs.solve(loads) == pytest.approx(ours.solve(loads), rel=1e-10)
    assert theirs.solve(loads[:, 0]) == pytest.approx(ours.solve(loads[:, 0]), rel=1e-10)
    with pytest.raises(SimulationError, match="can't be factorised"):
        factorise(csc_array(np.diag([1.0, 0.0, 1.0])), backend="cholmod")


def test_a_solver_that_is_missing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("needlefem.fem.factorization.cholmod", lambda: None)
    with pytest.raises(SimulationError, match="extra 'cholmod'"):
        factorise(csc_array(np.eye(2)), backend="cholmod")


def test_singular_and_broken_matrices_are_refused() -> None:
    with pytest.raises(SimulationError, match="can't be factorised"):
        factorise(csc_array(np.zeros((3, 3)) + np.diag([1.0, 0.0, 1.0])))
    with pytest.raises(SimulationError, match="not finite"):
        factorise(csc_array(np.array([[np.nan, 0.0], [0.0, 1.0]])))


@pytest.mark.parametrize("element", ["P1", "P2", "P2-P1"])
def test_nodes_in_order_solve_as_unknowns_do(
    organ: Scene, element: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = Simulation(vary(organ, {"discretization.element": element})).model
    loads = np.random.default_rng(7).normal(size=(model.ndofs, 3))
    plain = model.solve(loads)
    monkeypatch.setattr("needlefem.fem.factorization.FEWEST_FOR_GROUPS", 0)
    factor = model.stiffness.factor(model.free_dofs)
    moved = factor.solve(loads[model.free_dofs])
    assert "of nodes" in factor.name
    assert moved == pytest.approx(plain[model.free_dofs], abs=1e-11 * np.abs(plain).max())
    one = factor.solve(loads[model.free_dofs, 0])
    assert one == pytest.approx(moved[:, 0], abs=1e-12 * np.abs(moved).max())


def test_nodes_in_order_fill_no_more_than_unknowns_do(organ: Scene) -> None:
    model = Simulation(vary(organ, {"discretization.element": "P2"})).model
    matrix, _ = model.stiffness.system(model.free_dofs)
    nodes = model.node_of[model.free_dofs]
    ordered, plain = GroupedFactor(matrix, nodes), SuperLUFactor(matrix)
    assert ordered.entries < 1.2 * plain.entries  # ties are broken in another way
