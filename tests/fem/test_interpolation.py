import numpy as np
import pytest
from skfem import Basis, MeshQuad

from needlefem.checks import square_mesh
from needlefem.elements import CATALOGUE, ElementType, ShapeTable
from needlefem.fem import Interpolation, OutsideError
from needlefem.mesh import BilinearMap, Locator, box, into_quadrilaterals, near_segment, refine


@pytest.fixture(params=CATALOGUE.values(), ids=CATALOGUE)
def element(request: pytest.FixtureRequest) -> ElementType:
    row: ElementType = request.param
    return row


def graded(cell: str = "triangle") -> object:
    begin, end = np.array([0.3, 0.0]), np.array([0.3, 0.6])
    mesh = refine(box((0, 0), (1, 1), (6, 6)), near_segment(begin, end, 0.05, 0.02))
    return into_quadrilaterals(mesh) if cell == "quadrilateral" else mesh


def plain(element: ElementType) -> object:
    return square_mesh(element, 4)


def test_shape_table_is_scikit_fems(element: ElementType) -> None:
    points = np.random.default_rng(1).dirichlet(np.ones(3), 20)[:, 1:]
    lagrange = element.skfem_element()
    theirs = [lagrange.lbasis(points.T, i)[0] for i in range(len(lagrange.doflocs))]
    assert ShapeTable(element.skfem_element())(points) == pytest.approx(
        np.array(theirs).T, abs=1e-14
    )


def test_values_agree_with_scikit_fems_probes(element: ElementType) -> None:
    mesh = graded(element.cell)
    basis = Basis(mesh, element.skfem_element())
    field = np.random.default_rng(2).normal(size=basis.N)
    points = np.random.default_rng(3).uniform(0.05, 0.95, (200, 2))
    ours = Interpolation(mesh, element, basis.element_dofs.T).at(points).of(field)
    # scikit-fem's own inverse of a bilinear map stops at some 1e-12
    near = 1e-12 if element.cell == "triangle" else 1e-10
    assert ours == pytest.approx(basis.probes(points.T) @ field, abs=near)


@pytest.mark.parametrize("cell", ["triangle", "quadrilateral"])
def test_every_point_of_a_graded_mesh_is_found(cell: str) -> None:
    mesh = graded(cell)
    points = np.random.default_rng(4).uniform(0.0, 1.0, (2000, 2))
    cells, reference = Locator(mesh).find(points)
    assert cells.min() >= 0
    shape = ShapeTable(mesh.elem())(reference)
    mapped = np.einsum("dcn,nc->nd", mesh.p[:, mesh.t[:, cells]], shape)
    assert mapped == pytest.approx(points, abs=1e-12)


@pytest.mark.parametrize("turned", [1, -1])
def test_bilinear_maps_of_any_convex_cell_are_inverted(turned: int) -> None:
    """Also of cells so far from parallelograms that the map folds over not far beside them."""
    random = np.random.default_rng(5)
    corners = np.sort(random.uniform(0.0, 2.0 * np.pi, (20000, 4)), axis=1)[:, ::turned]
    size = random.uniform(0.2, 3.0, (len(corners), 1))
    points = np.stack([size * np.cos(corners), np.sin(corners)], axis=2)
    along, across = np.roll(points, -1, 1) - points, np.roll(points, 1, 1) - points
    turn = turned * (along[..., 0] * across[..., 1] - along[..., 1] * across[..., 0])
    points = points[turn.min(axis=1) > 1e-2]  # on an ellipse: convex, and no corner is flat
    assert len(points) > 5000
    mesh = MeshQuad(points.reshape(-1, 2).T, np.arange(4 * len(points)).reshape(-1, 4).T)
    local = random.uniform(0.0, 1.0, (len(points), 2))
    (x, y), bilinear = local.T, BilinearMap(mesh)
    shares = np.stack([(1.0 - x) * (1.0 - y), x * (1.0 - y), x * y, (1.0 - x) * y], axis=1)
    placed = np.einsum("nc,ncd->nd", shares, points)
    found = bilinear.invert(np.arange(len(points)), placed)
    assert np.abs(found - local).max() < 1e-9
    assert bilinear.depth(found).min() > -1e-9


def test_shared_points_belong_to_the_lowest_cell() -> None:
    mesh = box((0, 0), (1, 1), (4, 4))
    found, _ = Locator(mesh).find(mesh.p.T)
    lowest = [np.flatnonzero(np.any(mesh.t == v, axis=0)).min() for v in range(mesh.nvertices)]
    assert found.tolist() == lowest


def test_points_outside_are_decided(element: ElementType) -> None:
    mesh = plain(element)
    cells, _ = Locator(mesh).find(
        np.array([[-0.1, 0.5], [1.1, 0.5], [0.5, 1.0], [np.nextafter(1, 2), 1.0]])
    )
    assert (cells >= 0).tolist() == [False, False, True, True]
    basis = Basis(mesh, element.skfem_element())
    interpolation = Interpolation(mesh, element, basis.element_dofs.T)
    points, rows = np.array([[0.5, 0.5], [1.5, 0.5]]), np.array([0, 0])
    means = interpolation.means(points, np.ones(2), rows, 1)
    assert means.rows.sum() == pytest.approx(1.0)
    assert means.of(basis.doflocs[0]) == pytest.approx(0.5)
    with pytest.raises(OutsideError):
        interpolation.means(points + 2.0, np.ones(2), rows, 1)


def test_means_are_weighted(element: ElementType) -> None:
    mesh = plain(element)
    basis = Basis(mesh, element.skfem_element())
    points = np.array([[0.1, 0.2], [0.7, 0.9], [0.4, 0.4]])
    means = Interpolation(mesh, element, basis.element_dofs.T).means(
        points, np.array([1.0, 3.0, 2.0]), np.array([0, 0, 1]), 2
    )
    assert means.of(basis.doflocs.T) == pytest.approx(np.array([[0.55, 0.725], [0.4, 0.4]]))
    assert len(np.unique(means.nodes)) == len(means.nodes)
