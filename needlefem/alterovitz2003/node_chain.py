"""What a needle weighs on a mesh whose nodes it moves: nodes, or means over its own thickness."""

import dataclasses

import numpy as np

from needlefem._arrays import Floats, Ints, Points, Vector
from needlefem.alterovitz2003.movable_mesh import MovableMesh
from needlefem.fem.interpolation import LinearFunctionals
from needlefem.needle.needle_interface import InsertionAxis, NeedleInterface


class NeedleFunctionals:
    """The needle's functionals on a moved mesh.

    Parameters
    ----------
    instrument : NeedleInterface
    mesh : MovableMesh
    spread : bool
        Means over the tip's kernel and the shaft's section; else values at nodes alone.
    """

    def __init__(self, instrument: NeedleInterface, mesh: MovableMesh, *, spread: bool) -> None:
        self.instrument, self.mesh, self.spread = instrument, mesh, spread
        self._among: Ints = np.zeros(0, dtype=np.intp)
        self._centre: Vector = instrument.axis.entry
        self._reach = 0.0
        self._cutting_force = _uniform(instrument.cutting_force)
        self._friction = _uniform(instrument.shaft_friction)

    def look(self, node: int, point: Vector, shaft: Ints) -> tuple[LinearFunctionals, Ints]:
        """Look around a tip whose node is at a point, until that is too far from there.

        Returns
        -------
        LinearFunctionals
            A functional for each of the nodes on the shaft.
        array
            Nodes that the tip's functional may weigh from now on.
        """
        self._centre = point
        if not self.spread:
            return LinearFunctionals(shaft, np.eye(len(shaft))), np.array([node])
        self._reach = self.size(node)
        points, _ = self.instrument.kernel.quadrature(point)
        thick = float(np.linalg.norm(points - point, axis=1).max())
        away = np.linalg.norm(self.mesh.points[self.mesh.cells] - point, axis=2).min(axis=1)
        self._among = np.flatnonzero(away <= thick + 2.0 * self._reach)
        return self._sections(shaft), np.unique(self.mesh.cells[self._among])

    def far(self, point: Vector) -> bool:
        """Say whether a tip at a point needs another look."""
        return self.spread and float(np.linalg.norm(point - self._centre)) > 0.5 * self._reach

    def size(self, node: int) -> float:
        """Return the longest way from a node to its neighbours, all at home, m."""
        ring = self.mesh.cells[self.mesh.around(np.array([node]))]
        return float(np.linalg.norm(self.mesh.home[ring] - self.mesh.home[node], axis=2).max())

    def tip(self, node: int, point: Vector) -> LinearFunctionals:
        """Return the tip's functional, its node being put at a point."""
        if not self.spread:
            return LinearFunctionals(np.array([node]), np.ones((1, 1)))
        points, weights = self.instrument.kernel.quadrature(point)
        before = self.mesh.points[node].copy()
        self.mesh.points[node] = point
        found = self._means(points, weights, np.zeros(len(points), dtype=np.intp), self._among)
        self.mesh.points[node] = before
        return found

    def _sections(self, shaft: Ints) -> LinearFunctionals:
        """Return the mean over the needle's thickness at every node on the shaft."""
        if not len(shaft):
            return LinearFunctionals(shaft, np.zeros((0, 0)))
        axis, (across, share) = self.instrument.axis, self.instrument.section
        centres = self.mesh.points[shaft]
        points = (centres[:, None] + across @ axis.lateral_directions).reshape(-1, 2)
        beside = axis.lateral_offset(self.mesh.points)[self.mesh.cells, 0]
        low, high = np.min(axis.lateral_offset(points)), np.max(axis.lateral_offset(points))
        among = np.flatnonzero((beside.max(axis=1) >= low) & (beside.min(axis=1) <= high))
        rows = np.repeat(np.arange(len(centres)), len(across))
        return self._means(points, np.tile(share, len(centres)), rows, among)

    def _means(self, points: Points, weights: Floats, row: Ints, among: Ints) -> LinearFunctionals:
        """Return weighted means over points; those outside the tissue are left out."""
        count = int(row[-1]) + 1
        cell, share = self.mesh.find(points, among)
        weights = np.where(cell < 0, 0.0, weights)
        values = share * (weights / np.bincount(row, weights, count)[row])[:, None]
        nodes, position = np.unique(self.mesh.cells[cell], return_inverse=True)
        slot = row[:, None] * len(nodes) + position.reshape(values.shape)
        rows = np.bincount(slot.ravel(), values.ravel(), count * len(nodes)).astype(float)
        return LinearFunctionals(nodes, rows.reshape(count, len(nodes)))

    def cutting_force(self, point: Vector) -> float:
        """Return the force at which the tip cuts at a material point, N/m."""
        if self._cutting_force is not None:
            return self._cutting_force
        return self.instrument.cutting_force_at(self.instrument.tip(point))

    def friction(self, points: Points) -> Floats:
        """Return the friction limit at material points, shape (n,), Pa."""
        if self._friction is not None or not len(points):
            return np.full(len(points), self._friction or 0.0)
        return self.instrument.interpolation.at(points).of(self.instrument.shaft_friction)


def _uniform(field: Floats) -> float | None:
    """Return the value of a field that is the same everywhere (to round-off), or None."""
    same = float(np.ptp(field)) <= 1e-12 * float(np.abs(field).max())
    return float(field[0]) if same else None


# Nodes of the mesh that lie on the needle: one at its tip, those left behind on its shaft.
#
# A node is kept at the tip by moving the nearest one in the reference mesh (R. Alterovitz et al.,
# IROS 2003, section IV.D). As long as a node is the nearest it follows the tip; then it goes back
# along the cut path to where it is abreast of its home, and stays on the shaft. A move is allowed
# if every cell around keeps a share `LEAST_AREA` of its area at home, so that none turns over; of
# the nodes that may move the nearest is taken.


LEAST_AREA = 0.05
"""Least area of a cell, relative to that at home, that a move may leave."""
MIDDLE = (0.25, 0.75)
"""Part of the way from the last node on the shaft to the tip in which a node is left behind."""
TIE = 1e-9
"""Margin of comparisons, relative: a ratio of areas counts as large enough from so little below,
and of two nodes whose distances differ by no more the one with the lower number is the nearer."""
AHEAD = 0.1
"""How far a node's home must be ahead of the last one's to follow it at the tip, relative to the
way to the second next nodes."""

Moves = tuple[tuple[int, Vector], ...]
"""Nodes and where they go; the last is the one at the tip."""


@dataclasses.dataclass(frozen=True, eq=False)
class ShaftNode:
    """A node on the shaft.

    Parameters
    ----------
    node : int
    length : float, m
        Length of the cut path from the skin to it.
    """

    node: int
    length: float


@dataclasses.dataclass(frozen=True, eq=False)
class Mark:
    """A chain at one time."""

    tip_node: int
    shaft: tuple[ShaftNode, ...]
    points: Points


class NodeChain:
    """The nodes on a needle, from the skin to the tip.

    Parameters
    ----------
    mesh : MovableMesh
        Moved along.
    axis : InsertionAxis
        Its entry must lie on the outer boundary.

    Raises
    ------
    NoNodeError
        No node of the skin can be moved to the entry.
    """

    def __init__(self, mesh: MovableMesh, axis: InsertionAxis) -> None:
        self.mesh, self.axis = mesh, axis
        self.shaft: list[ShaftNode] = []
        self.path: list[Vector] = [axis.entry]
        self.lengths: list[float] = [0.0]
        outer = np.flatnonzero(mesh.fixed)
        skin = int(outer[np.argmin(np.linalg.norm(mesh.home[outer] - axis.entry, axis=1))])
        moves: Moves = ((skin, axis.entry),)
        if not self.valid(moves):
            raise NoNodeError("no node of the skin can be moved to where the needle enters")
        self.tip_node = skin
        self._free: Ints | None = None
        self._apply(moves)

    @property
    def nodes(self) -> Ints:
        """Nodes on the shaft, in the order of the path."""
        return np.fromiter((one.node for one in self.shaft), np.intp, len(self.shaft))

    @property
    def tip(self) -> Vector:
        """Material point at the tip."""
        return self.path[-1]

    def shares(self, tip: Vector | None) -> Floats:
        """Return the length of path that each shaft node, and last the tip, stands for, m.

        Without a tip, which has been drawn back, it is that between the nodes.
        """
        count = len(self.shaft)
        where = np.empty(count + 1)
        where[:-1] = [one.length for one in self.shaft]
        where[-1] = where[count - 1] if count else 0.0
        if tip is not None:
            where[-1] = self.lengths[-1] + float(np.linalg.norm(tip - self.path[-1]))
        half = 0.5 * (where[1:] - where[:-1])
        found = np.zeros(count + 1)
        found[:-1] = half
        found[1:] += half
        return found

    def moves_to(self, point: Vector) -> Moves:
        """Return the moves that bring the nearest node to a point ahead on the path.

        Raises
        ------
        NoNodeError
            None of the nodes around can be moved there without turning a cell over.
        """
        for node in self._candidates(point):
            for moves in self._ways(node, point):
                if self.valid(moves):
                    return moves
        where = ", ".join(f"{100.0 * float(x):.4g}" for x in point)
        raise NoNodeError(f"no node can be moved to ({where}) cm without turning a cell over")

    def _candidates(self, point: Vector) -> list[int]:
        """Return the nodes that may be at the tip, the nearest at home first."""
        if self._free is None:
            self._free = self._free_around()
        away = np.linalg.norm(self.mesh.home[self._free] - point, axis=1)
        return [int(node) for node in self._free[nearest_first(away)]]

    def _free_around(self) -> Ints:
        """Return the tip's node and those ahead of it that may follow it."""
        ring = np.unique(self.mesh.cells[self.mesh.around(np.array([self.tip_node]))])
        ring = np.unique(self.mesh.cells[self.mesh.around(ring)])
        ahead = (self.mesh.home[ring] - self.mesh.home[self.tip_node]) @ self.axis.direction
        follows = (ahead > AHEAD * float(np.abs(ahead).max())) & ~np.isin(ring, self.nodes)
        follows |= ring == self.tip_node
        free: Ints = ring[follows & ~self.mesh.fixed[ring]]
        return free

    def _ways(self, node: int, point: Vector) -> list[Moves]:
        """Return the ways to bring a node to the tip: where the last one may be left behind."""
        if node == self.tip_node:
            return [((node, point),)]
        if not self.shaft:
            return [((node, point),)]  # the skin's node stays at the entry
        return [
            ((self.tip_node, self._on_path(length)), (node, point))
            for length in (self._behind(), self.lengths[-1])
        ]

    def _behind(self) -> float:
        """Return the path length at which the tip's node is left: abreast of its home."""
        last, end = self.shaft[-1].length, self.lengths[-1]
        along = self.axis.axial_coordinate(np.array(self.path))
        sought = float(self.axis.axial_coordinate(self.mesh.home[self.tip_node]))
        length = float(np.interp(sought, along, self.lengths))
        low, high = (last + share * (end - last) for share in MIDDLE)
        return min(max(length, low), high)

    def _on_path(self, length: float) -> Vector:
        where = np.searchsorted(self.lengths, length)
        if where == 0:
            return self.path[0]
        before, after = self.lengths[where - 1], self.lengths[where]
        share = (length - before) / (after - before)
        point: Vector = self.path[where - 1] + share * (self.path[where] - self.path[where - 1])
        return point

    def valid(self, moves: Moves) -> bool:
        """Say whether moves leave every cell around a sufficient share of its area."""
        nodes = np.array([node for node, _ in moves])
        cells = self.mesh.around(nodes)
        corners = self.mesh.corners(cells)
        for node, point in moves:
            corners[self.mesh.cells[cells] == node] = point
        return bool(self.mesh.ratios(cells, corners).min() >= (1.0 - TIE) * LEAST_AREA)

    def advance(self, moves: Moves) -> bool:
        """Make moves; say whether another node is at the tip now."""
        changed = moves[-1][0] != self.tip_node
        if changed:
            length = 0.0
            if len(moves) > 1:
                length = self._length_at(moves[0][1])
            self.shaft.append(ShaftNode(self.tip_node, length))
            self.tip_node, self._free = moves[-1][0], None
        self._apply(moves)
        return changed

    def _length_at(self, point: Vector) -> float:
        along = self.axis.axial_coordinate(np.array(self.path))
        return float(np.interp(float(self.axis.axial_coordinate(point)), along, self.lengths))

    def record(self, tip: Vector) -> None:
        """Let the cut path go on to a point."""
        self.lengths.append(self.lengths[-1] + float(np.linalg.norm(tip - self.path[-1])))
        self.path.append(tip)

    def drop(self) -> int:
        """Take the deepest node off the needle, which has left it; return its number."""
        return self.shaft.pop().node

    def mark(self) -> "Mark":
        """Return what `back_to` needs to undo moves."""
        return Mark(self.tip_node, tuple(self.shaft), self.mesh.points.copy())

    def back_to(self, mark: "Mark") -> None:
        """Undo all moves since a mark."""
        self.tip_node, self.shaft, self._free = mark.tip_node, list(mark.shaft), None
        for node in np.flatnonzero(np.any(self.mesh.points != mark.points, axis=1)):
            self.mesh.place(int(node), mark.points[node])

    def _apply(self, moves: Moves) -> None:
        for node, point in moves:
            self.mesh.place(node, point)


def nearest_first(distances: Floats) -> Ints:
    """Return the order of distances, shape (n,), rising; of nearly equal ones the first is first.

    Those count as equal that differ by at most `TIE` of the largest.
    """
    order = np.argsort(distances, kind="stable")
    apart = np.diff(distances[order]) > TIE * float(distances.max(initial=0.0))
    group = np.concatenate([[0], np.cumsum(apart)]).astype(np.intp)
    found: Ints = order[np.lexsort((order, group[: len(order)]))]
    return found


class NoNodeError(Exception):
    """No node can be where one is needed."""
