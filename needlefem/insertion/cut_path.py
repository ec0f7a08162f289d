"""The cut path of a needle, and the trajectory of its tip in the material.

`CutPath` holds the contact segments of a path while a motion runs, with the slip that each has
accumulated. `TipTrajectory` evaluates an insertion that has ended: the material point at the tip
for any depth, and the depth for a point.
"""

import math
import operator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from needlefem._arrays import Floats, Ints, Points, Vector
from needlefem.needle.needle_interface import NeedleInterface

if TYPE_CHECKING:
    from needlefem.insertion.result import Insertion


class CutPath:
    """Where the needle has cut, and how its surface has slid there.

    Piece 0 is the entry point, without length; piece j ends at `vertices[j]`; the last, number
    `count`, grows from the newest vertex to the crack front.
    """

    def __init__(self, instrument: NeedleInterface) -> None:
        self.instrument = instrument
        self.vertices: list[Vector] = [instrument.axis.entry]
        self.arcs: list[float] = [0.0]
        self.crack_front: Vector = instrument.axis.entry
        self.kinetic: list[float] = [0.0]
        """Friction limit of whole pieces, N (N/m in 2D)."""
        self.friction_force: Floats = np.zeros(2)
        """Friction force on every piece, the growing one included."""
        self.slip_since_stick: Floats = np.full(2, np.inf)
        """Slip of every piece since it last stuck, m; without end for freshly cut ones."""
        self.pace = self.slope = 1.0
        """Advance on the path per depth, and gap per advance, when the tip was last drawn back."""

    @property
    def count(self) -> int:
        """Number of whole pieces."""
        return len(self.vertices)

    @property
    def length(self) -> float:
        """Length of the cut path, m."""
        return self.arcs[-1] + float(np.linalg.norm(self.crack_front - self.vertices[-1]))

    def at(self, arc: float) -> tuple[int, Vector]:
        """Return the number of whole pieces behind a path length, and the material point there."""
        whole = min(max(int(np.searchsorted(self.arcs, arc, side="left")), 1), self.count)
        start, begin = self.vertices[whole - 1], self.arcs[whole - 1]
        end = self.crack_front if whole == self.count else self.vertices[whole]
        span = (self.length if whole == self.count else self.arcs[whole]) - begin
        share = (arc - begin) / span if span > 0.0 else 0.0
        return whole, start + share * (end - start)

    def extend(self, kinetic: float) -> None:
        """Make the growing piece a whole one, and begin the next."""
        self.arcs.append(self.length)
        self.vertices.append(self.crack_front)
        self.kinetic.append(kinetic)
        self.friction_force = np.append(self.friction_force, 0.0)
        self.slip_since_stick = np.append(self.slip_since_stick, np.inf)

    def store(self, pull: Floats, slipped: Floats) -> None:
        """Keep friction forces, and slip since sticking, of the pieces that the needle is in."""
        count = len(pull)
        self.friction_force = np.zeros(len(self.friction_force))
        self.friction_force[:count] = pull
        self.slip_since_stick = np.full(
            len(self.slip_since_stick), np.inf
        )  # caught again it slides at once
        self.slip_since_stick[:count] = slipped


# Trajectory of the tip in the material.
#
# Between states all quantities are interpolated by cubics in the length of the cut path. There is
# no interpolation across a rupture: the material between its ends is not on the path.


STUB = 0.01
"""Length of a path's last step, over that of the one before, from which on it counts."""


class TipPoint(NamedTuple):
    """A material point that the tip reaches, and the depth at which it does.

    Parameters
    ----------
    depth : float, m
    point : array, shape (dim,), m
        Material point at the tip: where a seed released there comes to rest.
    """

    depth: float
    point: Vector


class TrajectoryInterval(NamedTuple):
    """A stretch of the path that the tip passed without a snap.

    Parameters
    ----------
    length : array, shape (n,), m
        Path length of its states from the skin.
    depth : array, shape (n,), m
    point : array, shape (n, dim), m
    """

    length: Floats
    depth: Floats
    point: Points

    def at(self, length: float) -> TipPoint:
        """Interpolate at a path length."""
        values = _lagrange(self.length, length) @ np.column_stack([self.depth, self.point])
        return TipPoint(float(values[0]), values[1:])

    def solve(self, values: Floats, sought: float) -> float | None:
        """Return the first path length at which a quantity of the states takes a value."""
        above = values >= sought
        cross = np.flatnonzero(above[1:] != above[:-1])
        if not cross.size:
            return None
        first = int(cross[0])
        return _invert(self.length, values, sought, first)


def _without_stub(piece: TrajectoryInterval) -> TrajectoryInterval:
    """Return a piece without its last state but one if that is all but at the end.

    A cubic through both would have their round-off, divided by their distance, for its slope.
    """
    steps = np.diff(piece.length)
    if len(steps) < 2 or steps[-1] >= STUB * steps[-2]:
        return piece
    return TrajectoryInterval(*(np.delete(values, -2, axis=0) for values in piece))


def _cutting(insertion: "Insertion") -> Ints:
    """Return the numbers of the states in which the tip is further in the material than before."""
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
    """Return the weights of all nodes in the cubic through the four around `at`."""
    if first is None:
        first = int(np.searchsorted(nodes, at)) - 1
    part = _stencil(nodes, first)
    weights = np.zeros(len(nodes))
    weights[part] = _shares(nodes[part].tolist(), at)
    return weights


def _shares(near: list[float], at: float) -> list[float]:
    """Return Lagrange's weights; of four numbers, where arrays only cost."""
    found = []
    for here in near:
        weight = 1.0
        for other in near:
            if other != here:
                weight *= (at - other) / (here - other)
        found.append(weight)
    return found


def _invert(nodes: Floats, values: Floats, sought: float, first: int) -> float:
    """Return where between two nodes the interpolating cubic takes a value (bracketed secant)."""
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
        # Illinois: halve the value at an end that stays, so that both ends close in
        if (error > 0.0) == (f_high > 0.0):
            high, f_high, f_low = at, error, 0.5 * f_low
        else:
            low, f_low, f_high = at, error, 0.5 * f_high
    return at


class TipTrajectory:
    """The cut path of an insertion as pieces between snaps."""

    def __init__(self, insertion: "Insertion") -> None:
        self.axis = insertion.axis
        self.puncture_depth = insertion.puncture_depth
        self.entry: Vector = insertion.tips[0]
        kept = _cutting(insertion)
        tips, depths = insertion.tips[kept], insertion.depths[kept]
        steps = np.linalg.norm(np.diff(tips, axis=0), axis=1)
        length = np.concatenate([[0.0], np.cumsum(steps)])
        snaps = [np.searchsorted(kept, [snap.first, snap.last]) for snap in insertion.ruptures]
        ends = [0, *(last for _, last in snaps)]
        stops = [*(first + 1 for first, _ in snaps), len(tips)]
        self.pieces = [
            _without_stub(TrajectoryInterval(length[a:b], depths[a:b], tips[a:b]))
            for a, b in zip(ends, stops, strict=True)
            if b - a > 1
        ]

    def at_depth(self, depth: float) -> TipPoint | None:
        """Return the material point at the tip at a depth, or None beyond the path's end.

        Before the skin is cut it is the entry point.
        """
        if self.puncture_depth is None or depth <= self.puncture_depth:
            return TipPoint(depth, self.entry)
        for piece in self.pieces:
            length = piece.solve(piece.depth, depth)
            if length is not None:
                return piece.at(length)
        return None

    def at_target_depth(self, target: Vector) -> TipPoint | None:
        """Return where the tip is level with the target along the needle, or None.

        None means that the path ends before, or that the material there was jumped over.
        """
        sought = float(self.axis.axial_coordinate(target))
        for piece in self.pieces:
            length = piece.solve(self.axis.axial_coordinate(piece.point), sought)
            if length is not None:
                return piece.at(length)
        return None

    def closest(self, target: Vector) -> TipPoint | None:
        """Return the point of the path nearest to the target, or None if nothing was cut."""
        best: TipPoint | None = None
        for piece in self.pieces:
            nearest = self._closest(piece, target)
            if best is None or _away(nearest, target) < _away(best, target):
                best = nearest
        return best

    @staticmethod
    def _closest(piece: TrajectoryInterval, target: Vector) -> TipPoint:
        apart = np.sum((piece.point - target) ** 2, axis=1)
        middle = int(np.argmin(apart))
        low = piece.length[max(middle - 1, 0)]
        high = piece.length[min(middle + 1, len(piece.length) - 1)]
        for _ in range(200):  # golden section on the distance; its floor is (1e-16)^(1/2) of it
            if high - low < 1e-11:
                break
            inner = high - 0.6180339887498949 * (high - low)
            outer = low + 0.6180339887498949 * (high - low)
            if _away(piece.at(inner), target) < _away(piece.at(outer), target):
                high = outer
            else:
                low = inner
        return piece.at(0.5 * (low + high))


def _away(reach: TipPoint, target: Vector) -> float:
    return float(np.linalg.norm(reach.point - target))
