"""Closed contours in the plane, and a fast search among line segments.

A binary tree of bounding boxes makes the cost of a search proportional to n log n. Consecutive
segments should be neighbours in the plane, as in a polygon; `along_a_curve` sorts others in this
way.
"""

import dataclasses
from collections.abc import Callable, Iterator
from functools import cached_property

import numpy as np

from needlefem._arrays import Bools, Floats, Ints, Points
from needlefem.errors import CaseError

AT_ONCE = 400_000
"""Largest number of pairs of query and box in a batch, which limits the memory."""
MARGIN = 1e-12
"""Relative enlargement of boxes, so that round-off excludes no pair."""

Keep = Callable[[int, Ints, Ints], Bools]
"""Takes a level and pairs of query and box; returns which boxes are searched further."""


class SegmentTree:
    """Bounding boxes of segments, of pairs of segments, of groups of four, etc.

    Parameters
    ----------
    begin, end : array, shape (n, 2), m
    """

    def __init__(self, begin: Points, end: Points) -> None:
        self.begin, self.end = begin, end
        low, high = np.minimum(begin, end), np.maximum(begin, end)
        size = float(np.max(high.max(axis=0) - low.min(axis=0), initial=0.0))
        self.margin = MARGIN * size
        self.levels = [(low - self.margin, high + self.margin)]
        while len(low) > 1:
            starts = np.arange(0, len(low), 2)
            low, high = np.minimum.reduceat(low, starts), np.maximum.reduceat(high, starts)
            self.levels.append((low - self.margin, high + self.margin))

    def descend(self, queries: int, keep: Keep) -> Iterator[tuple[Ints, Ints]]:
        """Yield pairs of query and segment inside of the boxes that `keep` selects, in batches.

        In each batch and in the arguments of `keep`, queries rise, and so do its boxes.

        Parameters
        ----------
        queries : int
            Number of queries.
        keep : callable
            Called at each level, including the boxes of single segments (level 0).
        """
        top = len(self.levels) - 1
        stack = [(top, np.arange(queries), np.zeros(queries, dtype=np.intp))]
        while stack:
            level, query, box = stack.pop()
            if len(query) > AT_ONCE:
                half = len(query) // 2
                stack += [(level, query[:half], box[:half]), (level, query[half:], box[half:])]
                continue
            if not len(query):
                continue
            kept = keep(level, query, box)
            query, box = query[kept], box[kept]
            if not level:
                yield query, box
            elif len(query):
                query, box = np.repeat(query, 2), np.repeat(2 * box, 2)
                box[1::2] += 1
                there = box < len(self.levels[level - 1][0])
                stack.append((level - 1, query[there], box[there]))

    def meeting(self, low: Points, high: Points) -> Iterator[tuple[Ints, Ints]]:
        """Yield pairs (query, segment) with intersecting bounding boxes, in batches.

        Parameters
        ----------
        low, high : array, shape (m, 2), m
            Bounding boxes of the queries.
        """

        def keep(level: int, query: Ints, box: Ints) -> Bools:
            lows, highs = self.levels[level]
            apart = (lows[box] > high[query]) | (highs[box] < low[query])
            found: Bools = ~(apart[:, 0] | apart[:, 1])
            return found

        yield from self.descend(len(low), keep)

    def along(self, begin: Points, end: Points) -> Iterator[tuple[Ints, Ints]]:
        """Yield pairs (query, segment) for which the query segment intersects the bounding box.

        Parameters
        ----------
        begin, end : array, shape (m, 2), m
        """
        low, high = np.minimum(begin, end), np.maximum(begin, end)
        normal = np.stack([begin[:, 1] - end[:, 1], end[:, 0] - begin[:, 0]], axis=1)

        def keep(level: int, query: Ints, box: Ints) -> Bools:
            lows, highs = self.levels[level][0][box], self.levels[level][1][box]
            apart = (lows > high[query]) | (highs < low[query])
            across = normal[query]
            centre = np.sum((0.5 * (lows + highs) - begin[query]) * across, axis=1)
            reach = np.sum(0.5 * (highs - lows) * np.abs(across), axis=1)
            found: Bools = ~(apart[:, 0] | apart[:, 1]) & (np.abs(centre) <= reach)
            return found

        yield from self.descend(len(begin), keep)

    def project(self, points: Points) -> Points:
        """Return the nearest point of all segments for every point, shape (m, 2), m."""
        count = len(points)
        bound = np.full(count, np.inf)

        def keep(level: int, query: Ints, box: Ints) -> Bools:
            lows, highs = self.levels[level]
            some = self.begin[box << level] - points[query]
            first = np.flatnonzero(np.diff(query, prepend=-1))  # queries are in rising order
            least = np.minimum.reduceat(some[:, 0] ** 2 + some[:, 1] ** 2, first)
            bound[query[first]] = np.minimum(bound[query[first]], least)
            apart = np.maximum(lows[box] - points[query], points[query] - highs[box])
            apart = np.maximum(apart, 0.0)
            least = apart[:, 0] ** 2 + apart[:, 1] ** 2
            found: Bools = least <= bound[query] * (1.0 + 1e-9)
            return found

        nearest2 = np.full(count, np.inf)
        which = np.full(count, len(self.begin))
        feet = np.zeros((count, 2))
        for query, segment in self.descend(count, keep):
            foot = _feet(points[query], self.begin[segment], self.end[segment])
            away2 = np.sum((foot - points[query]) ** 2, axis=1)
            order = np.lexsort((segment, away2, query))
            first = order[np.flatnonzero(np.diff(query[order], prepend=-1))]
            one, other = query[first], segment[first]
            nearer = (away2[first] < nearest2[one]) | (
                (away2[first] == nearest2[one]) & (other < which[one])
            )
            one, first = one[nearer], first[nearer]
            nearest2[one], which[one], feet[one] = away2[first], segment[first], foot[first]
        return feet


def _feet(points: Points, begin: Points, end: Points) -> Points:
    along = end - begin
    length2 = np.maximum(along[:, 0] ** 2 + along[:, 1] ** 2, 1e-300)
    apart = points - begin
    share = (apart[:, 0] * along[:, 0] + apart[:, 1] * along[:, 1]) / length2
    found: Points = begin + np.clip(share, 0.0, 1.0)[:, None] * along
    return found


def along_a_curve(points: Points) -> Ints:
    """Return an order in which neighbours are near each other (G. M. Morton 1966), shape (n,)."""
    low = points.min(axis=0)
    size = max(float(np.max(points.max(axis=0) - low)), 1e-300)
    cell = ((points - low) / size * (2**16 - 1)).astype(np.uint64)
    for shift, mask in ((8, 0x00FF00FF), (4, 0x0F0F0F0F), (2, 0x33333333), (1, 0x55555555)):
        cell = (cell | (cell << np.uint64(shift))) & np.uint64(mask)
    order: Ints = np.argsort(cell[:, 0] | (cell[:, 1] << np.uint64(1)), kind="stable")
    return order


def turn(a: Points, b: Points, c: Points) -> Floats:
    """Return twice the signed area of triangles, shape (n,): positive counter-clockwise."""
    found: Floats = (b - a)[..., 0] * (c - a)[..., 1] - (b - a)[..., 1] * (c - a)[..., 0]
    return found


def meet(a: Points, b: Points, c: Points, d: Points) -> Bools:
    """Return whether segments a-b and c-d intersect or touch, shape (n,)."""
    one = np.sign(turn(a, b, c)) * np.sign(turn(a, b, d))
    two = np.sign(turn(c, d, a)) * np.sign(turn(c, d, b))
    lo, hi = np.minimum(a, b), np.maximum(a, b)
    apart = np.any((np.minimum(c, d) > hi) | (np.maximum(c, d) < lo), axis=-1)
    found: Bools = (one <= 0) & (two <= 0) & ~apart
    return found


def cross(a: Points, b: Points, c: Points, d: Points) -> Bools:
    """Return whether segments a-b and c-d intersect at an interior point of both, shape (n,)."""
    one = np.sign(turn(a, b, c)) * np.sign(turn(a, b, d))
    two = np.sign(turn(c, d, a)) * np.sign(turn(c, d, b))
    found: Bools = (one < 0) & (two < 0)
    return found


# Closed polygons in the plane: outlines of regions.


THIN = 1e-12
"""Smallest area of a contour relative to its squared size."""
FARTHEST = 1e4
"""Largest coordinate of a vertex, m; larger ones have a wrong unit or exponent."""


@dataclasses.dataclass(frozen=True, eq=False)
class Contour:
    """A closed polygon; the last point is joined to the first.

    Parameters
    ----------
    points : array, shape (n, 2), m
        Vertices in order, in either direction. A vertex that is equal to the one before it, or a
        last one that is equal to the first, is omitted.
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
        """Enclosed area, m^2."""
        x, y = self.points.T
        return 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))

    @property
    def length(self) -> float:
        """Length of the closed line, m."""
        start, end = self._edges
        return float(np.sum(np.linalg.norm(end - start, axis=1)))

    @cached_property
    def _tree(self) -> SegmentTree:
        return SegmentTree(*self._edges)

    @cached_property
    def _edges(self) -> tuple[Points, Points]:
        return self.points, np.roll(self.points, -1, axis=0)

    def contains(self, points: Points) -> Bools:
        """Return whether points, shape (n, 2), are inside (even-odd rule).

        A ray to the right intersects edges. It intersects an even number of consecutive edges that
        are all at the right if both ends of their chain are above the point or both below. For most
        boxes of the tree the edges need not be evaluated.
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
        """Return where segments intersect the polygon, as a share of each segment (NaN: nowhere).

        Of several intersections, the one nearest to the middle of the segment is returned.
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
        """Return the numbers of two edges that intersect or touch, or None.

        Consecutive edges touch at their common vertex; they count if one folds back on the other.
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
        """Return a point where two contours intersect or touch, shape (2,), or None."""
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
    """Return the intersections of segments a-b and c-d; for collinear ones an end."""
    along, other = b - a, d - c
    det = along[0] * other[1] - along[1] * other[0]
    if abs(det) > THIN * np.linalg.norm(along) * np.linalg.norm(other):
        share = ((c - a)[0] * other[1] - (c - a)[1] * other[0]) / det
        found: Floats = a + np.clip(share, 0.0, 1.0) * along
        return found
    inside = (c - a) @ along / (along @ along)
    return c if 0.0 <= inside <= 1.0 else b
