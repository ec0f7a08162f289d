import numpy as np
import pytest

from needlefem import build_model
from needlefem.fem import TissueModel, TwoLevelSolver
from needlefem.fem import two_level_solver as nested
from needlefem.mesh import uniformly_refined
from needlefem.scene import Scene, resolve, vary


@pytest.fixture(params=["P1 to P2", "P2 halved", "Q1-Bbar halved"])
def pair(request: pytest.FixtureRequest, organ: Scene) -> tuple[TissueModel, TissueModel]:
    """Return a finer tissue and the coarser one."""
    name = request.param.split()[0]
    pattern = "quadrilateral" if name.startswith("Q") else "diagonal"
    scene = vary(organ, {"discretization.element": name, "mesh.pattern": pattern})
    scene = resolve(scene).scene
    coarser = build_model(scene)
    if request.param == "P1 to P2":
        return build_model(vary(scene, {"discretization.element": "P2"}), coarser.mesh), coarser
    return build_model(scene, uniformly_refined(coarser.mesh)), coarser


def loaded(model: TissueModel) -> np.ndarray:
    """Return a force spread along a line into the tissue."""
    depths = np.linspace(1e-3, 0.03, 60)
    points = np.column_stack([np.full_like(depths, 0.029), depths])
    weights = model.interpolation.at(points)
    load = np.zeros(model.ndofs)
    load[model.node_dofs[weights.nodes]] = weights.rows.sum(axis=0)[:, None] * [0.3, 1.0]
    return load


def test_a_finer_tissue_moves_as_its_own_factor_says(
    pair: tuple[TissueModel, TissueModel], monkeypatch: pytest.MonkeyPatch
) -> None:
    finer, coarser = pair
    load = loaded(finer)
    exact = finer.solve(load)
    apart = np.abs(TwoLevelSolver(finer, coarser).solve(load) - exact).max()
    monkeypatch.setattr(nested, "LEFT", 1e-9)
    closely = np.abs(TwoLevelSolver(finer, coarser).solve(load) - exact).max()
    assert apart < 1e-2 * np.abs(exact).max()
    assert closely < 1e-8 * np.abs(exact).max()


def test_iterations_that_do_not_converge_give_way_to_the_factor(
    pair: tuple[TissueModel, TissueModel], monkeypatch: pytest.MonkeyPatch
) -> None:
    finer, coarser = pair
    load = loaded(finer)
    monkeypatch.setattr(nested, "MOST_ITERATIONS", 1)
    monkeypatch.setattr(nested, "LEFT", 1e-12)
    assert np.array_equal(TwoLevelSolver(finer, coarser).solve(load), finer.solve(load))


def test_iterations_do_not_grow_with_the_mesh(
    organ: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    counted = []
    smoothed = TwoLevelSolver._smoothed
    monkeypatch.setattr(
        TwoLevelSolver, "_smoothed", lambda own, rest: (counted.append(0), smoothed(own, rest))[1]
    )
    spent = []
    for divisions in (10, 20, 40):
        scene = vary(
            organ, {"discretization.element": "P2", "mesh.divisions": (divisions, divisions)}
        )
        coarser = build_model(resolve(scene).scene)
        finer = build_model(resolve(scene).scene, uniformly_refined(coarser.mesh))
        TwoLevelSolver(finer, coarser).solve(loaded(finer))
        spent.append(len(counted) - sum(spent))
    assert spent[2] <= spent[0] + 5
    assert spent[2] < 40
