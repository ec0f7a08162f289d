"""The distance of a needle to an obstacle, by hand and by brute force."""

import numpy as np
import pytest

from needlefem.geometry import Contour
from needlefem.needle import InsertionAxis, blocked, distance, gaps, merged

DOWN = InsertionAxis(np.array([0.0, 0.0]), np.array([0.0, 1.0]))
BOX = Contour(np.array([[0.01, 0.02], [0.03, 0.02], [0.03, 0.04], [0.01, 0.04]]))
"""From 1 to 3 cm beside the needle, from 2 to 4 cm deep."""


def test_beside_a_box_the_shaft_is_nearest() -> None:
    assert distance(DOWN, 0.05, BOX) == pytest.approx(0.01, abs=1e-15)


def test_short_of_a_box_the_tip_is_nearest() -> None:
    assert distance(DOWN, 0.0, BOX) == pytest.approx(np.hypot(0.01, 0.02), abs=1e-15)


@pytest.mark.parametrize("depth", [0.03, 0.05])
def test_in_and_through_a_box_there_is_no_distance(depth: float) -> None:
    middle = InsertionAxis(np.array([0.02, 0.0]), np.array([0.0, 1.0]))
    assert distance(middle, depth, BOX) == 0.0


def test_what_lies_behind_the_skin_counts_too() -> None:
    behind = BOX.moved(np.array([0.0, -0.06]))
    assert distance(DOWN, 0.0, behind) == pytest.approx(0.01, abs=1e-15)


def test_past_a_box_its_width_and_the_clearance_are_blocked() -> None:
    ((low, high),) = blocked(DOWN, 0.05, BOX, 0.003)
    assert (low, high) == pytest.approx((0.007, 0.033), abs=1e-15)


def test_short_of_a_box_a_circle_about_the_tip_decides() -> None:
    ((low, high),) = blocked(DOWN, 0.018, BOX, 0.003)
    reach = np.sqrt(0.003**2 - 0.002**2)
    assert (low, high) == pytest.approx((0.01 - reach, 0.03 + reach), abs=1e-15)
    assert blocked(DOWN, 0.0169, BOX, 0.003) == []


@pytest.mark.parametrize("seed", range(12))
def test_blocked_is_where_the_distance_is_too_small(seed: int) -> None:
    rng = np.random.default_rng(seed)
    turn = np.sort(rng.uniform(0.0, 2.0 * np.pi, 9))
    radius = rng.uniform(0.3, 1.0, 9)[:, None]
    star = Contour(radius * np.stack([np.cos(turn), np.sin(turn)], axis=1))
    angle = rng.uniform(0.0, 2.0 * np.pi)
    axis = InsertionAxis(rng.normal(size=2), np.array([np.cos(angle), np.sin(angle)]))
    clearance, depth = rng.uniform(0.0, 0.4), rng.uniform(-2.0, 2.0)
    taken = blocked(axis, depth, star, clearance)
    for lateral in np.linspace(-4.0, 4.0, 401):
        moved = InsertionAxis(axis.entry + lateral * axis.lateral_directions[0], axis.direction)
        too_near = distance(moved, depth, star) < clearance
        assert too_near == any(low < lateral < high for low, high in taken)
    edges = [edge for interval in taken for edge in interval]
    for edge in edges:
        moved = InsertionAxis(axis.entry + edge * axis.lateral_directions[0], axis.direction)
        assert distance(moved, depth, star) == pytest.approx(clearance, abs=1e-12)


def test_distance_is_the_least_of_many_points() -> None:
    star = Contour(np.array([[0.5, 0.0], [1.5, 0.4], [0.9, 1.2], [0.7, 0.5]]))
    ends = np.roll(star.points, -1, axis=0)
    shares = np.linspace(0.0, 1.0, 4001)[:, None, None]
    outline = (star.points + shares * (ends - star.points)).reshape(-1, 2)
    for depth in (-0.6, 0.2, 0.8, 2.0):
        ahead = np.maximum(outline[:, 1] - depth, 0.0)
        least = np.hypot(outline[:, 0], ahead).min()
        assert distance(DOWN, depth, star) == pytest.approx(least, abs=1e-6)


def test_intervals_merge_and_leave_gaps() -> None:
    taken = merged([(2.0, 3.0), (0.0, 1.0), (0.5, 1.5)])
    assert taken == [(0.0, 1.5), (2.0, 3.0)]
    assert gaps(-1.0, 2.5, taken) == [(-1.0, 0.0), (1.5, 2.0)]
    assert gaps(0.1, 1.4, taken) == []
    assert gaps(4.0, 5.0, taken) == [(4.0, 5.0)]
