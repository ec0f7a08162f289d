"""What ``needlefem new`` is told beside the file."""

import dataclasses

import numpy as np

from needlefem.arrays import Vector
from needlefem.errors import CaseError
from needlefem.units import parse_quantity


@dataclasses.dataclass(frozen=True, kw_only=True)
class Wanted:
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
        if not found > 0.0:
            raise CaseError("--margin", f"'{self.margin}' is no margin", "give a positive length")
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
    return np.array([parse_quantity(f"{n.strip()} {unit}", "length", key) for n in first] + [
        parse_quantity(last.strip(), "length", key)])  # fmt: skip


def direction_of(text: str, dim: int, key: str) -> Vector:
    """Return a unit vector from a text such as ``"0, 0.2, 1"``, shape (dim,)."""
    try:
        found = np.array([float(part) for part in text.split(",")])
    except ValueError:
        found = np.empty(0)
    if len(found) != dim or not np.all(np.isfinite(found)) or not np.any(found):
        remedy = f"write {dim} numbers, not all zero, separated by commas"
        raise CaseError(key, f"'{text}' is no direction", remedy)
    unit: Vector = found / np.linalg.norm(found)
    return unit
