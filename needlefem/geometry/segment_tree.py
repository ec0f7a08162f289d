"""Line segments in the plane, found by where they are at a cost of n log n.

A binary tree of bounding boxes over the segments in their order: neighbours in the order should
be neighbours in the plane, as along a polygon; `along_a_curve` orders others so.
"""

from collections.abc import Callable, Iterator

import numpy as np

from needlefem._arrays import Bools, Floats, Ints, Points

AT_ONCE = 400_000
"""Pairs of a query and a box that are looked at at once: bounds the memory."""
MARGIN = 1e-12
"""Share of the size by which boxes are larger, so that round-off loses no pair."""

Keep = Callable[[int, Ints, Ints], Bools]
"""Takes a level and pairs of query and box; says below which boxes to go on."""


class SegmentTree:
    """Bounding boxes of segments, of pairs of them, of fours, ...

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
        """Yield pairs of query and segment that are below boxes which `keep` kept, in batches.

        In a batch, and in what `keep` is asked, queries and the boxes of each rise.

        Parameters
        ----------
        queries : int
            How many there are.
        keep : callable
            Asked at every level, the segments' own boxes (level 0) included.
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
        """Yield pairs (query, segment) whose bounding boxes meet, in batches.

        Parameters
        ----------
        low, high : array, shape (m, 2), m
            Of the queries' boxes.
        """

        def keep(level: int, query: Ints, box: Ints) -> Bools:
            lows, highs = self.levels[level]
            apart = (lows[box] > high[query]) | (highs[box] < low[query])
            found: Bools = ~(apart[:, 0] | apart[:, 1])
            return found

        yield from self.descend(len(low), keep)

    def along(self, begin: Points, end: Points) -> Iterator[tuple[Ints, Ints]]:
        """Yield pairs (query, segment) of which a query, from begin to end, meets the box.

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
            first = np.flatnonzero(np.diff(query, prepend=-1))  # queries come in their order
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
    """Say which segments a-b and c-d cross or touch, shape (n,)."""
    one = np.sign(turn(a, b, c)) * np.sign(turn(a, b, d))
    two = np.sign(turn(c, d, a)) * np.sign(turn(c, d, b))
    lo, hi = np.minimum(a, b), np.maximum(a, b)
    apart = np.any((np.minimum(c, d) > hi) | (np.maximum(c, d) < lo), axis=-1)
    found: Bools = (one <= 0) & (two <= 0) & ~apart
    return found


def cross(a: Points, b: Points, c: Points, d: Points) -> Bools:
    """Say which segments a-b and c-d cross at a point inside both, shape (n,)."""
    one = np.sign(turn(a, b, c)) * np.sign(turn(a, b, d))
    two = np.sign(turn(c, d, a)) * np.sign(turn(c, d, b))
    found: Bools = (one < 0) & (two < 0)
    return found
