"""Search methods over the lateral offset of the insertion."""

import dataclasses
from collections.abc import Callable
from enum import StrEnum
from itertools import pairwise

import numpy as np

from needlefem import _root_finding
from needlefem._arrays import Floats

TIE = 1e-9
"""Relative difference below which errors count as equal; the offset tried first is then kept."""

Miss = Callable[[Floats], "Floats | None"]
"""Signed lateral error at a lateral offset, both of shape (dim - 1,), m; None if out of reach."""
Error = Callable[[float], float]
"""Placement error at a lateral offset, m; infinite if out of reach."""


class SearchStatus(StrEnum):
    """How a search ended."""

    SOLVED = "solved"
    OUTSIDE_RANGE = "outside_range"
    UNREACHABLE = "unreachable"
    NOT_CONVERGED = "not_converged"


@dataclasses.dataclass(frozen=True, eq=False)
class SearchResult:
    """A lateral offset, and how it was found.

    Parameters
    ----------
    found : SearchStatus
    height : array, shape (dim - 1,), m
        Lateral offset relative to the target; the best one tried if there is no solution.
    miss : float, m
        Error at this offset.
    tried : tuple of (height, miss)
        All offsets and errors in the order of the insertions.
    """

    found: SearchStatus
    height: Floats
    miss: float
    tried: tuple[tuple[Floats, "Floats | None"], ...]


def signed_root(
    miss: Miss, start: Floats, within: tuple[float, float], tolerance: float, most: int
) -> SearchResult:
    """Return the lateral offset at which the signed lateral error is zero.

    The error is a smooth function of the offset with a derivative of nearly one, so that Broyden's
    method with the unit matrix as first Jacobian needs few insertions. In 2D (one lateral
    direction) the ends of an interval with a change of sign are stored, and each iterate stays
    inside of it.

    Parameters
    ----------
    miss : callable
        See `Miss`.
    start : array, shape (dim - 1,), m
        First lateral offset relative to the target.
    within : (float, float), m
        Feasible lateral offsets in each lateral direction.
    tolerance : float, m
        Largest lateral error of a solution.
    most : int
        Largest number of insertions.
    """
    search = _Root(miss, within, tolerance, most)
    return search.run(np.clip(start, *within))


class _Root:
    def __init__(
        self, miss: Miss, within: tuple[float, float], tolerance: float, most: int
    ) -> None:
        self._miss, (self._low, self._high) = miss, within
        self._tolerance, self._most = tolerance, most
        self._tried: list[tuple[Floats, Floats | None]] = []

    def run(self, height: Floats) -> SearchResult:
        value = self._evaluate(height)
        if value is None:
            first = self._first_reachable(height)
            if first is None:
                return self._end(SearchStatus.UNREACHABLE)
            height, value = first
        jacobian = np.eye(len(height))
        while len(self._tried) < self._most:
            if np.max(np.abs(value)) <= self._tolerance:
                return self._end(SearchStatus.SOLVED)
            request = self._guarded(height - np.linalg.solve(jacobian, value))
            if np.array_equal(request, height):
                return self._end(SearchStatus.OUTSIDE_RANGE)
            reached = self._evaluate(request)
            if reached is None:
                retreat = self._between(height, request)
                if retreat is None:
                    return self._end(SearchStatus.UNREACHABLE)
                request, reached = retreat
            change = request - height
            jacobian = _root_finding.updated_jacobian(jacobian, change, value, reached)
            if abs(np.linalg.det(jacobian)) < 1e-3:
                jacobian = np.eye(len(height))
            height, value = request, reached
        return self._end(SearchStatus.NOT_CONVERGED)

    def _evaluate(self, height: Floats) -> Floats | None:
        value = self._miss(height)
        self._tried.append((height, value))
        return value

    def _guarded(self, request: Floats) -> Floats:
        """Restrict an iterate to the range and, in 2D, to the inside of the bracket."""
        clipped = np.clip(request, self._low, self._high)
        bracket = self._bracket()
        if bracket is not None and not bracket[0] < clipped[0] < bracket[1]:
            clipped = np.array([0.5 * (bracket[0] + bracket[1])])
        return clipped

    def _bracket(self) -> tuple[float, float] | None:
        known = [(float(h[0]), float(m[0])) for h, m in self._tried if m is not None]
        if len(self._tried[0][0]) != 1:
            return None
        known.sort()
        for (a, f), (b, g) in pairwise(known):
            if (f < 0.0) != (g < 0.0):
                return a, b
        return None

    def _first_reachable(self, height: Floats) -> tuple[Floats, Floats] | None:
        """Return the first lateral offset in reach of a few in the range, and its error."""
        for share in (0.25, 0.75, 0.0, 1.0, 0.5):
            if len(self._tried) >= self._most:
                return None
            tried = np.full_like(height, self._low + share * (self._high - self._low))
            value = self._evaluate(tried)
            if value is not None:
                return tried, value
        return None

    def _between(self, good: Floats, bad: Floats) -> tuple[Floats, Floats] | None:
        """Return a lateral offset between one in reach and one out of reach, and its error."""
        for _ in range(4):
            bad = 0.5 * (good + bad)
            value = self._evaluate(bad)
            if value is not None:
                return bad, value
        return None

    def _end(self, found: SearchStatus) -> SearchResult:
        known = [(h, m) for h, m in self._tried if m is not None]
        if not known:
            return SearchResult(found, self._tried[0][0], np.inf, tuple(self._tried))
        height, miss = min(known, key=lambda pair: float(np.max(np.abs(pair[1]))))
        return SearchResult(found, height, float(np.linalg.norm(miss)), tuple(self._tried))


def golden_section(error: Error, low: float, high: float, tolerance: float) -> SearchResult:
    """Minimize a unimodal error over the lateral offset, as in the paper of 2003 (2D).

    Ends when the interval is narrower than `tolerance` (m).
    """
    return _best(_root_finding.golden_section(error, low, high, tolerance, _less))


def grid(error: Error, low: float, high: float, spacing: float) -> SearchResult:
    """Minimize an error over a grid of lateral offsets (2D)."""
    count = round((high - low) / spacing) + 1
    return _best([(height, error(height)) for height in np.linspace(low, high, count)])


def _best(tried: list[tuple[float, float]]) -> SearchResult:
    height, error = tried[0]
    for other in tried[1:]:
        if _less(other[1], error):
            height, error = other
    found = SearchStatus.SOLVED if np.isfinite(error) else SearchStatus.UNREACHABLE
    history = tuple((np.array([h]), np.array([e])) for h, e in tried)
    return SearchResult(found, np.array([height]), error, history)


def _less(one: float, other: float) -> bool:
    """Say whether an error is smaller than another one by more than round-off."""
    return one < other * (1.0 - TIE)


def sign_changes(miss: Miss, low: float, high: float, count: int) -> list[tuple[float, float]]:
    """Return the intervals of a coarse scan in which the lateral error changes its sign (2D)."""
    heights = np.linspace(low, high, count)
    values = [miss(np.array([height])) for height in heights]
    signs = [None if v is None else v[0] > 0.0 for v in values]
    return [
        (float(heights[i]), float(heights[i + 1]))
        for i in range(count - 1)
        if signs[i] is not None and signs[i + 1] is not None and signs[i] != signs[i + 1]
    ]
