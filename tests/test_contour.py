import numpy as np
import pytest

from needlefem.contour import Contour
from needlefem.errors import CaseError

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
