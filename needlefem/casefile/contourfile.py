"""Contours from CSV files."""

import csv
from pathlib import Path

import numpy as np

from needlefem.contour import Contour
from needlefem.errors import CaseError
from needlefem.units import UNITS


def read_contour(path: Path, key: str) -> Contour:
    """Read a contour: CSV, a header such as ``y [cm], z [cm]``, then a corner a line.

    Raises
    ------
    CaseError
        The file can't be read, has no units in its header, or a line that isn't two numbers.
    """
    try:
        rows = list(csv.reader(path.read_text(encoding="utf-8").splitlines()))
    except OSError:
        raise CaseError(key, f"can't read '{path}'", "give a CSV file beside the case") from None
    if not rows:
        raise CaseError(key, f"'{path}' is empty", "write a header and corners")
    factors = []
    for title in rows[0]:
        unit = title.partition("[")[2].partition("]")[0].strip()
        if unit not in UNITS["length"]:
            remedy = "write a header such as: y [cm], z [cm]"
            raise CaseError(key, f"no unit of length in the header {rows[0]}", remedy)
        factors.append(UNITS["length"][unit])
    points = []
    for number, row in enumerate(rows[1:], start=2):
        try:
            points.append([float(x) * f for x, f in zip(row, factors, strict=True)])
        except ValueError:
            problem = f"line {number} of '{path.name}' is {','.join(row)!r}"
            raise CaseError(key, problem, f"write {len(factors)} numbers") from None
    contour = Contour(np.array(points).reshape(-1, len(factors)))
    contour.check(key)
    return contour
