"""The straight line on which a rigid needle moves."""

import dataclasses
from functools import cached_property

import numpy as np

from needlefem._arrays import Floats, Points, Vector


@dataclasses.dataclass(frozen=True, eq=False)
class InsertionAxis:
    """The line ``entry + s direction``, s being the depth of the tip.

    Parameters
    ----------
    entry : array, shape (dim,), m
        Where the line meets the undeformed skin.
    direction : array, shape (dim,)
        Unit vector of insertion.
    """

    entry: Vector
    direction: Vector

    @cached_property
    def lateral_directions(self) -> Floats:
        """Orthonormal lateral directions, shape (dim - 1, dim).

        Made from the coordinate axes in their order, the one most along the needle left out.
        """
        dim = len(self.direction)
        keep = np.delete(np.eye(dim), np.argmax(np.abs(self.direction)), axis=0)
        basis = [self.direction]
        for candidate in keep:
            rest = candidate - sum((candidate @ b) * b for b in basis)
            basis.append(rest / np.linalg.norm(rest))
        return np.array(basis[1:])

    @cached_property
    def frame(self) -> Floats:
        """Rows: the direction, then the laterals; shape (dim, dim)."""
        return np.vstack([self.direction, self.lateral_directions])

    def tip_position(self, depth: float) -> Vector:
        """Return where the tip is in the world at a depth, shape (dim,), m."""
        return self.entry + depth * self.direction

    def lateral_offset(self, points: Points) -> Floats:
        """Return lateral coordinates relative to the line, shape (..., dim - 1), m."""
        offsets: Floats = (points - self.entry) @ self.lateral_directions.T
        return offsets

    def axial_coordinate(self, points: Points) -> Floats:
        """Return coordinates along the line from the entry, shape (...,), m."""
        lengths: Floats = (points - self.entry) @ self.direction
        return lengths
