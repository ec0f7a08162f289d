"""A needle on its line in one tissue: what it touches there and what resists it."""

import dataclasses
from functools import cached_property

import numpy as np

from needlefem.arrays import Floats, Points, Vector
from needlefem.fem.interpolation import Follower, Interpolation, Weights
from needlefem.needle.axis import Axis
from needlefem.needle.kernel import Kernel

PIECE_POINTS = 5
"""Gauss points on a piece of the cut path; more change nothing at h >= spacing / 3."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Instrument:
    """All that contact needs to know of the needle.

    Parameters
    ----------
    axis : Axis
        Its line.
    kernel : Kernel
        How the tip's force is spread.
    interpolation : Interpolation
        Of the tissue's displacement.
    cutting_force : array, shape (nnodes,), N (N/m in 2D)
        Nodal field of the axial force at which the tip cuts.
    shaft_friction : array, shape (nnodes,), N/m (Pa in 2D)
        Nodal field of the friction limit per length of cut path.
    section : (array, array)
        Offsets (n, dim - 1), m, and weights (n,) of a rule over the shaft's cross-section.
    lateral_stiffness : float, Pa (N/m^3 in 2D)
        Of the hold on the axis per length of cut path.
    spacing : float, m
        Length of the pieces of the cut path.
    """

    axis: Axis
    kernel: Kernel
    interpolation: Interpolation
    cutting_force: Floats
    shaft_friction: Floats
    section: tuple[Points, Floats]
    lateral_stiffness: float
    spacing: float

    @cached_property
    def _piece_rule(self) -> tuple[Floats, Floats, Floats]:
        """Shares of the piece's length, offsets across it (m), and weights (sum 1) of points."""
        nodes, weights = np.polynomial.legendre.leggauss(PIECE_POINTS)
        across, across_weights = self.section
        share = np.repeat(0.5 * (nodes + 1.0), len(across))[:, None]
        offsets = np.tile(across @ self.axis.laterals, (PIECE_POINTS, 1))
        both = np.outer(weights, across_weights).ravel()
        return share, offsets, both / both.sum()

    @cached_property
    def _follower(self) -> Follower:
        """Means over the kernel and the piece; the kernel has as many points everywhere."""
        kernel, _ = self.kernel.quadrature(self.axis.entry)
        rows = np.repeat([0, 1], [len(kernel), len(self._piece_rule[0])])
        return Follower(self.interpolation, rows, 2)

    def tip(self, point: Vector) -> Weights:
        """Return the mean over the tip's kernel at a material point (one row)."""
        points, weights = self.kernel.quadrature(point)
        rows = np.zeros(len(points), dtype=np.intp)
        return self.interpolation.means(points, weights, rows, 1)

    def tip_and_piece(self, point: Vector, last: Vector) -> Weights:
        """Return the kernel's mean (row 0) and the mean over the piece behind it (row 1).

        Parameters
        ----------
        point, last : array, shape (dim,), m
            Material points at the tip now, and at the end of the newest piece.
        """
        points, weights = self.kernel.quadrature(point)
        share, offsets, piece_weights = self._piece_rule
        piece = share * (point - last) + last + offsets
        return self._follower.means(
            np.concatenate([points, piece]), np.concatenate([weights, piece_weights])
        )

    def cutting_force_at(self, weights: Weights) -> float:
        """Return the cutting force, averaged over the kernel (row 0), N (N/m in 2D)."""
        return float(weights.rows[0] @ self.cutting_force[weights.nodes])

    def friction_at(self, weights: Weights) -> float:
        """Return the friction limit, averaged over the piece (row 1), N/m (Pa in 2D)."""
        return float(weights.rows[1] @ self.shaft_friction[weights.nodes])
