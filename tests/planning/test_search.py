import numpy as np
import pytest

from needlefem.planning import SearchStatus, golden_section, grid, sign_changes, signed_root

RANGE = (-2.0, 2.0)


def root(function, start=0.0, within=RANGE, most=40):  # type: ignore[no-untyped-def]
    def miss(height: np.ndarray) -> np.ndarray | None:
        value = function(float(height[0]))
        return None if value is None else np.array([value])

    return signed_root(miss, np.array([start]), within, 1e-10, most)


def test_smooth_miss_takes_few_evaluations() -> None:
    found = root(lambda h: 1.2 * h - 0.3 + 0.1 * np.sin(h))
    assert found.found is SearchStatus.SOLVED
    assert found.miss <= 1e-10
    assert len(found.tried) <= 6


def test_kinked_and_steep_misses_are_bracketed() -> None:
    for function in (
        lambda h: (h - 0.7) * (5.0 if h > 0.7 else 0.2),
        lambda h: np.tanh(30.0 * (h + 1.1)),
        lambda h: (h - 1.9) ** 3 + 1e-3 * (h - 1.9),
    ):
        assert root(function).found is SearchStatus.SOLVED


def test_root_outside_the_range_is_said() -> None:
    found = root(lambda h: h - 5.0)
    assert found.found is SearchStatus.OUTSIDE_RANGE
    assert found.height[0] == pytest.approx(2.0)
    assert found.miss == pytest.approx(3.0)


def test_unreachable_everywhere_is_said() -> None:
    found = root(lambda _: None)
    assert found.found is SearchStatus.UNREACHABLE
    assert found.miss == np.inf
    assert len(found.tried) == 6


def test_heights_out_of_reach_are_backed_off_from() -> None:
    found = root(lambda h: None if h < 0.5 else h - 1.0)
    assert found.found is SearchStatus.SOLVED
    found = root(lambda h: None if h > 0.9 else 0.5 * (h - 0.6), start=-2.0)
    assert found.found is SearchStatus.SOLVED


def test_too_few_evaluations_is_said() -> None:
    assert root(np.arctan, start=1.9, most=2).found is SearchStatus.NOT_CONVERGED


def test_two_lateral_directions() -> None:
    matrix = np.array([[1.3, 0.2], [-0.1, 0.9]])
    sought = np.array([0.4, -0.7])
    found = signed_root(
        lambda h: matrix @ (h - sought) + 0.05 * (h - sought) ** 2, np.zeros(2), RANGE, 1e-10, 40
    )
    assert found.found is SearchStatus.SOLVED
    assert found.height == pytest.approx(sought, abs=1e-9)
    assert len(found.tried) <= 12


def test_golden_section_narrows_to_the_tolerance() -> None:
    found = golden_section(lambda h: abs(h - 0.3) + 0.01, -0.2, 0.4, 0.01)
    assert found.height[0] == pytest.approx(0.3, abs=0.01)
    assert found.found is SearchStatus.SOLVED
    assert len(found.tried) == 11


def test_grid_finds_the_lower_of_two_valleys() -> None:
    found = grid(lambda h: min(abs(h + 1.0) + 0.1, abs(h - 1.0)), -2.0, 2.0, 0.1)
    assert found.height[0] == pytest.approx(1.0)
    assert len(found.tried) == 41
    assert grid(lambda _: np.inf, 0.0, 1.0, 0.5).found is SearchStatus.UNREACHABLE


def test_coarse_scan_finds_all_sign_changes() -> None:
    def miss(height: np.ndarray) -> np.ndarray | None:
        return None if height[0] > 1.6 else np.sin(3.0 * height)

    intervals = sign_changes(miss, -2.0, 2.0, 40)
    assert len(intervals) == 3
    assert all(
        a < root < b for (a, b), root in zip(intervals, (-np.pi / 3, 0.0, np.pi / 3), strict=True)
    )
