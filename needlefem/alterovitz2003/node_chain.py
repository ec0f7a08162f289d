"""The nodes of the mesh on the needle, and its functionals: nodal values or means."""

import dataclasses

import numpy as np

from needlefem._arrays import Floats, Ints, Points, Vector
from needlefem.alterovitz2003.movable_mesh import MovableMesh
from needlefem.fem.interpolation import LinearFunctionals
from needlefem.needle.needle_interface import InsertionAxis, NeedleInterface


class NeedleFunctionals:
    """Functionals of the needle on a mesh with moved nodes.

    Parameters
    ----------
    instrument : NeedleInterface
    mesh : MovableMesh
    spread : bool
        Whether means over tip kernel and shaft section are used; else nodal values.
    """

    def __init__(self, instrument: NeedleInterface, mesh: MovableMesh, *, spread: bool) -> None:
        self.instrument, self.mesh, self.spread = instrument, mesh, spread
        self._among: Ints = np.zeros(0, dtype=np.intp)
        self._centre: Vector = instrument.axis.entry
        self._reach = 0.0
        self._cutting_force = _uniform(instrument.cutting_force)
        self._friction = _uniform(instrument.shaft_friction)

    def look(self, node: int, point: Vector, shaft: Ints) -> tuple[LinearFunctionals, Ints]:
        """Update the neighbourhood of the tip node for a position.

        Returns
        -------
        LinearFunctionals
            One functional per shaft node.
        array
            Nodes that the tip functional may use from now on.
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
        """Return whether a tip at a point is outside of the prepared neighbourhood."""
        return self.spread and float(np.linalg.norm(point - self._centre)) > 0.5 * self._reach

    def size(self, node: int) -> float:
        """Return the largest distance of a node from its neighbours, at original positions, m."""
        ring = self.mesh.cells[self.mesh.around(np.array([node]))]
        return float(np.linalg.norm(self.mesh.home[ring] - self.mesh.home[node], axis=2).max())

    def tip(self, node: int, point: Vector) -> LinearFunctionals:
        """Return the functional of the tip, with its node moved to a point."""
        if not self.spread:
            return LinearFunctionals(np.array([node]), np.ones((1, 1)))
        points, weights = self.instrument.kernel.quadrature(point)
        before = self.mesh.points[node].copy()
        self.mesh.points[node] = point
        found = self._means(points, weights, np.zeros(len(points), dtype=np.intp), self._among)
        self.mesh.points[node] = before
        return found

    def _sections(self, shaft: Ints) -> LinearFunctionals:
        """Return the mean over the needle's section at each shaft node."""
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
        """Return weighted means over points; points outside of the tissue are omitted."""
        count = int(row[-1]) + 1
        cell, share = self.mesh.find(points, among)
        weights = np.where(cell < 0, 0.0, weights)
        values = share * (weights / np.bincount(row, weights, count)[row])[:, None]
        nodes, position = np.unique(self.mesh.cells[cell], return_inverse=True)
        slot = row[:, None] * len(nodes) + position.reshape(values.shape)
        rows = np.bincount(slot.ravel(), values.ravel(), count * len(nodes)).astype(float)
        return LinearFunctionals(nodes, rows.reshape(count, len(nodes)))

    def cutting_force(self, point: Vector) -> float:
        """Return the cutting force at a material point, N/m."""
        if self._cutting_force is not None:
            return self._cutting_force
        return self.instrument.cutting_force_at(self.instrument.tip(point))

    def friction(self, points: Points) -> Floats:
        """Return the friction limit at material points, shape (n,), Pa."""
        if self._friction is not None or not len(points):
            return np.full(len(points), self._friction or 0.0)
        return self.instrument.interpolation.at(points).of(self.instrument.shaft_friction)


def _uniform(field: Floats) -> float | None:
    """Return the value of a field that is uniform within round-off, or None."""
    same = float(np.ptp(field)) <= 1e-12 * float(np.abs(field).max())
    return float(field[0]) if same else None


# Nodes of the mesh on the needle: the tip node, and previous tip nodes on the shaft.
#
# The nearest node is moved to the tip in the undeformed mesh (R. Alterovitz et al., IROS 2003,
# section IV.D). It follows the tip as long as it is the nearest one. Then it moves back along the
# cut path to the point that is level with its original position, and remains on the shaft. A move
# is allowed if each adjacent cell keeps a share `LEAST_AREA` of its original area, so that no cell
# is inverted. The nearest node with an allowed move is used.


LEAST_AREA = 0.05
"""Smallest area of a cell after a move, relative to its original area."""
MIDDLE = (0.25, 0.75)
"""Share of the distance from the last shaft node to the tip in which a node can be left."""
TIE = 1e-9
"""Relative margin of comparisons, so that round-off has no influence: a slightly smaller area is
sufficient, and of two nodes with nearly equal distance the one with the lower number is used."""
AHEAD = 0.1
"""Smallest distance of a node ahead of the last tip node to be the next one, relative to the
distance of second neighbours."""

Moves = tuple[tuple[int, Vector], ...]
"""Nodes and their new positions; the last one is the tip node."""


@dataclasses.dataclass(frozen=True, eq=False)
class ShaftNode:
    """A node on the shaft.

    Parameters
    ----------
    node : int
    length : float, m
        Length of the cut path from the skin to the node.
    """

    node: int
    length: float


@dataclasses.dataclass(frozen=True, eq=False)
class Mark:
    """State of a chain for a restoration."""

    tip_node: int
    shaft: tuple[ShaftNode, ...]
    points: Points


class NodeChain:
    """The nodes on a needle from the skin to the tip.

    Parameters
    ----------
    mesh : MovableMesh
        Mesh whose nodes are moved.
    axis : InsertionAxis
        Its entry must be on the outer boundary.

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
        """Shaft nodes in the order of the path."""
        return np.fromiter((one.node for one in self.shaft), np.intp, len(self.shaft))

    @property
    def tip(self) -> Vector:
        """Material point at the tip."""
        return self.path[-1]

    def shares(self, tip: Vector | None) -> Floats:
        """Return the length of path that belongs to each shaft node and finally to the tip, m.

        After a retraction there is no tip; the lengths are those between the nodes.
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
            No nearby node can be moved there without inverting a cell.
        """
        for node in self._candidates(point):
            for moves in self._ways(node, point):
                if self.valid(moves):
                    return moves
        where = ", ".join(f"{100.0 * float(x):.4g}" for x in point)
        raise NoNodeError(f"no node can be moved to ({where}) cm without inverting a cell")

    def _candidates(self, point: Vector) -> list[int]:
        """Return the candidates for the tip node by the distance of their original positions."""
        if self._free is None:
            self._free = self._free_around()
        away = np.linalg.norm(self.mesh.home[self._free] - point, axis=1)
        return [int(node) for node in self._free[nearest_first(away)]]

    def _free_around(self) -> Ints:
        """Return the tip node and the nodes ahead of it that can follow it."""
        ring = np.unique(self.mesh.cells[self.mesh.around(np.array([self.tip_node]))])
        ring = np.unique(self.mesh.cells[self.mesh.around(ring)])
        ahead = (self.mesh.home[ring] - self.mesh.home[self.tip_node]) @ self.axis.direction
        follows = (ahead > AHEAD * float(np.abs(ahead).max())) & ~np.isin(ring, self.nodes)
        follows |= ring == self.tip_node
        free: Ints = ring[follows & ~self.mesh.fixed[ring]]
        return free

    def _ways(self, node: int, point: Vector) -> list[Moves]:
        """Return the possible moves of a node to the tip, with positions of the last one."""
        if node == self.tip_node:
            return [((node, point),)]
        if not self.shaft:
            return [((node, point),)]  # the node of the skin remains at the entry
        return [
            ((self.tip_node, self._on_path(length)), (node, point))
            for length in (self._behind(), self.lengths[-1])
        ]

    def _behind(self) -> float:
        """Return the path length at which the tip node is left on the shaft, m."""
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
        """Return whether all adjacent cells keep a sufficient area after moves."""
        nodes = np.array([node for node, _ in moves])
        cells = self.mesh.around(nodes)
        corners = self.mesh.corners(cells)
        for node, point in moves:
            corners[self.mesh.cells[cells] == node] = point
        return bool(self.mesh.ratios(cells, corners).min() >= (1.0 - TIE) * LEAST_AREA)

    def advance(self, moves: Moves) -> bool:
        """Apply moves; return whether the tip node is another one."""
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
        """Extend the cut path to a point."""
        self.lengths.append(self.lengths[-1] + float(np.linalg.norm(tip - self.path[-1])))
        self.path.append(tip)

    def drop(self) -> int:
        """Remove the deepest node from the needle; return its number."""
        return self.shaft.pop().node

    def mark(self) -> "Mark":
        """Return the data that `back_to` needs for undoing moves."""
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
    """Return the order of distances, shape (n,), rising; nearly equal ones keep their order.

    Distances are nearly equal if they differ by at most `TIE` of the largest.
    """
    order = np.argsort(distances, kind="stable")
    apart = np.diff(distances[order]) > TIE * float(distances.max(initial=0.0))
    group = np.concatenate([[0], np.cumsum(apart)]).astype(np.intp)
    found: Ints = order[np.lexsort((order, group[: len(order)]))]
    return found


class NoNodeError(Exception):
    """No node can be moved to the required position."""
