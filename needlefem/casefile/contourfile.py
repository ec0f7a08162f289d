"""Contours from CSV files: columns by name and unit of the header.

A header such as ``y [mm], z [mm]`` names the axes of the case, in any order; also ``y (mm)``,
``y/mm`` and ``y_mm``. A file without a header has the axes of the case in their order and needs the
key `unit`. Columns are separated by commas, tabs or semicolons. A comma is a decimal sign only if
semicolons separate the columns. Ambiguous files are refused.
"""

import csv
import dataclasses
import math
import re
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from needlefem._arrays import Floats
from needlefem._inputfile import read_text
from needlefem.errors import CaseError, nearest
from needlefem.geometry.contour import Contour
from needlefem.units import UNITS

LENGTHS = UNITS["length"] | {"\u00b5m": 1e-6, "\u03bcm": 1e-6}
"""Units of length in a header, m."""
COMMENTS = ("#", "%", "//")
"""Beginnings of lines that are left out."""
LONGEST_LINE = 2_000
"""Characters of a line; a corner has a few dozen."""
SHOWN = 40
"""Characters of a value that a message repeats."""
NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?", re.ASCII)
BRACKETS = re.compile(r"(?P<name>[^\[\](){}]*?)\s*(\[(?P<square>[^\[\]]*)\]|\((?P<round>[^()]*)\))")
SUFFIX = re.compile(rf"(?P<name>.+?)(\s*/\s*|\s+in\s+|\s+|_)(?P<unit>{'|'.join(LENGTHS)})")
PLAIN = "write numbers such as 12.5 between commas"
HEADER = "write a header such as: y [mm], z [mm]"


@dataclasses.dataclass(frozen=True)
class Column:
    """A column of a contour file: name and factor to metres, None where the file says neither."""

    name: str | None
    factor: float | None


@dataclasses.dataclass(frozen=True, eq=False)
class ContourTable:
    """What a contour file says.

    Parameters
    ----------
    file : str
        Its name, for messages.
    columns : tuple of Column
    values : array, shape (n, ncolumns)
        In the file's units.
    lines : tuple of int
        Number of every corner's line.
    """

    file: str
    columns: tuple[Column, ...]
    values: Floats
    lines: tuple[int, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns; empty where they have none."""
        return tuple(column.name for column in self.columns if column.name is not None)

    def contour(self, key: str, axes: Sequence[str] | None, unit: float | None) -> Contour:
        """Return the contour with its coordinates in the order of some axes.

        Parameters
        ----------
        key : str
            For messages.
        axes : sequence of str, optional
            The case's; the columns' own order when left out.
        unit : float, m, optional
            Length of one unit of the file's numbers, where the header names none.

        Raises
        ------
        CaseError
            Columns that are not the axes', no unit or two that differ, corners that repeat, or
            an outline that crosses itself.
        """
        dim = 2 if axes is None else len(axes)
        if len(self.columns) != dim:
            names = f" ({', '.join(self.names)})" if self.names else ""
            problem = f"'{self.file}' has {_columns(len(self.columns))}{names}"
            said = "" if axes is None else f", for the axes {', '.join(axes)}"
            remedy = f"give {_columns(dim)}{said}; a decimal sign is a point"
            raise CaseError(key, problem, remedy)
        order = self._order(key, axes)
        factors = np.array([self._factor(column, key, unit) for column in self.columns])
        points = (self.values * factors)[:, order] + 0.0  # no negative zeros
        return _checked(points, self.lines, self.file, key)

    def _order(self, key: str, axes: Sequence[str] | None) -> list[int]:
        """Return the number of every axis' column."""
        names = self.names
        if not names or axes is None:
            return list(range(len(self.columns)))
        for name in names:
            if name not in axes:
                problem = f"'{self.file}' names '{_short(name)}', which is not an axis"
                raise CaseError(key, problem, nearest(name, axes))
        return [names.index(axis) for axis in axes]

    def _factor(self, column: Column, key: str, unit: float | None) -> float:
        if column.factor is None and unit is None:
            remedy = f'{HEADER}, or give unit = "1 mm"'
            raise CaseError(key, f"no unit of length in the header of '{self.file}'", remedy)
        if column.factor is None or unit is None:
            return column.factor or unit or math.nan
        if not math.isclose(column.factor, unit):
            problem = f"the header of '{self.file}' says {column.factor:g} m, unit {unit:g} m"
            raise CaseError(key, problem, "leave one of them out")
        return column.factor


def read_contour(
    path: Path, key: str, axes: Sequence[str] | None = None, unit: float | None = None
) -> Contour:
    """Read a contour from a CSV file; see `ContourTable.contour` for parameters and errors."""
    return read_table(path, key).contour(key, axes, unit)


def read_table(path: Path, key: str) -> ContourTable:
    """Read the columns of a contour file: a header, if there is one, and a corner a line.

    Raises
    ------
    CaseError
        The file can't be read, has no corners, a header that is not understood, or a line that
        is not as many numbers as there are columns.
    """
    text = read_text(path, key, remedy="give a CSV file beside the case")
    reader = _LineReader(path.name, key)
    lines = [(n, line.strip(" ")) for n, line in enumerate(text.split("\n"), 1)]
    used = [(n, line) for n, line in lines if line.strip() and not line.startswith(COMMENTS)]
    if not used:
        raise CaseError(key, f"'{path.name}' is empty", "write a header and corners")
    reader.separator = _separator(used[0][1])
    rows = [(n, reader.cells(n, line)) for n, line in used]
    rows = [(n, cells) for n, cells in rows if cells]  # a table's empty last rows are commas alone
    columns: tuple[Column, ...] | None = None
    if rows and not all(_is_number(cell, reader.separator) for cell in rows[0][1]):
        columns = reader.header(*rows.pop(0))
    elif rows:
        columns = reader.commented(lines, rows[0][0])
    if not rows:
        raise CaseError(key, f"'{path.name}' has no corners", "write a corner a line")
    columns = columns or tuple(Column(None, None) for _ in rows[0][1])
    values = np.array([reader.numbers(n, cells, len(columns)) for n, cells in rows])
    return ContourTable(path.name, columns, values, tuple(n for n, _ in rows))


def _separator(line: str) -> str:
    """Return what separates the columns of a line; a line without any of these has one column."""
    unquoted = re.sub(r'"[^"]*"', "", line)
    return next((mark for mark in (";", "\t", ",") if mark in unquoted), ",")


class _LineReader:
    """Reads lines of one file; remembers how it writes decimals."""

    def __init__(self, file: str, key: str) -> None:
        self.file, self.key, self.separator = file, key, ","
        self._decimals = ""

    def _refuse(self, number: int, said: str, remedy: str) -> CaseError:
        return CaseError(self.key, f"line {number} of '{self.file}' {said}", remedy)

    def cells(self, number: int, line: str) -> list[str]:
        """Return the fields of a line, without empty ones at its end."""
        if len(line) > LONGEST_LINE:
            raise self._refuse(number, f"has {len(line):,} characters", "write a corner a line")
        try:
            parts = next(csv.reader([line], delimiter=self.separator, skipinitialspace=True,
                                    strict=True))  # fmt: skip
        except csv.Error as error:
            raise self._refuse(number, f"can't be read: {error}", "close the quotes") from None
        cells = [part.strip() for part in parts]
        while cells and not cells[-1]:
            cells.pop()
        return cells

    def header(self, number: int, cells: list[str]) -> tuple[Column, ...]:
        """Return the columns that a header says."""
        if any(_is_number(cell, self.separator) for cell in cells):
            said = f"is '{_short(self.separator.join(cells))}', neither a header nor numbers"
            raise self._refuse(number, said, HEADER)
        columns = tuple(self._column(number, cell) for cell in cells)
        names = [column.name for column in columns if column.name is not None]
        if names and len(names) < len(columns):
            raise self._refuse(number, "names some of the columns only", HEADER)
        if len(set(names)) < len(names):
            raise self._refuse(number, f"names two columns alike ({', '.join(names)})", HEADER)
        return columns

    def _column(self, number: int, title: str) -> Column:
        found = BRACKETS.fullmatch(title)
        if found is not None:
            said = found["square"] if found["round"] is None else found["round"]
            unit, name = str(said).strip(), found["name"].strip()
            if unit not in LENGTHS:
                remedy = f"a length is needed: {', '.join(UNITS['length'])}"
                raise self._refuse(number, f"has the unknown unit '{_short(unit)}'", remedy)
            return Column(name or None, LENGTHS[unit])
        suffixed = SUFFIX.fullmatch(title)
        if suffixed is not None:
            return Column(suffixed["name"].strip(), LENGTHS[suffixed["unit"]])
        if not title or not title[0].isalpha():
            raise self._refuse(number, f"has '{_short(title)}', no number and no name", HEADER)
        return Column(title, None)

    def commented(self, lines: Sequence[tuple[int, str]], first: int) -> tuple[Column, ...] | None:
        """Return the columns that the comment right above the first corner says, if it does.

        NumPy's `savetxt` writes headers in this way.
        """
        above = [line for n, line in lines if n < first and line.startswith(COMMENTS)]
        if not above:
            return None
        title = above[-1].lstrip("".join(COMMENTS)).strip()
        try:
            columns = self.header(first - 1, self.cells(first - 1, title))
        except CaseError:  # it is a comment after all
            return None
        return columns if columns and all(c.name and c.factor for c in columns) else None

    def numbers(self, number: int, cells: list[str], count: int) -> list[float]:
        """Return the numbers of a line."""
        if len(cells) != count:
            said = f"is '{_short(self.separator.join(cells))}'"
            raise self._refuse(number, said, f"write {_numbers(count)}; a decimal sign is a point")
        return [self._number(number, cell) for cell in cells]

    def _number(self, number: int, cell: str) -> float:
        if DECIMAL_COMMA.fullmatch(cell):
            remedy = "write decimal points, or semicolons between the columns"
            if self.separator != ";":
                raise self._refuse(number, f"has '{_short(cell)}' with a decimal comma", remedy)
            self._same_decimals(number, ",")
            cell = cell.replace(",", ".")
        elif not NUMBER.fullmatch(cell):
            raise self._refuse(number, f"has '{_short(cell)}', which is not a number", PLAIN)
        elif "." in cell:
            self._same_decimals(number, ".")
        value = float(cell)
        if not math.isfinite(value):
            raise self._refuse(number, f"has '{_short(cell)}', which is too large", PLAIN)
        return value

    def _same_decimals(self, number: int, mark: str) -> None:
        if self._decimals and self._decimals != mark:
            said = "has another decimal sign than the lines above"
            raise self._refuse(number, said, "write decimal points everywhere")
        self._decimals = mark


def _is_number(cell: str, separator: str) -> bool:
    if separator == ";" and DECIMAL_COMMA.fullmatch(cell):
        return True
    return NUMBER.fullmatch(cell) is not None


def _checked(points: Floats, lines: Sequence[int], file: str, key: str) -> Contour:
    """Return the contour of corners; one that is written twice running counts once."""
    again = [np.array_equal(one, other) for one, other in pairwise(points)]
    keep = np.array([True, *(not same for same in again)])
    if keep.sum() > 1 and np.array_equal(points[0], points[keep][-1]):
        keep[np.flatnonzero(keep)[-1]] = False
    points, numbers = points[keep], np.array(lines)[keep]
    if len(points) < 3:
        problem = f"'{file}' has {len(points)} different corners in a row"
        raise CaseError(key, problem, "a contour needs at least 3")
    _, first, inverse = np.unique(points, axis=0, return_index=True, return_inverse=True)
    repeated = np.flatnonzero(first[inverse.ravel()] != np.arange(len(points)))
    if repeated.size:
        one, other = numbers[first[inverse.ravel()][repeated[0]]], numbers[repeated[0]]
        problem = f"lines {one} and {other} of '{file}' are the same corner"
        raise CaseError(key, problem, "draw an outline that does not touch itself")
    contour = Contour(points)
    contour.check(key)
    if not contour.area > 0.0:
        raise CaseError(key, f"the corners of '{file}' lie on one line", "give an outline")
    return contour


def _short(text: str) -> str:
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}... ({len(text):,} characters)"


def _columns(count: int) -> str:
    words = {1: "one column", 2: "two columns", 3: "three columns"}
    return words.get(count, f"{count} columns")


def _numbers(count: int) -> str:
    return "one number" if count == 1 else f"{count} numbers"
