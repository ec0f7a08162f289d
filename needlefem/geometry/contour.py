"""Closed polygons in the plane: the outline of a region."""

import dataclasses
from functools import cached_property

import numpy as np

from needlefem._arrays import Bools, Floats, Ints, Points
from needlefem.errors import CaseError
from needlefem.geometry.segment_tree import SegmentTree, meet, turn

THIN = 1e-12
"""A contour encloses nothing when its area is at most this share of its size squared."""
FARTHEST = 1e4
"""Largest coordinate of a corner, m: what is farther away has lost its unit or its exponent."""


@dataclasses.dataclass(frozen=True, eq=False)
class Contour:
    """A closed polygon; the last point is joined to the first.

    Parameters
    ----------
    points : array, shape (n, 2), m
        Corners in order, either way round; a corner that repeats the one before it, or a last
        one that repeats the first, is dropped.
    """

    points: Points

    def __post_init__(self) -> None:
        points = np.array(self.points, dtype=float)
        if points.ndim == 2 and len(points) > 1:
            points = points[np.any(points != np.roll(points, 1, axis=0), axis=1)]
        object.__setattr__(self, "points", points)

    def moved(self, offset: Floats) -> "Contour":
        """Return the contour shifted by `offset`, shape (2,), m."""
        return Contour(self.points + np.asarray(offset))

    @property
    def area(self) -> float:
        """Area that it encloses, m^2."""
        x, y = self.points.T
        return 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))

    @property
    def length(self) -> float:
        """Length of its line, m."""
        start, end = self._edges
        return float(np.sum(np.linalg.norm(end - start, axis=1)))

    @cached_property
    def _tree(self) -> SegmentTree:
        return SegmentTree(*self._edges)

    @cached_property
    def _edges(self) -> tuple[Points, Points]:
        return self.points, np.roll(self.points, -1, axis=0)

    def contains(self, points: Points) -> Bools:
        """Say which points, shape (n, 2), lie inside (even-odd rule).

        A ray to the right meets edges. Of consecutive edges that all lie to the right it meets an
        even number if both ends of their chain are above the point or both below: most boxes of
        the tree need no look at their edges.
        """
        start, end = self._edges
        tree, count = self._tree, len(start)
        x, y = points.T
        met = np.zeros(len(points), dtype=np.intp)

        def keep(level: int, query: Ints, box: Ints) -> Bools:
            low, high = (corner[box] for corner in tree.levels[level])
            beside = (y[query] >= low[:, 1]) & (y[query] <= high[:, 1])
            right = beside & (x[query] < low[:, 0])
            first = box[right] << level
            last = np.minimum(first + (1 << level), count) % count
            at = y[query[right]]
            odd = (start[first, 1] > at) != (start[last, 1] > at)
            np.add.at(met, query[right][odd], 1)
            found: Bools = beside & ~right & (x[query] <= high[:, 0])
            return found

        for query, edge in tree.descend(len(points), keep):
            a, b = start[edge], end[edge]
            straddles = (a[:, 1] > y[query]) != (b[:, 1] > y[query])
            run = np.where(b[:, 1] == a[:, 1], 1.0, b[:, 1] - a[:, 1])
            at = a[:, 0] + (y[query] - a[:, 1]) * (b[:, 0] - a[:, 0]) / run
            np.add.at(met, query[straddles & (x[query] < at)], 1)
        inside: Bools = met % 2 == 1
        return inside

    def project(self, points: Points) -> Points:
        """Return the nearest point of the polygon's line for every point, shape (n, 2)."""
        return self._tree.project(points)

    def distance(self, points: Points) -> Floats:
        """Return the distance of every point to the polygon's line, shape (n,), m."""
        away: Floats = np.linalg.norm(self.project(points) - points, axis=1)
        return away

    def crossings(self, begin: Points, end: Points) -> Floats:
        """Return where segments cross the polygon, as a share of each segment (NaN: nowhere).

        Where a segment crosses several times, the crossing nearest to its middle counts.
        """
        start, stop = self._edges
        found = np.full(len(begin), np.nan)
        nearest = np.full(len(begin), np.inf)
        for query, edge in self._tree.along(begin, end):
            d, e = end[query] - begin[query], stop[edge] - start[edge]
            rhs = start[edge] - begin[query]
            det = d[:, 0] * -e[:, 1] + d[:, 1] * e[:, 0]
            with np.errstate(divide="ignore", invalid="ignore"):
                share = (rhs[:, 0] * -e[:, 1] + rhs[:, 1] * e[:, 0]) / det
                other = (d[:, 0] * rhs[:, 1] - d[:, 1] * rhs[:, 0]) / det
            hit = (share >= 0) & (share <= 1) & (other >= 0) & (other <= 1)
            off = np.where(hit, np.abs(share - 0.5), np.inf)
            order = np.lexsort((edge, off, query))
            first = order[np.flatnonzero(np.diff(query[order], prepend=-1))]
            first = first[off[first] < nearest[query[first]]]
            found[query[first]], nearest[query[first]] = share[first], off[first]
        return found

    def self_crossing(self) -> tuple[int, int] | None:
        """Return a pair of edges (their numbers) that cross or touch, or None.

        Neighbours touch at their common corner; they count when one goes back over the other.
        """
        start, end = self._edges
        n = len(start)
        along = end - start
        after = np.roll(along, -1, axis=0)
        back = (along[:, 0] * after[:, 1] == along[:, 1] * after[:, 0]) & (
            np.sum(along * after, axis=1) < 0.0
        )
        if np.any(back):
            edge = int(np.argmax(back))
            return edge, (edge + 1) % n
        pairs = self._tree.along(start, end)
        for one, other in pairs:
            apart = (other > one + 1) & ~((one == 0) & (other == n - 1))
            first, second = one[apart], other[apart]
            met = np.flatnonzero(meet(start[first], end[first], start[second], end[second]))
            if met.size:
                return int(first[met[0]]), int(second[met[0]])
        return None

    def meeting(self, other: "Contour") -> Points | None:
        """Return a point where the lines of two contours cross or touch, shape (2,), or None."""
        start, end = self._edges
        begin, stop = other._edges
        for one, two in self._tree.along(begin, stop):
            met = np.flatnonzero(meet(begin[one], stop[one], start[two], end[two]))
            if met.size:
                first = met[0]
                edges = start[two[first]], end[two[first]], begin[one[first]], stop[one[first]]
                return _crossing_point(*edges)
        return None

    def check(self, key: str) -> None:
        """Raise a `CaseError` unless this is a simple polygon with an area."""
        if self.points.ndim != 2 or self.points.shape[1] != 2:
            problem = f"an array of shape {self.points.shape}"
            raise CaseError(key, problem, "a contour has two coordinates for every corner")
        wrong = np.flatnonzero(~np.all(np.isfinite(self.points), axis=1))
        if wrong.size:
            place = ", ".join(f"{x:g}" for x in self.points[wrong[0]])
            problem = f"corner {wrong[0] + 1} is at ({place})"
            raise CaseError(key, problem, "give every corner finite coordinates")
        far = np.flatnonzero(np.any(np.abs(self.points) > FARTHEST, axis=1))
        if far.size:
            place = ", ".join(f"{x:g}" for x in self.points[far[0]])
            problem = f"corner {far[0] + 1} is at ({place}) m, farther than {FARTHEST:g} m away"
            raise CaseError(key, problem, "check its numbers and the unit in the header")
        if len(self.points) < 3:
            problem = f"{len(self.points)} different points"
            raise CaseError(key, problem, "a contour needs at least 3")
        pair = self.self_crossing()
        start, end = self._edges
        size2 = float(np.max(np.ptp(self.points, axis=0))) ** 2
        thin = self.area <= THIN * size2
        if thin and (pair is None or np.all(np.abs(turn(start, end, start[0])) <= THIN * size2)):
            problem = "the corners lie on one line, or enclose no area"
            raise CaseError(key, problem, "draw the outline of the region")
        if pair is not None:
            one, other = pair
            y, z = 100.0 * _crossing_point(start[one], end[one], start[other], end[other])
            problem = (
                f"the contour crosses itself or touches itself at ({y:.4g}, {z:.4g}) cm, "
                f"after corners {one + 1} and {other + 1}"
            )
            raise CaseError(key, problem, "draw the outline without crossing itself")


def _crossing_point(a: Floats, b: Floats, c: Floats, d: Floats) -> Floats:
    """Return where segments a-b and c-d that meet do so; of collinear ones an end."""
    along, other = b - a, d - c
    det = along[0] * other[1] - along[1] * other[0]
    if abs(det) > THIN * np.linalg.norm(along) * np.linalg.norm(other):
        share = ((c - a)[0] * other[1] - (c - a)[1] * other[0]) / det
        found: Floats = a + np.clip(share, 0.0, 1.0) * along
        return found
    inside = (c - a) @ along / (along @ along)
    return c if 0.0 <= inside <= 1.0 else b
