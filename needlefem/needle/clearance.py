"""Distances between a straight needle and obstacles.

The needle is represented by the half-line behind its tip. This contains the straight path to the
release point and the part of the needle outside of the tissue. Obstacles are fixed in space, so
that all distances follow from exact geometry.
"""

import dataclasses
from collections.abc import Mapping
from typing import Protocol

import numpy as np

from needlefem._arrays import Floats, Vector
from needlefem.geometry.contour import Contour
from needlefem.needle.needle_interface import InsertionAxis

EDGE = 1e-9
"""Tolerance for round-off in the comparison of a distance with the clearance, m."""

Interval = tuple[float, float]
"""An interval of offsets, from its lower to its upper end, m."""


@dataclasses.dataclass(frozen=True)
class Passing:
    """Distance between the needle and one obstacle.

    Parameters
    ----------
    obstacle : str
    distance : float, m
        Between the needle's line and the obstacle; 0 if the line intersects the obstacle.
    clearance : float, m
        Smallest allowed distance.
    """

    obstacle: str
    distance: float
    clearance: float

    @property
    def allowed(self) -> bool:
        """Whether the distance is at least the clearance."""
        return self.distance >= self.clearance - EDGE

    def __str__(self) -> str:
        away = f"passes {100.0 * self.distance:.3g} cm from" if self.distance else "goes through"
        return f"{away} '{self.obstacle}' (clearance {100.0 * self.clearance:.3g} cm)"


class HasClearance(Protocol):
    """An obstacle: a filled contour and the smallest allowed distance to it, m."""

    @property
    def contour(self) -> Contour:
        """Outline of the obstacle, fixed in space."""
        ...

    @property
    def clearance(self) -> float:
        """Smallest allowed distance between the needle's line and the contour, m."""
        ...


def passings(
    obstacles: Mapping[str, HasClearance], axis: InsertionAxis, depth: float
) -> tuple[Passing, ...]:
    """Return the distances to all obstacles, by their names, for a tip at a depth (m)."""
    return tuple(
        Passing(name, distance(axis, depth, obstacle.contour), obstacle.clearance)
        for name, obstacle in obstacles.items()
    )


def distance(axis: InsertionAxis, depth: float, contour: Contour) -> float:
    """Return the distance, m, between a filled contour and a needle with its tip at a depth, m."""
    tip: Vector = axis.tip_position(depth)
    if contour.contains(tip[None])[0]:
        return 0.0
    low, high = _laterals_behind(axis, depth, contour)
    beside = np.where((low <= 0.0) & (high >= 0.0), 0.0, np.minimum(abs(low), abs(high)))
    return float(np.min(beside, initial=contour.distance(tip[None])[0]))


def blocked(
    axis: InsertionAxis, depth: float, contour: Contour, clearance: float
) -> list[Interval]:
    """Return the lateral offsets at which a needle is closer to a contour than the clearance.

    Parameters
    ----------
    axis : InsertionAxis
        Axis of a needle at lateral offset 0; the other needles are parallel to it.
    depth : float, m
        Depth of the tips along this axis.
    contour : Contour
    clearance : float, m

    Returns
    -------
    Disjoint open intervals of lateral offsets in rising order, m.
    """
    low, high = _laterals_behind(axis, depth, contour)
    low_tip, high_tip = _laterals_about_tip(axis, depth, contour, clearance)
    starts = np.concatenate([low - clearance, low_tip])
    ends = np.concatenate([high + clearance, high_tip])
    return merged(list(zip(starts.tolist(), ends.tolist(), strict=True)))


def merged(intervals: list[Interval]) -> list[Interval]:
    """Return the union of intervals in rising order."""
    found: list[Interval] = []
    for low, high in sorted(intervals):
        if found and low <= found[-1][1]:
            found[-1] = (found[-1][0], max(found[-1][1], high))
        else:
            found.append((low, high))
    return found


def gaps(low: float, high: float, taken: list[Interval]) -> list[Interval]:
    """Return the parts of an interval [`low`, `high`] outside of sorted disjoint intervals."""
    found = []
    for start, end in [*taken, (high, high)]:
        if min(start, high) > low:
            found.append((low, min(start, high)))
        low = max(low, end)
    return found


def _edges(axis: InsertionAxis, contour: Contour) -> tuple[Floats, Floats, Floats, Floats]:
    """Return axial and lateral coordinates of the ends of all edges; the shallower end first."""
    along, lateral = (
        axis.axial_coordinate(contour.points),
        axis.lateral_offset(contour.points)[:, 0],
    )
    next_along, next_lateral = np.roll(along, -1), np.roll(lateral, -1)
    forward = along <= next_along
    return (
        np.where(forward, along, next_along),
        np.where(forward, lateral, next_lateral),
        np.where(forward, next_along, along),
        np.where(forward, next_lateral, lateral),
    )


def _laterals_behind(axis: InsertionAxis, depth: float, contour: Contour) -> tuple[Floats, Floats]:
    """Return the lateral ranges of the parts of the edges that are not deeper than the tip."""
    along, lateral, end_along, end_lateral = _edges(axis, contour)
    rise = end_along - along
    share = np.where(rise > 0.0, (depth - along) / np.where(rise > 0.0, rise, 1.0), 1.0)
    last = lateral + np.clip(share, 0.0, 1.0) * (end_lateral - lateral)
    both = np.stack([lateral, last])[:, along <= depth]
    return both.min(axis=0), both.max(axis=0)


def _laterals_about_tip(
    axis: InsertionAxis, depth: float, contour: Contour, clearance: float
) -> tuple[Floats, Floats]:
    """Return the lateral ranges in which the tip is closer to each edge than the clearance.

    The extreme tip position on either side is where a circle around the tip is tangent to the
    edge, or otherwise the position opposite to the nearer end of the edge.
    """
    along, lateral, end_along, end_lateral = _edges(axis, contour)
    rise, across = end_along - along, end_lateral - lateral
    slope = across / np.maximum(np.hypot(rise, across), 1e-300)
    found = []
    for side in (-1.0, 1.0):
        touching = (depth + side * clearance * slope - along) / np.where(rise > 0.0, rise, 1.0)
        share = np.where(rise > 0.0, np.clip(touching, 0.0, 1.0), side * across > 0.0)
        at_along, at_lateral = along + share * rise, lateral + share * across
        reach = np.sqrt(np.maximum(clearance**2 - (at_along - depth) ** 2, 0.0))
        found.append(at_lateral + side * reach)
    near = (along - depth < clearance) & (depth - end_along < clearance)
    return found[0][near], found[1][near]
