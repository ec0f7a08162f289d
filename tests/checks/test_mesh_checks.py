import dataclasses

import numpy as np
import pytest
from skfem import Basis, ElementVector

from needlefem import build_model
from needlefem.checks import eigenfrequencies
from needlefem.checks import mesh_checks as tissue
from needlefem.elements import CATALOGUE
from needlefem.fem import TissueModel
from needlefem.fem.forms import stiffness
from needlefem.geometry import Contour
from needlefem.scene import Scene, build_mesh, vary, with_element


@pytest.fixture(params=CATALOGUE)
def model(request: pytest.FixtureRequest, organ: Scene) -> TissueModel:
    return build_model(with_element(organ, request.param))


def test_a_good_tissue_passes(model: TissueModel) -> None:
    checks = tissue.preflight(model)
    assert [check.name for check in checks if not check.passed] == []
    assert len({check.name for check in checks}) == len(checks) == 6


def test_a_turned_over_cell_is_caught(model: TissueModel) -> None:
    mesh = model.mesh
    points = mesh.p.copy()
    inner = np.setdiff1d(np.arange(mesh.nvertices), mesh.boundary_nodes())[40]
    points[:, inner] += [4e-3, 4e-3]
    model.mesh = dataclasses.replace(mesh, doflocs=points)
    caught = [tissue.covering(model), tissue.cell_shape(model)]
    assert not all(check.passed for check in caught)


def test_a_flat_cell_is_caught(model: TissueModel) -> None:
    mesh = model.mesh
    points = mesh.p.copy()
    a, b, c = mesh.t[:3, 200]
    points[:, b] = 0.5 * (points[:, a] + points[:, c]) + 1e-9
    model.mesh = dataclasses.replace(mesh, doflocs=points)
    assert not tissue.cell_shape(model).passed


def test_a_stiffness_that_resists_rotation_is_caught(model: TissueModel) -> None:
    matrix = model.stiffness.matrix
    model.stiffness.__dict__["matrix"] = (
        matrix + 1e-6 * matrix.max() * model.mass / model.mass.max()
    )
    assert not tissue.rigid_motion(model).passed


def test_a_stiffness_that_is_not_symmetric_is_caught(model: TissueModel) -> None:
    skew = model.stiffness.matrix.copy().tolil()
    i, j = model.free_dofs[50], model.free_dofs[51]
    skew[i, j] += 0.05 * skew[i, i]
    model.stiffness.__dict__["matrix"] = skew.tocsr()
    assert not (tissue.reciprocity(model).passed and tissue.energy_identity(model).passed)


def test_a_factorisation_of_another_matrix_is_caught(model: TissueModel) -> None:
    factor = model.factor

    class Wrong:
        def solve(self, rhs: np.ndarray) -> np.ndarray:
            return 1.01 * factor.solve(rhs)

    model.__dict__["factor"] = Wrong()
    assert not tissue.energy_identity(model).passed


def test_too_few_quadrature_points_show_in_the_null_space(organ: Scene) -> None:
    """One point is too few for quadratic elements: K gets motions that cost nothing."""
    model = build_model(vary(organ, {"discretization.element": "P2", "mesh.divisions": (8, 8)}))
    assert tissue.zero_modes(model) == 3
    middle = (np.full((2, 1), 1.0 / 3.0), np.array([0.5]))
    basis = Basis(model.mesh, ElementVector(model.element.skfem_element()), quadrature=middle)
    model.stiffness.__dict__["matrix"] = stiffness(basis, model.stiffness.law)
    assert tissue.zero_modes(model) > 3


def test_held_box_has_no_zero_frequency(model: TissueModel) -> None:
    frequencies = eigenfrequencies(model, 3)
    assert frequencies[0] > 1.0
    assert np.all(np.diff(frequencies) >= 0.0)


def test_probes_keep_off_what_is_held(model: TissueModel) -> None:
    count = model.mesh.nelements
    bone = np.unique(model.node_dofs[model.cell_nodes[[count // 3, 2 * count // 3]]])
    model.held_dofs = np.union1d(model.held_dofs, bone)
    model.free_dofs = np.setdiff1d(model.free_dofs, bone)
    assert tissue.reciprocity(model).passed
    assert tissue.energy_identity(model).passed


def square(low: float, high: float) -> Contour:
    return Contour(np.array([[low, low], [high, low], [high, high], [low, high]]))


def test_regions_that_overlap_are_named(gel: Scene) -> None:
    mesh = build_mesh(gel)
    whole, corner = square(0.006, 0.03), square(0.021, 0.045)
    (said,) = tissue.overlaps(mesh, {"one": whole, "other": corner})
    assert said == (
        "regions 'one' and 'other' overlap in 18 cells (81 mm^2), which belong to 'other', "
        "the later one"
    )
    apart, inside = square(0.03, 0.045), square(0.012, 0.024)
    assert not [*tissue.overlaps(mesh, {"one": whole, "apart": apart, "inside": inside})]
