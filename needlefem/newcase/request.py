"""What ``needlefem new`` is told beside the file."""

import dataclasses

import numpy as np

from needlefem._arrays import Vector
from needlefem.errors import CaseError
from needlefem.units import parse_quantity

FARTHEST = 100.0
"""Largest coordinate of a point, m."""
WIDEST = 1.0
"""Widest margin around the regions, m."""
LENGTHS = (1e-9, 1e9)
"""Range of the largest component of a direction: what is beyond is no direction but a mistake."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class CaseRequest:
    """The needle and the tissue around, as texts; empty where nothing is said.

    Parameters
    ----------
    target, entry : str
        Points, such as ``"12, -3.5, 40 mm"``; `target` may name a segment: its centre.
    direction, across : str
        Directions, such as ``"0, 0.2, 1"``.
    space : str
        Of the scanner's coordinates: ``LPS`` or ``RAS``.
    segments : str
        Names of those to take, separated by commas; all when empty.
    margin : str
        Tissue around the regions, a length.
    unit : str
        Length of one unit of the coordinates in a mesh file, or in contours without units.
    """

    target: str = ""
    entry: str = ""
    direction: str = ""
    across: str = ""
    space: str = "LPS"
    segments: str = ""
    margin: str = "15 mm"
    unit: str = ""

    @property
    def around(self) -> float:
        """The margin, m."""
        found = parse_quantity(self.margin, "length", "--margin")
        if not 0.0 < found <= WIDEST:
            remedy = f"give a length above 0 and up to {WIDEST:g} m"
            raise CaseError("--margin", f"'{self.margin}' is no margin", remedy)
        return found


def point_of(text: str, dim: int, key: str) -> Vector:
    """Return a point from a text such as ``"12, -3.5, 40 mm"``, shape (dim,), m.

    Raises
    ------
    CaseError
        Not as many numbers as axes, or no unit of length.
    """
    *first, last = text.split(",")
    _, _, unit = last.strip().partition(" ")
    example = ", ".join("12.5" for _ in range(dim))
    if len(first) + 1 != dim or not unit:
        problem = f"'{text}' is no point" if unit else f"'{text}' has no unit"
        raise CaseError(key, problem, f"write {dim} numbers and a unit: '{example} mm'")
    texts = [*(f"{number.strip()} {unit}" for number in first), last.strip()]
    found = np.array([parse_quantity(one, "length", key) for one in texts])
    if not np.all(np.abs(found) <= FARTHEST):
        remedy = f"give coordinates of at most {FARTHEST:g} m"
        raise CaseError(key, f"'{text}' is no point of a body", remedy)
    return found


def direction_of(text: str, dim: int, key: str) -> Vector:
    """Return a unit vector from a text such as ``"0, 0.2, 1"``, shape (dim,)."""
    try:
        found = np.array([float(part) for part in text.split(",")])
    except ValueError:
        found = np.empty(0)
    largest = float(np.abs(found).max(initial=0.0))
    if len(found) != dim or not LENGTHS[0] <= largest <= LENGTHS[1]:
        remedy = f"write {dim} plain numbers, not all zero, separated by commas"
        raise CaseError(key, f"'{text}' is no direction", remedy)
    unit: Vector = found / np.linalg.norm(found)
    return unit
