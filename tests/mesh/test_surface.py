import numpy as np
import pytest
from skfem import MeshTet, MeshTri

from needlefem.elements import element_row
from needlefem.fem import FunctionSpace, Interpolation
from needlefem.mesh import Surface, TipWatch, box


def surface_of(mesh: MeshTri) -> Surface:
    space = FunctionSpace(mesh, element_row("P1"))
    return Interpolation(mesh, space.element, space.cell_nodes).surface


@pytest.fixture
def bored() -> Surface:
    """Return the surface of the unit square with a square hole in its middle."""
    mesh = box((0, 0), (1, 1), (10, 10))
    middles = mesh.p[:, mesh.t].mean(axis=1)
    hole = np.all(np.abs(middles - 0.5) < 0.1, axis=0)
    return surface_of(mesh.remove_elements(np.flatnonzero(hole)))


def exit_of(surface: Surface, start: list[float], end: list[float]) -> float | None:
    return surface.first_exit(np.array(start), np.array(end))


def test_a_path_leaves_through_a_side(bored: Surface) -> None:
    assert exit_of(bored, [0.1, 0.1], [0.1, 0.35]) is None
    assert exit_of(bored, [0.15, 0.2], [-0.05, 0.4]) == pytest.approx(0.75)
    assert exit_of(bored, [0.15, 0.9], [0.15, 1.3]) == pytest.approx(0.25)
    assert exit_of(bored, [0.3, 0.0], [0.3, -0.2]) == pytest.approx(0.0)


def test_a_path_across_a_hole_leaves_although_both_ends_are_inside(bored: Surface) -> None:
    assert exit_of(bored, [0.3, 0.47], [0.8, 0.47]) == pytest.approx(0.2)


def test_running_along_the_surface_or_touching_it_is_not_leaving(bored: Surface) -> None:
    assert exit_of(bored, [0.0, 0.1], [0.0, 0.7]) is None
    assert exit_of(bored, [0.3, 0.5], [0.5, 0.3]) is None  # by way of a corner of the hole
    assert exit_of(bored, [0.3, 0.0], [0.3, 0.2]) is None  # from the surface inwards


def test_nothing_is_closer_than_the_clearance(bored: Surface) -> None:
    for point in np.random.default_rng(3).uniform(0.05, 0.35, (20, 2)):
        turn = np.linspace(0.0, 2.0 * np.pi, 50)
        clear = bored.clearance(point)
        around = point + 0.999 * clear * np.stack([np.cos(turn), np.sin(turn)], axis=1)
        assert clear > 0.0
        assert all(bored.first_exit(point, place) is None for place in around)


def test_the_surface_in_three_dimensions() -> None:
    mesh = MeshTet().refined(2)
    surface = Surface(mesh, lambda points: np.all((points >= 0.0) & (points <= 1.0), axis=1))
    assert exit_of(surface, [0.3, 0.4, 0.5], [0.3, 0.4, 0.9]) is None  # type: ignore[list-item]
    assert exit_of(surface, [0.3, 0.4, 0.5], [0.3, 0.4, 1.5]) == pytest.approx(0.5)
    assert 0.2 < surface.clearance(np.array([0.5, 0.5, 0.5])) <= 0.5


def test_a_watch_sees_what_its_surface_sees(bored: Surface) -> None:
    random = np.random.default_rng(7)
    for _ in range(20):
        watch, place = TipWatch(bored, np.array([0.2, 0.0])), np.array([0.2, 0.0])
        slope = random.uniform(-0.5, 0.5)
        for _ in range(60):
            ahead = place + 0.03 * np.array([slope, 1.0])
            found, expected = watch.first_exit(place, ahead), bored.first_exit(place, ahead)
            assert found == expected
            if expected is not None:
                break
            place = ahead
        else:
            pytest.fail("the path never left")
