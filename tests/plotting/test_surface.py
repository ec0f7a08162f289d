"""What is drawn of a mesh lies where its element says, whatever its cells are."""

import dataclasses
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
import skfem

from needlefem.checks import rectangle
from needlefem.elements import CATALOGUE, ElementType, gauss, simplex
from needlefem.fem import FunctionSpace
from needlefem.io import write_vtu
from needlefem.materials import Isotropic
from needlefem.plotting import SurfaceMesh
from needlefem.plotting.canvas import MOST
from tests.insertion.test_three_dimensions import TETRAHEDRON

GEL = Isotropic(youngs_modulus=1.0, poissons_ratio=0.3)
CURVED = {"P2", "Q2", "P2-P1", "Q2-Q1"}
QUADRATIC = dataclasses.replace(
    TETRAHEDRON, name="T2", skfem_element=skfem.ElementTetP2, degree=2, stiffness_rule=simplex(2, 3)
)
HEXAHEDRON = ElementType(
    name="H1", cell="hexahedron", skfem_element=skfem.ElementHex1, degree=1,
    stiffness_rule=gauss(2, 3), mass_rule=gauss(2, 3), lumpings=("row-sum",),
    poissons_ratio_limit=0.45,
)  # fmt: skip
SOLIDS = {
    "T1": (skfem.MeshTet, TETRAHEDRON),
    "T2": (skfem.MeshTet, QUADRATIC),
    "H1": (skfem.MeshHex, HEXAHEDRON),
}


def bent(points: np.ndarray, degree: int) -> np.ndarray:
    """Return a displacement of some degree."""
    x, y = points[:, 0], points[:, 1]
    field = 0.1 * points + 0.05
    if degree > 1:
        field = field + 0.2 * np.stack([x * y, x**2 - y**2, x * x][: points.shape[1]], axis=1)
    return field


def size(points: np.ndarray, polygons: np.ndarray) -> float:
    """Return the area of polygons anywhere in space."""
    flat = np.zeros((len(points), 3))
    flat[:, : points.shape[1]] = points
    corners = flat[polygons]
    fan = [np.cross(corners[:, i] - corners[:, 0], corners[:, j] - corners[:, 0])
           for i, j in pairwise(range(1, polygons.shape[1]))]  # fmt: skip
    return float(0.5 * np.linalg.norm(fan, axis=2).sum())


@pytest.mark.parametrize("name", CATALOGUE)
def test_plane_cells_are_as_curved_as_their_element(name: str) -> None:
    model = rectangle(CATALOGUE[name], GEL, 3)
    surface, degree = SurfaceMesh(model), 2 if name in CURVED else 1
    assert surface.parts == (MOST if name in CURVED else 1)
    u = model.dof_vector(bent(model.nodes, degree))
    np.testing.assert_allclose(surface.displaced(u), bent(surface.rest, degree), atol=1e-12)
    assert len(surface.edges) == model.mesh.nfacets
    assert len(surface.outline) == len(model.mesh.boundary_facets())
    assert set(surface.cells) == set(range(model.mesh.nelements))
    assert size(surface.rest, surface.polygons) == pytest.approx(np.prod(np.ptp(model.nodes, 0)))
    for along in surface.rest[surface.edges]:
        assert np.linalg.matrix_rank(along - along[0], tol=1e-9) == 1


@pytest.mark.parametrize("kind", SOLIDS)
def test_faces_of_solids_are_drawn(kind: str) -> None:
    mesh, row = SOLIDS[kind]
    space = FunctionSpace(mesh.init_tensor(*3 * [np.linspace(0.0, 1.0, 4)]), row)
    surface = SurfaceMesh(space)
    assert size(surface.rest, surface.polygons) == pytest.approx(6.0)
    u = space.dof_vector(bent(space.nodes, row.degree))
    np.testing.assert_allclose(surface.displaced(u), bent(surface.rest, row.degree), atol=1e-12)
    half = SurfaceMesh(space, space.mesh.p[2, space.mesh.t].mean(axis=0) < 1.0 / 3.0)
    assert size(half.rest, half.polygons) == pytest.approx(2.0 + 4.0 / 3.0)


@pytest.mark.parametrize("kind", SOLIDS)
def test_solids_open_in_pyvista(kind: str, tmp_path: Path) -> None:
    mesh, row = SOLIDS[kind]
    space = FunctionSpace(mesh.init_tensor(*3 * [np.linspace(0.0, 1.0, 3)]), row)
    of_cells = {"number": np.arange(space.mesh.nelements)}
    write_vtu(tmp_path / "a.vtu", space, {"displacement": bent(space.nodes, 1)}, of_cells)
    grid = pv.read(tmp_path / "a.vtu")
    assert grid.compute_cell_sizes().cell_data["Volume"].sum() == pytest.approx(1.0)
    np.testing.assert_allclose(grid.point_data["displacement"], bent(grid.points, 1), atol=1e-12)
    assert list(grid.cell_data["number"]) == list(range(space.mesh.nelements))
