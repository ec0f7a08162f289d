import numpy as np
import pytest

from needlefem.needle import InsertionAxis, PointKernel, TipKernel, cross_section

INWARD = np.array([0.0, 1.0])
SKIN = np.array([0.2, 0.0])


def moments(points: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    mean = weights @ points
    spread = (points - mean).T @ ((points - mean) * weights[:, None])
    return mean, spread


def test_whole_disc_has_the_moments_of_a_disc() -> None:
    centre = np.array([0.2, 5.0])
    points, weights = TipKernel(1.0, 64, SKIN, INWARD).quadrature(centre)
    mean, spread = moments(points, weights)
    assert weights.sum() == pytest.approx(1.0)
    assert mean == pytest.approx(centre, abs=1e-12)
    assert spread == pytest.approx(0.25 * np.eye(2), abs=2e-3)
    assert np.linalg.norm(points - centre, axis=1).max() <= 1.0


def test_disc_at_the_skin_is_its_inner_half() -> None:
    points, weights = TipKernel(1.0, 64, SKIN, INWARD).quadrature(SKIN)
    mean, _ = moments(points, weights)
    assert points[:, 1].min() >= 0.0
    assert mean == pytest.approx([0.2, 4.0 / (3.0 * np.pi)], rel=2e-3)


def test_ball_has_the_moments_of_a_ball() -> None:
    inward = np.array([0.0, 0.0, 1.0])
    kernel = TipKernel(1.0, 500, np.zeros(3), inward)
    centre = np.array([0.1, 0.2, 3.0])
    mean, spread = moments(*kernel.quadrature(centre))
    assert mean == pytest.approx(centre, abs=1e-12)
    assert spread == pytest.approx(0.2 * np.eye(3), abs=5e-3)


def test_points_move_smoothly_with_the_centre_through_the_skin() -> None:
    kernel = TipKernel(1.0, 48, SKIN, INWARD)

    def smooth(depth: float) -> float:
        points, weights = kernel.quadrature(SKIN + depth * INWARD)
        return float(weights @ np.cos(3.0 * points[:, 1]))

    depths = np.linspace(0.0, 2.0, 401)
    values = np.array([smooth(d) for d in depths])
    assert np.abs(np.diff(values, 2)).max() < 1e-3


def test_rule_turns_with_the_needle() -> None:
    turn = np.array([[0.8, -0.6], [0.6, 0.8]])
    centre = np.array([0.2, 0.5])
    points, weights = TipKernel(1.0, 48, SKIN, INWARD).quadrature(centre)
    turned, same = TipKernel(1.0, 48, turn @ SKIN, turn @ INWARD).quadrature(turn @ centre)
    order = np.lexsort((points @ turn.T).T.round(9))
    assert (points @ turn.T)[order] == pytest.approx(turned[np.lexsort(turned.T.round(9))])
    assert np.sort(weights) == pytest.approx(np.sort(same))


def test_point_kernel_is_a_point() -> None:
    points, weights = PointKernel(len(SKIN)).quadrature(SKIN)
    assert np.array_equal(points, SKIN[None])
    assert weights.tolist() == [1.0]


def test_cross_sections_are_centred_and_uniform() -> None:
    across, weights = cross_section(2.0, 48, 2)
    assert weights.sum() == pytest.approx(1.0)
    assert weights @ across[:, 0] == pytest.approx(0.0, abs=1e-12)
    assert weights @ across[:, 0] ** 2 == pytest.approx(4.0 / 3.0)


def test_frames_are_orthonormal() -> None:
    for direction in ([0.0, 1.0], [0.6, -0.8], [0.0, 0.6, 0.8], [1.0, 0.0, 0.0]):
        unit = np.array(direction)
        frame = InsertionAxis(np.zeros(len(unit)), unit).frame
        assert frame @ frame.T == pytest.approx(np.eye(len(unit)), abs=1e-14)
        assert np.array_equal(frame[0], unit)


def test_axis_coordinates() -> None:
    axis = InsertionAxis(np.array([1.0, 2.0]), np.array([0.0, 1.0]))
    assert axis.axial_coordinate(np.array([5.0, 7.0])) == pytest.approx(5.0)
    assert axis.lateral_offset(np.array([5.0, 7.0])) == pytest.approx([4.0])
    assert axis.tip_position(3.0) == pytest.approx([1.0, 5.0])
