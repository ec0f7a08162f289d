"""Closed polygons in the plane: the outline of a region."""

import dataclasses
from functools import cached_property

import numpy as np

from needlefem.arrays import Bools, Floats, Ints, Points
from needlefem.errors import CaseError

PAIRS = 200_000
"""Pairs of edges that are looked at at once."""


@dataclasses.dataclass(frozen=True, eq=False)
class Contour:
    """A closed polygon; the last point is joined to the first.

    Parameters
    ----------
    points : array, shape (n, 2), m
        Corners in order, either way round; a repeated last point is dropped.
    """

    points: Points

    def __post_init__(self) -> None:
        points = np.array(self.points, dtype=float)
        if len(points) > 1 and np.array_equal(points[0], points[-1]):
            points = points[:-1]
        object.__setattr__(self, "points", points)

    def moved(self, offset: Floats) -> "Contour":
        """Return the contour shifted by `offset`, shape (2,), m."""
        return Contour(self.points + np.asarray(offset))

    @property
    def area(self) -> float:
        """Area that it encloses, m^2."""
        x, y = self.points.T
        return 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))

    @cached_property
    def _edges(self) -> tuple[Points, Points]:
        return self.points, np.roll(self.points, -1, axis=0)

    def contains(self, points: Points) -> Bools:
        """Say which points, shape (n, 2), lie inside (even-odd rule)."""
        start, end = self._edges
        near = np.all((points >= start.min(axis=0)) & (points <= start.max(axis=0)), axis=1)
        found = np.zeros(len(points), dtype=bool)
        x, y = points[near, 0, None], points[near, 1, None]
        straddles = (start[:, 1] > y) != (end[:, 1] > y)
        run = np.where(end[:, 1] == start[:, 1], 1.0, end[:, 1] - start[:, 1])
        at = start[:, 0] + (y - start[:, 1]) * (end[:, 0] - start[:, 0]) / run
        found[near] = np.count_nonzero(straddles & (x < at), axis=1) % 2 == 1
        return found

    def project(self, points: Points) -> Points:
        """Return the nearest point of the polygon's line for every point, shape (n, 2)."""
        start, end = self._edges
        along = end - start
        length2 = np.maximum(np.einsum("ij,ij->i", along, along), 1e-300)
        share = np.einsum("nij,ij->ni", points[:, None] - start, along) / length2
        feet = start + np.clip(share, 0.0, 1.0)[:, :, None] * along
        nearest = np.argmin(np.sum((feet - points[:, None]) ** 2, axis=2), axis=1)
        found: Points = feet[np.arange(len(points)), nearest]
        return found

    def distance(self, points: Points) -> Floats:
        """Return the distance of every point to the polygon's line, shape (n,), m."""
        away: Floats = np.linalg.norm(self.project(points) - points, axis=1)
        return away

    def crossings(self, begin: Points, end: Points) -> Floats:
        """Return where segments cross the polygon, as a share of each segment (NaN: nowhere).

        Where a segment crosses several times, the crossing nearest to its middle counts.
        """
        start, stop = self._edges
        d, e = end - begin, stop - start
        det = d[:, None, 0] * -e[:, 1] + d[:, None, 1] * e[:, 0]
        rhs = start - begin[:, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            share = (rhs[..., 0] * -e[:, 1] + rhs[..., 1] * e[:, 0]) / det
            other = (d[:, None, 0] * rhs[..., 1] - d[:, None, 1] * rhs[..., 0]) / det
        hit = (share >= 0) & (share <= 1) & (other >= 0) & (other <= 1)
        off = np.where(hit, np.abs(share - 0.5), np.inf)
        best = np.argmin(off, axis=1)
        rows = np.arange(len(begin))
        found: Floats = np.where(np.isfinite(off[rows, best]), share[rows, best], np.nan)
        return found

    def self_crossing(self) -> tuple[int, int] | None:
        """Return a pair of edges (their numbers) that cross or touch, or None."""
        start, end = self._edges
        n = len(start)
        others = np.arange(n)
        for first in range(0, n, PAIRS // n + 1):  # as many at once as memory is cheap for
            edges = np.arange(first, min(first + PAIRS // n + 1, n))[:, None]
            met = _segments_meet(start[edges], end[edges], start[None], end[None])
            met &= (others > edges + 1) & ~((edges == 0) & (others == n - 1))
            if np.any(met):
                row, other = np.argwhere(met)[0]
                return int(edges[row, 0]), int(other)
        return None

    def check(self, key: str) -> None:
        """Raise a `CaseError` unless this is a simple polygon with an area."""
        if len(self.points) < 3:
            raise CaseError(key, f"{len(self.points)} points", "a contour needs at least 3")
        pair = self.self_crossing()
        if pair is not None:
            remedy = "draw the outline without crossing itself"
            raise CaseError(key, f"the contour crosses itself (edges {pair[0]}, {pair[1]})", remedy)


def _orientation(a: Points, b: Points, c: Points) -> Ints:
    cross = (b - a)[..., 0] * (c - a)[..., 1] - (b - a)[..., 1] * (c - a)[..., 0]
    return np.sign(cross).astype(np.intp)


def _segments_meet(a: Floats, b: Floats, c: Points, d: Points) -> Bools:
    one = _orientation(a, b, c) * _orientation(a, b, d)
    two = _orientation(c, d, a) * _orientation(c, d, b)
    touching: Bools = (one <= 0) & (two <= 0)
    lo, hi = np.minimum(a, b), np.maximum(a, b)
    apart = np.any((np.minimum(c, d) > hi) | (np.maximum(c, d) < lo), axis=-1)
    meeting: Bools = touching & ~apart
    return meeting
