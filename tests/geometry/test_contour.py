import numpy as np
import pytest

from needlefem.errors import CaseError
from needlefem.geometry import Contour

SQUARE = Contour(np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.0, 0.0]]))


def test_repeated_last_point_is_dropped() -> None:
    assert len(SQUARE.points) == 4


def test_inside_of_a_concave_outline() -> None:
    arrow = Contour(np.array([[0.0, 0.0], [2.0, 1.0], [0.0, 2.0], [0.5, 1.0]]))
    points = np.array([[0.2, 1.0], [0.6, 1.0], [1.9, 1.0], [2.1, 1.0], [0.3, 0.3]])
    assert arrow.contains(points).tolist() == [False, True, True, False, True]


def test_nearest_point_and_distance() -> None:
    points = np.array([[0.5, 0.2], [2.0, 2.0], [0.5, -1.0]])
    assert SQUARE.project(points) == pytest.approx(np.array([[0.5, 0.0], [1.0, 1.0], [0.5, 0.0]]))
    assert SQUARE.distance(points) == pytest.approx([0.2, np.sqrt(2.0), 1.0])


def test_crossings_of_segments() -> None:
    begin = np.array([[0.5, 0.5], [0.5, 0.5], [2.0, 2.0]])
    end = np.array([[1.5, 0.5], [0.6, 0.6], [3.0, 3.0]])
    assert SQUARE.crossings(begin, end) == pytest.approx([0.5, np.nan, np.nan], nan_ok=True)


def test_self_crossing_is_refused() -> None:
    bow = Contour(np.array([[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]]))
    assert bow.self_crossing() == (0, 2)
    with pytest.raises(CaseError, match="crosses itself"):
        bow.check("regions.organ.contour")
    assert SQUARE.self_crossing() is None


def test_two_points_are_no_contour() -> None:
    with pytest.raises(CaseError, match="at least 3"):
        Contour(np.zeros((2, 2))).check("key")


def _plain(contour: Contour, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return inside and distance by every pair of point and edge."""
    start, end = contour.points, np.roll(contour.points, -1, axis=0)
    x, y = points[:, 0, None], points[:, 1, None]
    straddles = (start[:, 1] > y) != (end[:, 1] > y)
    run = np.where(end[:, 1] == start[:, 1], 1.0, end[:, 1] - start[:, 1])
    at = start[:, 0] + (y - start[:, 1]) * (end[:, 0] - start[:, 0]) / run
    inside = np.count_nonzero(straddles & (x < at), axis=1) % 2 == 1
    along = end - start
    share = np.einsum("nij,ij->ni", points[:, None] - start, along) / np.sum(along**2, axis=1)
    feet = start + np.clip(share, 0.0, 1.0)[:, :, None] * along
    return inside, np.linalg.norm(feet - points[:, None], axis=2).min(axis=1)


@pytest.mark.parametrize("corners", [3, 4, 7, 64, 501])
@pytest.mark.parametrize("kind", ["disc", "star", "comb", "voxels", "random"])
def test_the_tree_gives_what_all_pairs_give(kind: str, corners: int) -> None:
    """Also at corners, on edges, and on lines through corners."""
    random = np.random.default_rng(corners)
    turn = 2.0 * np.pi * np.arange(corners) / corners
    radius = np.where(np.arange(corners) % 2, 1.0, 0.2) if kind == "star" else 1.0
    points = np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=1)
    if kind == "comb":
        k = np.arange(corners)
        points = np.vstack([np.stack([k / corners, k % 2], axis=1), [[1, -1], [0, -1]]])
    if kind == "voxels":
        points = np.round(points * 8) / 8
    if kind == "random":
        points = random.random((corners, 2))
    contour = Contour(points)
    asked = random.uniform(-1.3, 1.3, (300, 2))
    asked[:100] = np.round(asked[:100] * 8) / 8
    asked = np.vstack([asked, contour.points[:50], 0.5 * (contour.points[:-1] + points[1:2])[:50]])
    inside, away = _plain(contour, asked)
    assert np.array_equal(contour.contains(asked), inside)
    assert contour.distance(asked) == pytest.approx(away, abs=1e-14)


def test_crossings_are_the_nearest_to_the_middle() -> None:
    turn = 2.0 * np.pi * np.arange(200) / 200
    disc = Contour(np.stack([np.cos(turn), np.sin(turn)], axis=1))
    begin, end = (
        np.array([[-2.0, 0.3], [-0.5, 0.0], [-1.5, 0.0]]),
        np.array([[1.5, 0.3], [0.5, 0.0], [3.0, 0.0]]),
    )
    share = disc.crossings(begin, end)
    left = np.sqrt(1.0 - 0.09)
    assert share[0] == pytest.approx((2.0 - left) / 3.5, abs=1e-3)
    assert np.isnan(share[1])
    assert share[2] == pytest.approx(2.5 / 4.5, abs=1e-12)


SIDE = [[0.0, 0.0], [0.04, 0.0], [0.04, 0.04], [0.0, 0.04]]


@pytest.mark.parametrize(
    ("points", "says"),
    [
        ([[0, 0], [1, 1], [2, 2], [3, 3]], "lie on one line, or enclose no area"),
        ([[0, 0], [0.1, 0.1], [0.1, 0], [0, 0.1]], r"at \(5, 5\) cm, after corners 1 and 3"),
        ([*SIDE[:3], [0.02, 0.02], [0.01, 0.0], [0, 0.04]], r"touches itself at \(1, 0\) cm"),
        ([*SIDE[:2], [0.06, 0.0], *SIDE[1:]], "touches itself"),
        ([*SIDE[:2], [np.nan, 0.0], *SIDE[2:]], r"corner 3 is at \(nan, 0\)"),
        ([[0, 0], [0, 0], [1, 1], [1, 1]], "2 different points; a contour needs at least 3"),
    ],
    ids=["line", "bow", "touching", "spike", "nan", "two"],
)
def test_what_encloses_nothing_is_refused(points: list[list[float]], says: str) -> None:
    with pytest.raises(CaseError, match=says):
        Contour(np.array(points)).check("regions.organ.contour")


def test_repeated_and_collinear_corners_either_way_round_are_right() -> None:
    points = np.array([SIDE[0], SIDE[0], [0.02, 0.0], SIDE[1], SIDE[2], SIDE[2], SIDE[3], SIDE[0]])
    for contour in (Contour(points), Contour(points[::-1])):
        contour.check("key")
        assert len(contour.points) == 5
        assert contour.area == pytest.approx(1.6e-3)
        assert contour.length == pytest.approx(0.16)
        assert contour.contains(np.array([[0.01, 0.01], [0.05, 0.01]])).tolist() == [True, False]


def test_where_contours_meet() -> None:
    one = Contour(np.array(SIDE))
    assert one.meeting(one.moved(np.array([0.1, 0.0]))) is None
    assert one.meeting(Contour(0.01 + 0.5 * np.array(SIDE))) is None
    place = one.meeting(one.moved(np.array([0.02, 0.02])))
    assert one.distance(place[None])[0] < 1e-15


def test_corners_far_away_are_refused() -> None:
    contour = Contour(np.array([[0.0, 0.0], [0.01, 0.0], [0.0, 1e308]]))
    with pytest.raises(CaseError, match=r"organ: corner 3 is at \(0, 1e\+308\) m, farther than"):
        contour.check("organ")
