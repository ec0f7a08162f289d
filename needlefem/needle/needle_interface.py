"""The needle in one tissue: tip kernel, insertion axis and contact functionals.

A point force has an unbounded displacement, so that all results would depend on the mesh size. The
tip force is therefore distributed over a disc (in 3D a ball) with the needle's radius, and the
displacement of the tip is the mean over the same disc, which is work-conjugate to the force. Both
are finite and converge under mesh refinement.
"""

import dataclasses
from functools import cached_property
from typing import Protocol

import numpy as np

from needlefem._arrays import Floats, Ints, Points, Vector
from needlefem.elements.shape_functions import gauss_legendre
from needlefem.fem.factorization import Lasting
from needlefem.fem.interpolation import Follower, Interpolation, LinearFunctionals, OutsideError


class Kernel(Protocol):
    """Distribution of the tip force over the tissue."""

    def rule(self, centre: Vector) -> tuple[Points, Floats]:
        """Return offsets from the centre, shape (n, dim), m, and weights, shape (n,).

        Where the rule does not depend on the centre (deep in the tissue), the same objects are
        returned each time.
        """
        ...

    def quadrature(self, centre: Vector) -> tuple[Points, Floats]:
        """Return points, shape (n, dim), m, and weights, shape (n,), with the sum 1."""
        ...


class PointKernel:
    """A point force, which does not converge under refinement; for verification only."""

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

    The rule is a product of a rule along the inward normal of the skin and one across it. If a
    part of the disc is outside of the skin, the rule covers the part inside, and the weights are
    renormalised. The points move smoothly with the centre, so that the result has no jumps there.

    Parameters
    ----------
    radius : float, m
    points : int
        Requested number of quadrature points; the nearest product rule is used.
    skin : array, shape (dim,), m
        A point of the skin. The skin is taken as plane within the needle's radius.
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
        """Return offsets and weights for the part of the unit disc above a height."""
        radius = self.radius
        height = low + 0.5 * (radius - low) * (1.0 + np.sin(self._angle))
        half = np.sqrt(np.maximum(radius**2 - height**2, 0.0))
        slab = self._along_weights * np.cos(self._angle) * half**self._power
        across = half[:, None, None] * (self._across @ self._plane)
        offsets = height[:, None, None] * self._inward + across
        weights = (slab[:, None] * self._across_weights).ravel()
        return offsets.reshape(-1, len(self._inward)), weights / weights.sum()


def cross_section(radius: float, points: int, dim: int) -> tuple[Points, Floats]:
    """Return a uniform rule over the cross-section of a shaft.

    Parameters
    ----------
    radius : float, m
    points : int
        Number of points of the tip kernel; the cross-section gets a similar resolution.
    dim : int
        Dimension of the space.

    Returns
    -------
    Offsets along the lateral directions, shape (n, dim - 1), m; weights with sum 1, shape (n,).
    """
    offsets, weights = _unit_ball_rule(dim - 1, _split(points, dim)[1])
    return radius * offsets, weights / weights.sum()


def _split(points: int, dim: int) -> tuple[int, int]:
    """Return the numbers of points along the normal of the skin and across it."""
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


@dataclasses.dataclass(frozen=True, eq=False)
class InsertionAxis:
    """The straight line ``entry + s direction`` of a rigid needle; s is the depth of the tip.

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

        They are made from the coordinate axes in their order. The coordinate axis that is closest
        to the needle direction is omitted.
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
        """Needle direction and lateral directions as rows, shape (dim, dim)."""
        return np.vstack([self.direction, self.lateral_directions])

    def tip_position(self, depth: float) -> Vector:
        """Return the position of the tip in space at a depth (m), shape (dim,), m."""
        return self.entry + depth * self.direction

    def lateral_offset(self, points: Points) -> Floats:
        """Return lateral coordinates of points relative to the line, shape (..., dim - 1), m."""
        offsets: Floats = (points - self.entry) @ self.lateral_directions.T
        return offsets

    def axial_coordinate(self, points: Points) -> Floats:
        """Return the axial coordinates of points, measured from the entry, shape (...,), m."""
        lengths: Floats = (points - self.entry) @ self.direction
        return lengths


ROUND_OFF = 1e-12
"""Distance outside of the skin that counts as zero, relative to the path spacing."""
SEGMENT_POINTS = 5
"""Gauss points along a contact segment. More have no effect for element sizes >= spacing / 3."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class NeedleInterface(Lasting):
    """Contact functionals of the needle in one tissue, with cutting force and friction.

    Parameters
    ----------
    axis : InsertionAxis
        The insertion axis.
    kernel : Kernel
        Distribution of the tip force.
    interpolation : Interpolation
        Interpolation of the tissue's displacement.
    cutting_force : array, shape (nnodes,), N (N/m in 2D)
        Nodal field of the axial force at which the tip cuts.
    shaft_friction : array, shape (nnodes,), N/m (Pa in 2D)
        Nodal field of the friction limit per length of cut path.
    section : (array, array)
        Offsets (n, dim - 1), m, and weights (n,) of a rule over the shaft's cross-section.
    lateral_penalty : float, Pa (N/m^3 in 2D)
        Stiffness of the lateral penalty per length of cut path.
    spacing : float, m
        Length of the contact segments.
    inward : array, shape (dim,)
        Unit normal of the skin at the entry that points into the tissue.
    """

    axis: InsertionAxis
    kernel: Kernel
    interpolation: Interpolation
    cutting_force: Floats
    shaft_friction: Floats
    section: tuple[Points, Floats]
    lateral_penalty: float
    spacing: float
    inward: Vector

    @cached_property
    def segment_rule(self) -> tuple[Floats, Floats, Floats]:
        """Points of a segment: shares of its length, offsets across it (m), weights (sum 1)."""
        nodes, weights = gauss_legendre(SEGMENT_POINTS)
        across, across_weights = self.section
        share = np.repeat(0.5 * (nodes + 1.0), len(across))[:, None]
        offsets = np.tile(across @ self.axis.lateral_directions, (SEGMENT_POINTS, 1))
        both = np.outer(weights, across_weights).ravel()
        return share, offsets, both / both.sum()

    @cached_property
    def _behind(self) -> "_TipSegmentFunctionals":
        return _TipSegmentFunctionals(self)

    def tip(self, point: Vector) -> LinearFunctionals:
        """Return the mean over the tip kernel at a material point as a functional (one row)."""
        points, weights = self.kernel.quadrature(point)
        rows = np.zeros(len(points), dtype=np.intp)
        return self.interpolation.means(points, weights, rows, 1)

    def tip_and_segment(self, point: Vector, last: Vector) -> LinearFunctionals:
        """Return the means over the tip kernel (row 0) and over the tip's segment (row 1).

        Parameters
        ----------
        point, last : array, shape (dim,), m
            Material points at the tip, and at the end of the last complete segment.
        """
        return self._behind.means(point, last)

    def resistance(self, weights: LinearFunctionals) -> tuple[float, float]:
        """Return the cutting force of row 0 and the friction limit of row 1 of functionals."""
        return self._behind.resistance(weights)

    def segments(self, vertices: Points) -> LinearFunctionals:
        """Return the means over the segments between the vertices of a path, shape (n, dim), m."""
        share, offsets, weights = self.segment_rule
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
        """Return the mean of the cutting force over the kernel (row 0), N (N/m in 2D)."""
        return float(weights.rows[0] @ self.cutting_force[weights.nodes])

    def friction_at(self, weights: LinearFunctionals) -> float:
        """Return the mean of the friction limit over the segment (row 1), N/m (Pa in 2D)."""
        return float(weights.rows[1] @ self.shaft_friction[weights.nodes])


class _TipSegmentFunctionals:
    """Functionals of the tip kernel and of the tip's segment; stores what all calls share."""

    def __init__(self, instrument: NeedleInterface) -> None:
        # no reference to the interface, which owns this object: both are freed together
        self._quadrature = instrument.kernel
        self._fields = (instrument.cutting_force, instrument.shaft_friction)
        share, self._segment_offsets, self._segment_weights = instrument.segment_rule
        self._kernel, _ = instrument.kernel.rule(instrument.axis.entry)
        count = len(self._kernel)  # the kernel has the same number of points at all centres
        self._share: Floats = np.concatenate([np.ones((count, 1)), share])
        self._offsets: Points = np.zeros((0, 0))
        self._weights: Floats = np.zeros(0)
        rows = np.repeat([0, 1], [count, len(share)])
        self._follower = Follower(instrument.interpolation, rows, 2)
        self._inward = instrument.inward
        self._heights = self._segment_offsets @ instrument.inward
        self._skin = float(instrument.inward @ instrument.axis.entry)
        self._wholly_inside = (
            self._skin - float(self._heights.min()) - ROUND_OFF * instrument.spacing
        )
        self._nodes: Ints | None = None
        self._resistances: Floats = np.zeros((0, 2))

    def means(self, point: Vector, last: Vector) -> LinearFunctionals:
        """See `NeedleInterface.tip_and_segment`."""
        kernel, weights = self._quadrature.rule(point)
        if kernel is not self._kernel or not self._weights.size:
            self._kernel = kernel
            self._offsets = np.concatenate([kernel, self._segment_offsets])
            self._weights = np.concatenate([weights, self._segment_weights])
        share, weights = self._share, self._weights
        height = float(self._inward @ last)
        if height < self._wholly_inside:
            share, weights = self._cut(point, last, height - self._skin)
        points = share * (point - last)
        points += last
        points += self._offsets
        return self._follower.means(points, weights)

    def _cut(self, point: Vector, last: Vector, under: float) -> tuple[Floats, Floats]:
        """Return shares and weights of points on the part of the segment inside of the tissue."""
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
    """Return the share of lines along a segment that lies outside of the skin.

    The quadrature rule covers the remaining part of each line and moves smoothly with the tip. If
    single points were omitted instead, the result would jump.

    Parameters
    ----------
    heights : array, m
        Depths of the beginnings of the lines below the skin.
    rise : array of a shape that broadcasts to it, or float, m
        Change of this depth along the segment.
    """
    outside, rising = np.maximum(-heights, 0.0), np.maximum(rise, np.finfo(float).tiny)
    found: Floats = np.minimum(outside / rising, 1.0)
    return found
