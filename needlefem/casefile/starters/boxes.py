"""Boxes of tissue around contours."""

import dataclasses
from collections.abc import Mapping

import numpy as np

from needlefem.arrays import Floats, Vector
from needlefem.casefile.starters.draft import listed, millimetres, point_text
from needlefem.contour import Contour

TIP_RADIUS = 1.27e-3
HALVINGS = 3
"""From the corridor's elements to the squares before refinement: sides that halving ends at."""
MOST_SQUARES = 32
"""Along the longer side of the box; a larger one gets coarser squares."""
ACROSS = 12.0
"""Elements along the side of a square of the smallest region's area."""
LARGEST = 3e-3
"""Largest size along a contour, m."""
CORRIDOR = 4.0
"""Width of the refined corridor, tip radii."""
WHOLE = 1e-3
"""Boxes are whole millimetres."""


@dataclasses.dataclass(frozen=True, eq=False)
class Box:
    """The tissue around regions: smallest and largest coordinates, shape (2,), m."""

    low: Floats
    high: Floats

    def depth_of(self, point: Vector, direction: Vector) -> float:
        """Return how far a point is from where a line through it enters the box, m."""
        with np.errstate(divide="ignore"):
            back = np.where(direction > 0, point - self.low, point - self.high) / direction
        return float(np.min(back[direction != 0]))


def box_around(contours: Mapping[str, Contour], margin: float, *points: Vector) -> Box:
    """Return the box around contours and points, with a margin, in whole millimetres."""
    rows = np.vstack([*(c.points for c in contours.values()), *(np.atleast_2d(p) for p in points)])
    low = WHOLE * np.floor((rows.min(axis=0) - margin) / WHOLE)
    high = WHOLE * np.ceil((rows.max(axis=0) + margin) / WHOLE)
    return Box(low, high)


def mesh_text(box: Box, contours: Mapping[str, Contour], finest: float, depth: float) -> str:
    """Return the [mesh] tables of a box refined at its contours and along the needle.

    Parameters
    ----------
    box : Box
    contours : mapping of names to Contour
    finest : float, m
        Smallest size worth having along a contour: a voxel.
    depth : float, m
        Of the corridor; 0 for that of the motion.
    """
    size = box.high - box.low
    square = 0.5 * TIP_RADIUS * 2.0**HALVINGS
    while size.max() > MOST_SQUARES * square:
        square *= 2.0
    divisions = np.maximum(2, np.ceil(size / square)).astype(int)
    along = contour_size(contours, finest)
    gap = smallest_gap(contours)
    fitted = gap > 2.0 * along
    why = "cells end at the contours" if fitted else (
        f"contours come as near as {1e3 * gap:.2g} mm: cells by their centroid"
    )  # fmt: skip
    interfaces = "fitted" if fitted else "centroid"
    lines = [
        "[mesh]",
        f"origin = {point_text(box.low)}",
        f"size = {point_text(size)}",
        f"divisions = {listed(str(n) for n in divisions)}",
        f'interfaces = "{interfaces}"          # {why}',
        "",
        "[mesh.refine]",
        f"contour_size = {millimetres(along, 3)}",
        f"corridor_size = {millimetres(0.5 * TIP_RADIUS, 3)}",
        f"corridor_width = {millimetres(CORRIDOR * TIP_RADIUS, 3)}",
    ]
    return "\n".join(lines + ([f"corridor_depth = {millimetres(depth)}"] if depth else []))


def contour_size(contours: Mapping[str, Contour], finest: float) -> float:
    """Return the element size along contours, m."""
    side = min(float(np.sqrt(contour.area)) for contour in contours.values())
    wanted = float(np.clip(side / ACROSS, finest, max(finest, LARGEST)))
    steps = np.floor(2.0 * np.log2(wanted / (0.5 * TIP_RADIUS)))
    return float(0.5 * TIP_RADIUS * 2.0 ** (0.5 * steps))  # bisection ends at such sizes


def smallest_gap(contours: Mapping[str, Contour]) -> float:
    """Return the smallest distance between two contours, m; infinity for a single one."""
    found, known = np.inf, list(contours.values())
    for number, one in enumerate(known):
        for other in known[:number]:
            found = min(found, one.distance(other.points).min(), other.distance(one.points).min())
    return float(found)
