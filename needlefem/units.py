"""Quantities as texts with a unit; all computations use SI units."""

import math
import re

from needlefem.errors import CaseError, short

UNITS: dict[str, dict[str, float]] = {
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6},
    "pressure": {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9},
    "force": {"N": 1.0, "mN": 1e-3},
    "force per length": {"N/m": 1.0, "N/cm": 1e2, "N/mm": 1e3},
    "force per volume": {"N/m^3": 1.0, "N/cm^3": 1e6, "N/mm^3": 1e9},
    "density": {"kg/m^3": 1.0, "g/cm^3": 1e3},
    "speed": {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3},
    "time": {"s": 1.0, "ms": 1e-3},
    "rate": {"1/s": 1.0},
    "memory": {"GB": 1e9, "MB": 1e6, "kB": 1e3},
}
"""Factors to SI of all accepted units, by dimension."""
LARGEST = {
    "length": 1e4,
    "pressure": 1e15,
    "force": 1e12,
    "force per length": 1e12,
    "force per volume": 1e18,
    "density": 1e9,
    "speed": 1e4,
    "time": 1e9,
    "rate": 1e9,
    "memory": 1e18,
}
"""Largest accepted magnitude of a quantity, SI; squares of larger ones would overflow."""
PLANE = {
    "cutting force": "force per length",
    "shaft friction": "pressure",
    "lateral stiffness": "force per volume",
}
"""Dimensions of the needle's quantities; in 2D all forces are per metre of thickness."""

LOOSE = re.compile(r"([+-]?[0-9]+(?:[.,][0-9]+)?(?:[eE][+-]?[0-9]+)?)\s*([^0-9\s].*)")
"""A number, which may have a decimal comma, and a unit that may follow without a space."""


def parse_quantity(text: object, dimension: str, key: str) -> float:
    """Return the SI value of a quantity such as ``"1.27 mm"``.

    Parameters
    ----------
    text : object
        Value in the case; anything but a text ``"<number> <unit>"`` is an error.
    dimension : str
        A key of `UNITS`.
    key : str
        Name of the quantity in error messages.

    Raises
    ------
    CaseError
        Not a string, not a number, unknown unit, or a unit of another dimension.
    """
    table = UNITS[dimension]
    example = f'write a {dimension} such as "1 {next(iter(table))}"'
    if not isinstance(text, str):
        raise CaseError(key, f"{short(text)} has no unit", example)
    number, _, unit = text.strip().partition(" ")
    unit = unit.strip()
    try:
        value = float(number)
    except ValueError:
        remedy = _meant(text, table) or example
        raise CaseError(key, f"{short(text)} is not a number with a unit", remedy) from None
    if not number.isascii() or "_" in number:
        problem = f"{short(text)} is not a number with a unit"
        raise CaseError(key, problem, "write the number with the digits 0 to 9 and a point")
    if not math.isfinite(value):
        raise CaseError(key, f"{short(text)} is out of range", "it must be finite")
    if unit in table:
        return value * table[unit]
    needed = f"a {dimension} is needed: {', '.join(table)}"
    for other, names in UNITS.items():
        if unit in names:
            raise CaseError(key, f"{short(text)} is a {other}", needed)
    if unit:
        raise CaseError(key, f"unknown unit {short(unit)} in {short(text)}", needed)
    raise CaseError(key, f"{short(text)} has no unit", needed)


def _meant(text: str, table: dict[str, float]) -> str | None:
    """Return a remedy if a space is missing or a comma is used as decimal point."""
    found = LOOSE.fullmatch(text.strip())
    if found is None or found[2] not in table:
        return None
    return f"write '{found[1].replace(',', '.')} {found[2]}'"


def dimension_of(declared: str) -> str:
    """Return the dimension (a key of `UNITS`) that a field declares."""
    return PLANE.get(declared, declared)


def in_unit(value: float, unit: str) -> float:
    """Return an SI value in another unit."""
    for names in UNITS.values():
        if unit in names:
            return value / names[unit]
    raise KeyError(unit)
