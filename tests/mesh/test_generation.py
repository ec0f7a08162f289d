import numpy as np
import pytest

from needlefem.errors import CaseError
from needlefem.geometry import Contour
from needlefem.materials import Isotropic
from needlefem.mesh import cell_measures, fit_to_contour, fit_to_contours, generation
from needlefem.scene import (
    BoxMesh,
    Motion,
    Needle,
    Refinement,
    Region,
    Scene,
    Support,
    build_mesh,
    vary,
)


def disc(radius: float = 0.3) -> Contour:
    turn = 2.0 * np.pi * np.arange(64) / 64
    return Contour(0.5 + radius * np.stack([np.cos(turn), np.sin(turn)], axis=1))


@pytest.mark.parametrize(("pattern", "cells"), [("diagonal", 24), ("crossed", 48)])
def test_box_covers_itself(pattern: str, cells: int) -> None:
    mesh = generation.box((1.0, 2.0), (3.0, 4.0), (3, 4), pattern)
    assert mesh.nelements == cells
    assert np.abs(generation.signed_measures(mesh)).sum() == pytest.approx(12.0)
    assert mesh.p.min(axis=1) == pytest.approx([1.0, 2.0])
    assert mesh.p.max(axis=1) == pytest.approx([4.0, 6.0])


def test_cell_size_is_the_leg() -> None:
    assert generation.cell_sizes(generation.box((0, 0), (1, 1), (4, 4))) == pytest.approx(0.25)


def test_refinement_reaches_the_size_where_wanted() -> None:
    begin, end = np.array([0.3, 0.0]), np.array([0.3, 0.6])
    field = generation.near_segment(begin, end, 0.05, 0.03)
    mesh = generation.refine(generation.box((0, 0), (1, 1), (8, 8)), field)
    centroids = mesh.p[:, mesh.t].mean(axis=1).T
    sizes = generation.cell_sizes(mesh)
    assert np.all(sizes[np.isfinite(field(centroids))] <= 0.0301)
    assert sizes.max() > 0.1
    assert np.abs(generation.signed_measures(mesh)).sum() == pytest.approx(1.0)


def test_refinement_that_never_ends_is_refused() -> None:
    with pytest.raises(CaseError, match="still too coarse after 2 refinements"):
        generation.refine(
            generation.box((0, 0), (1, 1), (2, 2)), lambda x: np.full(len(x), 1e-3), limit=2
        )


def test_faces_and_regions_are_named() -> None:
    mesh = generation.name_faces(
        generation.name_regions(generation.box((0, 0), (1, 1), (20, 20)), {"organ": disc()}),
        ("y", "z"),
    )
    assert set(mesh.boundaries) == {"y_min", "y_max", "z_min", "z_max"}
    assert all(len(facets) == 20 for facets in mesh.boundaries.values())
    area = np.abs(generation.signed_measures(mesh))[mesh.subdomains["organ"]].sum()
    assert area == pytest.approx(np.pi * 0.09, rel=0.03)
    assert len(mesh.subdomains["organ"]) + len(mesh.subdomains[generation.BACKGROUND]) == 800


def test_empty_region_is_refused() -> None:
    with pytest.raises(CaseError, match="regions.organ: no mesh cell is in the contour"):
        generation.name_regions(generation.box((0, 0), (1, 1), (2, 2)), {"organ": disc(0.01)})


@pytest.mark.parametrize("pattern", ["diagonal", "crossed"])
def test_fitted_mesh_has_the_contour_as_edges(pattern: str) -> None:
    contour = disc()
    mesh = fit_to_contour(generation.box((0, 0), (1, 1), (20, 20), pattern), contour)
    assert np.abs(generation.signed_measures(mesh)).sum() == pytest.approx(1.0)
    named = generation.name_regions(mesh, {"organ": contour})
    owner = np.zeros(mesh.nelements, dtype=bool)
    owner[named.subdomains["organ"]] = True
    left, right = mesh.f2t
    interface = np.flatnonzero((right >= 0) & (owner[left] != owner[right]))
    ends = mesh.p[:, np.unique(mesh.facets[:, interface])].T
    assert contour.distance(ends).max() < 1e-12
    area = np.abs(generation.signed_measures(mesh))[owner].sum()
    polygon = 0.5 * 64 * 0.09 * np.sin(2.0 * np.pi / 64)
    assert area == pytest.approx(polygon, rel=1e-2)  # chords of the cells


def test_fitting_keeps_the_outer_boundary() -> None:
    mesh = fit_to_contour(generation.box((0, 0), (1, 1), (10, 10)), disc())
    edge = mesh.p[:, mesh.boundary_nodes()]
    assert np.all(np.isclose(edge, 0.0) | np.isclose(edge, 1.0), axis=0).sum() == 4
    assert np.all(np.any(np.isclose(edge, 0.0) | np.isclose(edge, 1.0), axis=0))


def interface(mesh: object, cells: np.ndarray) -> np.ndarray:
    """Return the vertices between some cells and the others, shape (n, 2)."""
    owner = np.zeros(mesh.nelements, dtype=bool)
    owner[cells] = True
    left, right = mesh.f2t
    between = np.flatnonzero((right >= 0) & (owner[left] != owner[right]))
    return mesh.p[:, np.unique(mesh.facets[:, between])].T


def test_a_second_fit_leaves_the_first_contour() -> None:
    """The contours are two elements apart; smoothing must not move what is fitted already."""
    contours = {"large": disc(0.3), "small": disc(0.2)}
    mesh = fit_to_contours(generation.box((0, 0), (1, 1), (20, 20)), contours)
    named = generation.name_regions(mesh, contours)
    outer = interface(mesh, np.concatenate([named.subdomains[name] for name in contours]))
    assert contours["large"].distance(outer).max() < 1e-12
    inner = interface(mesh, named.subdomains["small"])
    assert contours["small"].distance(inner).max() < 1e-12


def test_contours_that_meet_are_not_fitted() -> None:
    other = disc().moved(np.array([0.2, 0.0]))
    with pytest.raises(CaseError, match="contours of 'a' and 'b' meet at .* cm; draw them apart"):
        fit_to_contours(generation.box((0, 0), (1, 1), (20, 20)), {"a": disc(), "b": other})


def bar(width: float) -> Scene:
    """Return a scene with a thin region across half of a box of 60 mm, in cells of 5 mm."""
    unit = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    thin = Contour(np.array([12.1e-3, 20.3e-3]) + unit * np.array([30e-3, width]))
    return Scene(
        title="thin bar",
        axes=("y", "z"),
        mesh=BoxMesh(size=(0.06, 0.06), divisions=(12, 12), interfaces="fitted"),
        materials={"fat": Isotropic(youngs_modulus=1e4, poissons_ratio=0.4)},
        default_material="fat",
        regions={"thin": Region(material="fat", contour=thin)},
        supports={"walls": Support(faces=("z_max",))},
        needle=Needle(tip_radius=3e-3, cutting_force=50.0, shaft_friction=8e3),
        motion=Motion(direction=(0.0, 1.0), max_depth=0.04),
    )


def test_a_size_that_fits_is_named_and_does() -> None:
    """The remedy's value is typed in, and the mesh is built."""
    scene = bar(1.2e-3)
    says = "the contour of 'thin' .*; set mesh.refine.contour_size to '[0-9.]+ mm', or"
    with pytest.raises(CaseError, match=says) as refused:
        build_mesh(scene)
    size = float(refused.value.remedy.split("'")[1].removesuffix(" mm")) * 1e-3
    mesh = build_mesh(vary(scene, {"mesh.refine": Refinement(contour_size=size)}))
    area = np.abs(generation.signed_measures(mesh))[mesh.subdomains["thin"]].sum()
    assert area == pytest.approx(36e-6, rel=0.1)


def test_outlines_of_many_parts() -> None:
    """The part that encloses the most counts, not the one with the most corners."""
    mesh = generation.box((0, 0), (1, 1), (20, 20))
    x, y = mesh.p[:, mesh.t].mean(axis=1)
    cells = np.flatnonzero((x > 0.5) & (y > 0.5) | (x < 0.1) & (y < 0.4) & (x * 20 % 2 < 1))
    assert generation.outline(mesh, cells).area == pytest.approx(0.25)


@pytest.mark.parametrize("low", [15e-3, 22.5e-3])
@pytest.mark.parametrize("turned", [False, True])
def test_contours_along_grid_lines_are_fitted_as_they_are(low: float, turned: bool) -> None:
    """A cell that fills a right angle of the contour has three corners on it and is not flat."""
    high = low + 20e-3
    corners = np.array([(low, low), (high, low), (high, high), (low, high)])
    contour = Contour(corners[::-1] if turned else corners)
    mesh = generation.box((0.0, 0.0), (0.05, 0.05), (20, 20), "diagonal")
    fitted = fit_to_contour(mesh, contour)
    inside = contour.contains(fitted.p[:, fitted.t].mean(axis=1).T)
    assert np.sum(cell_measures(fitted)[inside]) == pytest.approx(contour.area, rel=1e-12)
