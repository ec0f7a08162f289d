import numpy as np
import pytest

from needlefem.insertion import TrajectoryInterval


def curve(n: int = 12) -> TrajectoryInterval:
    length = np.linspace(0.0, 1.1, n)
    points = np.column_stack([0.1 * length**3 - 0.05 * length, length])
    return TrajectoryInterval(length, 1.3 * length + 0.2 * length**2, points)


def test_cubics_are_exact() -> None:
    piece = curve()
    for at in (0.013, 0.5, 1.09):
        reach = piece.at(at)
        assert reach.depth == pytest.approx(1.3 * at + 0.2 * at**2, abs=1e-13)
        assert reach.point == pytest.approx([0.1 * at**3 - 0.05 * at, at], abs=1e-13)


def test_nodes_are_interpolated_exactly() -> None:
    piece = curve()
    assert piece.at(float(piece.length[5])).depth == pytest.approx(piece.depth[5], abs=1e-15)


def test_inversion() -> None:
    piece = curve()
    length = piece.solve(piece.depth, 0.77)
    assert length is not None
    assert piece.at(length).depth == pytest.approx(0.77, abs=1e-13)
    assert piece.solve(piece.depth, 9.0) is None


def test_two_states_are_joined_by_a_line() -> None:
    piece = TrajectoryInterval(
        np.array([0.0, 1.0]), np.array([2.0, 4.0]), np.array([[0.0, 0.0], [0.0, 1.0]])
    )
    assert piece.at(0.25).depth == pytest.approx(2.5)


def test_inversion_exactly_at_a_state() -> None:
    piece = curve()
    for number in range(len(piece.length)):
        length = piece.solve(piece.depth, float(piece.depth[number]))
        if number:
            assert length == pytest.approx(piece.length[number], abs=1e-13)
