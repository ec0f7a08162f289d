"""The tip's kernel: the disc (ball) over which the tip's force is spread.

A point force has an unbounded displacement, so that every answer would drift with refinement.
Spread over a disc of the needle's own size, with the work-conjugate mean displacement over the
same disc, tip force and tip displacement are finite and converge.
"""

import dataclasses
from functools import cached_property
from typing import Protocol

import numpy as np

from needlefem._arrays import Floats, Ints, Points, Vector
from needlefem._pickling import Lasting
from needlefem.elements.shape_functions import gauss_legendre
from needlefem.fem.interpolation import Follower, Interpolation, LinearFunctionals, OutsideError


class Kernel(Protocol):
    """A way to spread the tip's force."""

    def rule(self, centre: Vector) -> tuple[Points, Floats]:
        """Return offsets from the centre, and weights, as `quadrature` does with points.

        Deep in the tissue, where they do not depend on the centre, always the same objects.
        """
        ...

    def quadrature(self, centre: Vector) -> tuple[Points, Floats]:
        """Return points, shape (n, dim), and weights, shape (n,), that sum to 1."""
        ...


class PointKernel:
    """A point force. It never converges under refinement and is kept to show just that."""

    def __init__(self, dim: int) -> None:
        self._point = np.zeros((1, dim)), np.ones(1)

    def rule(self, centre: Vector) -> tuple[Points, Floats]:  # noqa: ARG002
        """See `Kernel`."""
        return self._point

    def quadrature(self, centre: Vector) -> tuple[Points, Floats]:
        """See `Kernel`."""
        return centre[None], self._point[1]


# Kernel: mean over the disc (in 3D the ball) of the tip.
#     u(X) = (1 / |D|) integral over D(X) of u dV
# D(X)  disc of the needle's radius a around X, cut off at the skin, m^2 (m^3 in 3D)
# Force and displacement are conjugate: a force R on the tip is spread as R / |D| over D.
# Source: docs/theory.md, section on the needle.
class TipKernel:
    """A disc (2D) or ball (3D) of uniform weight, cut off at the skin.

    The rule is a product of one along the skin's inward normal and one across it. Where the
    disc reaches out of the skin only the part inside counts, renormalised; its points move
    smoothly with the centre, so that the needle's answer has no jumps there.

    Parameters
    ----------
    radius : float, m
    points : int
        Wanted number of quadrature points; the rule takes the nearest product.
    skin : array, shape (dim,), m
        A point of the skin, taken as plane within a radius of the needle.
    inward : array, shape (dim,)
        Unit normal of the skin that points into the tissue.
    """

    def __init__(self, radius: float, points: int, skin: Vector, inward: Vector) -> None:
        self.radius, self._skin, self._inward = radius, skin, inward
        dim = len(inward)
        along, across = _split(points, dim)
        nodes, self._along_weights = gauss_legendre(along)
        self._angle = 0.5 * np.pi * nodes
        self._across, self._across_weights = _unit_ball_rule(dim - 1, across)
        self._plane = np.linalg.svd(inward[None])[2][1:]
        self._power = dim - 1
        self._whole = self._rule(-radius)

    def rule(self, centre: Vector) -> tuple[Points, Floats]:
        """See `Kernel`."""
        under = float(self._inward @ (centre - self._skin))
        return self._whole if under >= self.radius else self._rule(-under)

    def quadrature(self, centre: Vector) -> tuple[Points, Floats]:
        """See `Kernel`."""
        offsets, weights = self.rule(centre)
        return centre + offsets, weights

    def _rule(self, low: float) -> tuple[Points, Floats]:
        """Return offsets from the centre, and weights, of the disc above a height in it."""
        radius = self.radius
        height = low + 0.5 * (radius - low) * (1.0 + np.sin(self._angle))
        half = np.sqrt(np.maximum(radius**2 - height**2, 0.0))
        slab = self._along_weights * np.cos(self._angle) * half**self._power
        across = half[:, None, None] * (self._across @ self._plane)
        offsets = height[:, None, None] * self._inward + across
        weights = (slab[:, None] * self._across_weights).ravel()
        return offsets.reshape(-1, len(self._inward)), weights / weights.sum()


def cross_section(radius: float, points: int, dim: int) -> tuple[Points, Floats]:
    """Return a rule over a shaft's cross-section, uniform; weights sum to 1.

    Parameters
    ----------
    radius : float, m
    points : int
        Points of the tip's kernel; the section is resolved as the kernel is.
    dim : int
        Dimensions of the space.

    Returns
    -------
    Offsets along the needle's lateral directions, shape (n, dim - 1), m, and weights, shape (n,).
    """
    offsets, weights = _unit_ball_rule(dim - 1, _split(points, dim)[1])
    return radius * offsets, weights / weights.sum()


def _split(points: int, dim: int) -> tuple[int, int]:
    """Return how many points go along the skin's normal, and how many across it."""
    along = max(2, round((1.5 ** (dim - 1) * points) ** (1.0 / dim)))
    return along, max(1, round((points / along) ** (1.0 / (dim - 1))))


def _unit_ball_rule(dim: int, n: int) -> tuple[Points, Floats]:
    """Return a rule on the unit interval [-1, 1] (dim 1, n points) or disc (dim 2, n x 2n)."""
    nodes, weights = gauss_legendre(n)
    if dim == 1:
        return nodes[:, None], weights
    radius = np.sqrt(0.5 * (1.0 + nodes))
    turn = 2.0 * np.pi * (np.arange(2 * n) + 0.5) / (2 * n)
    circle = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    points = radius[:, None, None] * circle
    return points.reshape(-1, 2), np.repeat(weights, 2 * n)


# The straight line on which a rigid needle moves.


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


# A needle on its line in one tissue: what it touches there and what resists it.


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
