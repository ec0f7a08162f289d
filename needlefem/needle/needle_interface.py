"""A needle on its line in one tissue: what it touches there and what resists it."""

import dataclasses
from functools import cached_property

import numpy as np

from needlefem._arrays import Floats, Ints, Points, Vector
from needlefem._pickling import Lasting
from needlefem.elements.shape_functions import gauss_legendre
from needlefem.fem.interpolation import Follower, Interpolation, LinearFunctionals, OutsideError
from needlefem.needle.insertion_axis import InsertionAxis
from needlefem.needle.tip_kernel import Kernel

ROUND_OFF = 1e-12
"""Distance outside the skin, relative to the spacing, that is none."""
PIECE_POINTS = 5
"""Gauss points on a piece of the cut path; more change nothing at h >= spacing / 3."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class NeedleInterface(Lasting):
    """All that contact needs to know of the needle.

    Parameters
    ----------
    axis : InsertionAxis
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
    inward : array, shape (dim,)
        Unit normal of the skin at the entry that points into the tissue.
    """

    axis: InsertionAxis
    kernel: Kernel
    interpolation: Interpolation
    cutting_force: Floats
    shaft_friction: Floats
    section: tuple[Points, Floats]
    lateral_stiffness: float
    spacing: float
    inward: Vector

    @cached_property
    def piece_rule(self) -> tuple[Floats, Floats, Floats]:
        """Shares of the piece's length, offsets across it (m), and weights (sum 1) of points."""
        nodes, weights = gauss_legendre(PIECE_POINTS)
        across, across_weights = self.section
        share = np.repeat(0.5 * (nodes + 1.0), len(across))[:, None]
        offsets = np.tile(across @ self.axis.lateral_directions, (PIECE_POINTS, 1))
        both = np.outer(weights, across_weights).ravel()
        return share, offsets, both / both.sum()

    @cached_property
    def _behind(self) -> "_TipSegmentFunctionals":
        return _TipSegmentFunctionals(self)

    def tip(self, point: Vector) -> LinearFunctionals:
        """Return the mean over the tip's kernel at a material point (one row)."""
        points, weights = self.kernel.quadrature(point)
        rows = np.zeros(len(points), dtype=np.intp)
        return self.interpolation.means(points, weights, rows, 1)

    def tip_and_piece(self, point: Vector, last: Vector) -> LinearFunctionals:
        """Return the kernel's mean (row 0) and the mean over the piece behind it (row 1).

        Parameters
        ----------
        point, last : array, shape (dim,), m
            Material points at the tip now, and at the end of the newest piece.
        """
        return self._behind.means(point, last)

    def resistance(self, weights: LinearFunctionals) -> tuple[float, float]:
        """Return cutting force (of row 0) and friction limit (of row 1) of functionals."""
        return self._behind.resistance(weights)

    def pieces(self, vertices: Points) -> LinearFunctionals:
        """Return the means over the pieces of a path between its vertices, shape (n, dim), m."""
        share, offsets, weights = self.piece_rule
        ahead = np.diff(vertices, axis=0)[:, None]
        under = (vertices[:-1] - self.axis.entry) @ self.inward
        heights = under[:, None] + offsets @ self.inward
        heights[heights >= -ROUND_OFF * self.spacing] = 0.0
        low = _share_outside(heights, ahead @ self.inward)
        share = low[..., None] + (1.0 - low[..., None]) * share
        points = (vertices[:-1, None] + share * ahead + offsets).reshape(-1, vertices.shape[1])
        rows = np.repeat(np.arange(len(ahead)), len(weights))
        return self.interpolation.means(points, ((1.0 - low) * weights).ravel(), rows, len(ahead))

    def cutting_force_at(self, weights: LinearFunctionals) -> float:
        """Return the cutting force, averaged over the kernel (row 0), N (N/m in 2D)."""
        return float(weights.rows[0] @ self.cutting_force[weights.nodes])

    def friction_at(self, weights: LinearFunctionals) -> float:
        """Return the friction limit, averaged over the piece (row 1), N/m (Pa in 2D)."""
        return float(weights.rows[1] @ self.shaft_friction[weights.nodes])


class _TipSegmentFunctionals:
    """The tip's kernel and the piece behind it, with what stays the same from call to call."""

    def __init__(self, instrument: NeedleInterface) -> None:
        # no reference to the instrument, which keeps this: both are freed together
        self._quadrature = instrument.kernel
        self._fields = (instrument.cutting_force, instrument.shaft_friction)
        share, self._piece_offsets, self._piece_weights = instrument.piece_rule
        self._kernel, _ = instrument.kernel.rule(instrument.axis.entry)
        count = len(self._kernel)  # the kernel has as many points everywhere
        self._share: Floats = np.concatenate([np.ones((count, 1)), share])
        self._offsets: Points = np.zeros((0, 0))
        self._weights: Floats = np.zeros(0)
        rows = np.repeat([0, 1], [count, len(share)])
        self._follower = Follower(instrument.interpolation, rows, 2)
        self._inward = instrument.inward
        self._heights = self._piece_offsets @ instrument.inward
        self._skin = float(instrument.inward @ instrument.axis.entry)
        self._wholly_inside = (
            self._skin - float(self._heights.min()) - ROUND_OFF * instrument.spacing
        )
        self._nodes: Ints | None = None
        self._resistances: Floats = np.zeros((0, 2))

    def means(self, point: Vector, last: Vector) -> LinearFunctionals:
        """See `NeedleInterface.tip_and_piece`."""
        kernel, weights = self._quadrature.rule(point)
        if kernel is not self._kernel or not self._weights.size:
            self._kernel = kernel
            self._offsets = np.concatenate([kernel, self._piece_offsets])
            self._weights = np.concatenate([weights, self._piece_weights])
        share, weights = self._share, self._weights
        height = float(self._inward @ last)
        if height < self._wholly_inside:
            share, weights = self._cut(point, last, height - self._skin)
        points = share * (point - last)
        points += last
        points += self._offsets
        return self._follower.means(points, weights)

    def _cut(self, point: Vector, last: Vector, under: float) -> tuple[Floats, Floats]:
        """Return shares and weights of points on the part of the piece that is in the tissue."""
        count = len(self._share) - len(self._heights)
        rise = float(self._inward @ (point - last))
        low = _share_outside(under + self._heights, rise)
        share, weights = self._share.copy(), self._weights.copy()
        share[count:, 0] = low + (1.0 - low) * share[count:, 0]
        weights[count:] *= 1.0 - low
        total = float(weights[count:].sum())
        if total <= 0.0:
            raise OutsideError
        weights[count:] /= total
        return share, weights

    def resistance(self, weights: LinearFunctionals) -> tuple[float, float]:
        """See `NeedleInterface`."""
        if weights.nodes is not self._nodes:
            self._nodes = weights.nodes
            self._resistances = np.column_stack([field[self._nodes] for field in self._fields])
        found = weights.rows @ self._resistances
        return float(found[0, 0]), float(found[1, 1])


def _share_outside(heights: Floats, rise: Floats | float) -> Floats:
    """Return which part of lines along a piece lies outside the skin.

    A quadrature rule over the rest of every line moves smoothly with the tip, where points that
    are left out one by one would make the needle's answer jump.

    Parameters
    ----------
    heights : array, m
        Of the lines' beginnings in the tissue, from the skin on.
    rise : array of a shape that broadcasts to it, or float, m
        Of the piece, in the same direction.
    """
    outside, rising = np.maximum(-heights, 0.0), np.maximum(rise, np.finfo(float).tiny)
    found: Floats = np.minimum(outside / rising, 1.0)
    return found
