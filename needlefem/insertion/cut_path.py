"""The cut path of a needle, and the trajectory of its tip in the material.

`CutPath` contains the contact segments of a path during a motion, with the slip that each has
accumulated. `TipTrajectory` evaluates an insertion that has ended: the material point at the tip
for any depth, and the depth for a point.
"""

import math
import operator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from needlefem._arrays import Floats, Ints, Points, Vector
from needlefem._root_finding import golden_section
from needlefem.needle.needle_interface import NeedleInterface

if TYPE_CHECKING:
    from needlefem.insertion.result import Insertion


class CutPath:
    """Contact segments of the cut path, and the friction state of each segment.

    Segment 0 is the entry point and has no length. Segment j ends at `vertices[j]`. The last
    segment, number `count`, grows from the last vertex to the crack front.

    Parameters
    ----------
    instrument : NeedleInterface

    Attributes
    ----------
    vertices : list of array, shape (dim,), m
        Ends of the full segments.
    arcs : list of float, m
        Length of the path at each vertex.
    crack_front : array, shape (dim,), m
        End of the path.
    """

    def __init__(self, instrument: NeedleInterface) -> None:
        self.instrument = instrument
        self.vertices: list[Vector] = [instrument.axis.entry]
        self.arcs: list[float] = [0.0]
        self.crack_front: Vector = instrument.axis.entry
        self.kinetic: list[float] = [0.0]
        """Kinetic friction force of each full segment, N (N/m in 2D)."""
        self.friction_force: Floats = np.zeros(2)
        """Friction force on each segment, including the growing one, N (N/m in 2D)."""
        self.slip_since_stick: Floats = np.full(2, np.inf)
        """Slip of each segment since it last stuck, m; infinite for a new segment."""
        self.pace = self.slope = 1.0
        """Estimates for the next retraction step, from the last one.

        `pace` is the change of the tip's path length over the change of depth. `slope` is the
        derivative of the axial gap with respect to the path length of the tip.
        """

    @property
    def count(self) -> int:
        """Number of full segments."""
        return len(self.vertices)

    @property
    def length(self) -> float:
        """Length of the cut path, m."""
        return self.arcs[-1] + float(np.linalg.norm(self.crack_front - self.vertices[-1]))

    def at(self, arc: float) -> tuple[int, Vector]:
        """Return the number of full segments up to a path length, and the material point there."""
        full = min(max(int(np.searchsorted(self.arcs, arc, side="left")), 1), self.count)
        start, begin = self.vertices[full - 1], self.arcs[full - 1]
        end = self.crack_front if full == self.count else self.vertices[full]
        span = (self.length if full == self.count else self.arcs[full]) - begin
        share = (arc - begin) / span if span > 0.0 else 0.0
        return full, start + share * (end - start)

    def extend(self, kinetic: float) -> None:
        """Make the growing segment a full segment, and start a new one at the crack front."""
        self.arcs.append(self.length)
        self.vertices.append(self.crack_front)
        self.kinetic.append(kinetic)
        self.friction_force = np.append(self.friction_force, 0.0)
        self.slip_since_stick = np.append(self.slip_since_stick, np.inf)

    def store(self, friction: Floats, slipped: Floats) -> None:
        """Store friction force and slip since sticking of the segments in which the needle is."""
        count = len(friction)
        self.friction_force = np.zeros(len(self.friction_force))
        self.friction_force[:count] = friction
        # a segment that the needle enters again starts with kinetic friction
        self.slip_since_stick = np.full(len(self.slip_since_stick), np.inf)
        self.slip_since_stick[:count] = slipped


# Trajectory of the tip in the material.
#
# Between states all quantities are interpolated by cubics in the length of the cut path. There is
# no interpolation across a rupture: the material between its ends is not on the path.


CLOSE = 1e-11
"""Width of the interval of path length in which the point closest to a target is found, m."""
STUB = 0.01
"""Length of the last step of a path, relative to the step before, below which it is merged."""


class TipPoint(NamedTuple):
    """A material point that the tip reaches, and the depth at which it is reached.

    Parameters
    ----------
    depth : float, m
    point : array, shape (dim,), m
        Material point at the tip. A seed that is released there comes to rest at it.
    """

    depth: float
    point: Vector


class TrajectoryInterval(NamedTuple):
    """A part of the trajectory between two ruptures.

    Parameters
    ----------
    length : array, shape (n,), m
        Path length from the skin of each state.
    depth : array, shape (n,), m
    point : array, shape (n, dim), m
        Material point at the tip.
    """

    length: Floats
    depth: Floats
    point: Points

    def at(self, length: float) -> TipPoint:
        """Interpolate at a path length."""
        values = _lagrange(self.length, length) @ np.column_stack([self.depth, self.point])
        return TipPoint(float(values[0]), values[1:])

    def solve(self, values: Floats, sought: float) -> float | None:
        """Return the smallest path length at which an interpolated quantity has a value, or None.

        Parameters
        ----------
        values : array, shape (n,)
            Quantity in each state.
        sought : float
        """
        above = values >= sought
        cross = np.flatnonzero(above[1:] != above[:-1])
        if not cross.size:
            return None
        first = int(cross[0])
        return _invert(self.length, values, sought, first)


def _without_stub(interval: TrajectoryInterval) -> TrajectoryInterval:
    """Remove the second last state if it is very close to the last one.

    The slope of a cubic through both would be their round-off divided by their distance.
    """
    steps = np.diff(interval.length)
    if len(steps) < 2 or steps[-1] >= STUB * steps[-2]:
        return interval
    return TrajectoryInterval(*(np.delete(values, -2, axis=0) for values in interval))


def _cutting(insertion: "Insertion") -> Ints:
    """Return the numbers of the states in which the tip is at a new material point."""
    tips, first = insertion.tips, insertion.first_cut
    if first is None:
        return np.arange(min(1, len(tips)))
    deepest = int(np.argmax(insertion.depths))
    ahead = np.linalg.norm(np.diff(tips[first : deepest + 1], axis=0), axis=1) > 0.0
    return first + np.concatenate([[0], 1 + np.flatnonzero(ahead)]).astype(np.intp)


def _stencil(nodes: Floats, first: int) -> slice:
    begin = min(max(first - 1, 0), max(len(nodes) - 4, 0))
    return slice(begin, begin + 4)


def _lagrange(nodes: Floats, at: float, first: int | None = None) -> Floats:
    """Return the weights of all nodes in the cubic through the four nodes around `at`."""
    if first is None:
        first = int(np.searchsorted(nodes, at)) - 1
    part = _stencil(nodes, first)
    weights = np.zeros(len(nodes))
    weights[part] = _shares(nodes[part].tolist(), at)
    return weights


def _shares(near: list[float], at: float) -> list[float]:
    """Return the Lagrange weights of a few nodes, without the overhead of arrays."""
    found = []
    for here in near:
        weight = 1.0
        for other in near:
            if other != here:
                weight *= (at - other) / (here - other)
        found.append(weight)
    return found


def _invert(nodes: Floats, values: Floats, sought: float, first: int) -> float:
    """Return where the cubic interpolant has a value between two nodes (bracketed secant)."""
    low, high = float(nodes[first]), float(nodes[first + 1])
    f_low, f_high = float(values[first] - sought), float(values[first + 1] - sought)
    if f_high == 0.0:  # exactly at a state
        return high
    part = _stencil(nodes, first)
    near, known = nodes[part].tolist(), values[part].tolist()
    at = low
    for _ in range(60):
        at = low - f_low * (high - low) / (f_high - f_low) if f_high != f_low else low
        if not low < at < high:
            at = 0.5 * (low + high)
        error = math.fsum(map(operator.mul, _shares(near, at), known)) - sought
        if abs(error) < 1e-15 or high - low < 1e-15:
            break
        # Illinois method: halve the value at the end that is kept, so that both ends converge
        if (error > 0.0) == (f_high > 0.0):
            high, f_high, f_low = at, error, 0.5 * f_low
        else:
            low, f_low, f_high = at, error, 0.5 * f_high
    return at


class TipTrajectory:
    """Trajectory of the tip in the material, as intervals between ruptures.

    Parameters
    ----------
    insertion : Insertion
    """

    def __init__(self, insertion: "Insertion") -> None:
        self.axis = insertion.axis
        self.puncture_depth = insertion.puncture_depth
        self.entry: Vector = insertion.tips[0]
        kept = _cutting(insertion)
        tips, depths = insertion.tips[kept], insertion.depths[kept]
        steps = np.linalg.norm(np.diff(tips, axis=0), axis=1)
        length = np.concatenate([[0.0], np.cumsum(steps)])
        ruptures = [np.searchsorted(kept, [r.first, r.last]) for r in insertion.ruptures]
        ends = [0, *(last for _, last in ruptures)]
        stops = [*(first + 1 for first, _ in ruptures), len(tips)]
        self.intervals = [
            _without_stub(TrajectoryInterval(length[a:b], depths[a:b], tips[a:b]))
            for a, b in zip(ends, stops, strict=True)
            if b - a > 1
        ]

    def at_depth(self, depth: float) -> TipPoint | None:
        """Return the material point at the tip at a depth, or None beyond the end of the path.

        Before the puncture it is the entry point.
        """
        if self.puncture_depth is None or depth <= self.puncture_depth:
            return TipPoint(depth, self.entry)
        for interval in self.intervals:
            length = interval.solve(interval.depth, depth)
            if length is not None:
                return interval.at(length)
        return None

    def at_target_depth(self, target: Vector) -> TipPoint | None:
        """Return the point of the trajectory with the axial coordinate of the target, or None.

        None: the path ends before the target, or the tip passes that material in a rupture.
        """
        sought = float(self.axis.axial_coordinate(target))
        for interval in self.intervals:
            length = interval.solve(self.axis.axial_coordinate(interval.point), sought)
            if length is not None:
                return interval.at(length)
        return None

    def closest(self, target: Vector) -> TipPoint | None:
        """Return the point of the trajectory closest to the target, or None if nothing was cut."""
        best: TipPoint | None = None
        for interval in self.intervals:
            nearest = self._closest(interval, target)
            if best is None or _distance(nearest, target) < _distance(best, target):
                best = nearest
        return best

    @staticmethod
    def _closest(interval: TrajectoryInterval, target: Vector) -> TipPoint:
        apart = np.sum((interval.point - target) ** 2, axis=1)
        middle = int(np.argmin(apart))
        low = interval.length[max(middle - 1, 0)]
        high = interval.length[min(middle + 1, len(interval.length) - 1)]
        # a minimum is accurate to the square root of round-off
        tried = golden_section(lambda s: _distance(interval.at(s), target), low, high, CLOSE)
        return interval.at(min(tried, key=operator.itemgetter(1))[0])


def _distance(reached: TipPoint, target: Vector) -> float:
    return float(np.linalg.norm(reached.point - target))
