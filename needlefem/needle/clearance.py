"""How near a straight needle comes to what it must not touch.

The needle is taken for the half-line behind its tip: all of the straight path to the release, and
what of the needle is still outside. Obstacles are fixed in space, so that all of this is exact
geometry.
"""

import dataclasses
from collections.abc import Mapping
from typing import Protocol

import numpy as np

from needlefem._arrays import Floats, Vector
from needlefem.geometry.contour import Contour
from needlefem.needle.needle_interface import InsertionAxis

EDGE = 1e-9
"""Distance by which a needle at the edge of what is allowed may come too near by round-off, m."""

Interval = tuple[float, float]


@dataclasses.dataclass(frozen=True)
class Passing:
    """How a needle passes an obstacle.

    Parameters
    ----------
    obstacle : str
    distance : float, m
        Between the needle's line and the obstacle; 0 where it goes through.
    clearance : float, m
        Least distance that is allowed.
    """

    obstacle: str
    distance: float
    clearance: float

    @property
    def allowed(self) -> bool:
        """Whether the needle keeps its distance."""
        return self.distance >= self.clearance - EDGE

    def __str__(self) -> str:
        away = f"passes {100.0 * self.distance:.3g} cm from" if self.distance else "goes through"
        return f"{away} '{self.obstacle}' (clearance {100.0 * self.clearance:.3g} cm)"


class HasClearance(Protocol):
    """What a needle has to keep away from: a filled contour and the least distance, m."""

    @property
    def contour(self) -> Contour:
        """Its outline, fixed in space."""
        ...

    @property
    def clearance(self) -> float:
        """Least distance of the needle's line, m."""
        ...


def passings(
    obstacles: Mapping[str, HasClearance], axis: InsertionAxis, depth: float
) -> tuple[Passing, ...]:
    """Return how a needle with its tip at a depth (m) passes obstacles, by their names."""
    return tuple(
        Passing(name, distance(axis, depth, obstacle.contour), obstacle.clearance)
        for name, obstacle in obstacles.items()
    )


def distance(axis: InsertionAxis, depth: float, contour: Contour) -> float:
    """Return the distance of a needle with its tip at a depth to a filled contour, m."""
    tip: Vector = axis.tip_position(depth)
    if contour.contains(tip[None])[0]:
        return 0.0
    low, high = _laterals_behind(axis, depth, contour)
    beside = np.where((low <= 0.0) & (high >= 0.0), 0.0, np.minimum(abs(low), abs(high)))
    return float(np.min(beside, initial=contour.distance(tip[None])[0]))


def blocked(
    axis: InsertionAxis, depth: float, contour: Contour, clearance: float
) -> list[Interval]:
    """Return the lateral positions at which a needle comes too near a filled contour.

    Parameters
    ----------
    axis : InsertionAxis
        Of a needle at position 0; others are parallel.
    depth : float, m
        Of the tips along this axis.
    contour : Contour
    clearance : float, m

    Returns
    -------
    Open intervals in rising order that do not overlap, m.
    """
    low, high = _laterals_behind(axis, depth, contour)
    low_tip, high_tip = _laterals_about_tip(axis, depth, contour, clearance)
    starts = np.concatenate([low - clearance, low_tip])
    ends = np.concatenate([high + clearance, high_tip])
    return merged(list(zip(starts.tolist(), ends.tolist(), strict=True)))


def merged(intervals: list[Interval]) -> list[Interval]:
    """Return the union of intervals, in rising order."""
    found: list[Interval] = []
    for low, high in sorted(intervals):
        if found and low <= found[-1][1]:
            found[-1] = (found[-1][0], max(found[-1][1], high))
        else:
            found.append((low, high))
    return found


def gaps(low: float, high: float, taken: list[Interval]) -> list[Interval]:
    """Return what sorted, disjoint intervals leave of the interval from `low` to `high`."""
    found = []
    for start, end in [*taken, (high, high)]:
        if min(start, high) > low:
            found.append((low, min(start, high)))
        low = max(low, end)
    return found


def _edges(axis: InsertionAxis, contour: Contour) -> tuple[Floats, Floats, Floats, Floats]:
    """Return along and lateral coordinates of all edges' ends, the one behind first."""
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
    """Return the lateral ranges of the edges' parts that are not ahead of the tip."""
    along, lateral, end_along, end_lateral = _edges(axis, contour)
    rise = end_along - along
    share = np.where(rise > 0.0, (depth - along) / np.where(rise > 0.0, rise, 1.0), 1.0)
    last = lateral + np.clip(share, 0.0, 1.0) * (end_lateral - lateral)
    both = np.stack([lateral, last])[:, along <= depth]
    return both.min(axis=0), both.max(axis=0)


def _laterals_about_tip(
    axis: InsertionAxis, depth: float, contour: Contour, clearance: float
) -> tuple[Floats, Floats]:
    """Return the lateral ranges in which the tip is within the clearance of each edge.

    The farthest tip on a side touches the edge where a circle around the tip is tangent to it, or
    else at the end nearest to that place.
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
