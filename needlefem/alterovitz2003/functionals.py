"""What a needle weighs on a mesh whose nodes it moves: nodes, or means over its own thickness."""

import numpy as np

from needlefem._arrays import Floats, Ints, Points, Vector
from needlefem.alterovitz2003.movable_mesh import MovableMesh
from needlefem.fem.interpolation import LinearFunctionals
from needlefem.needle.needle_interface import NeedleInterface


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
