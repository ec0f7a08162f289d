"""Quantities as strings with a unit: a closed table, SI inside."""

from needlefem.errors import CaseError

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
}
"""Factor to SI of every accepted unit, by dimension."""


def parse_quantity(text: object, dimension: str, key: str) -> float:
    """Return the SI value of a quantity such as ``"1.27 mm"``.

    Parameters
    ----------
    text : object
        What the case says; anything but a string ``"<number> <unit>"`` is an error.
    dimension : str
        A key of `UNITS`.
    key : str
        Name of the quantity for error messages.

    Raises
    ------
    CaseError
        Not a string, not a number, unknown unit, or a unit of another dimension.
    """
    table = UNITS[dimension]
    example = f'write a {dimension} such as "1 {next(iter(table))}"'
    if not isinstance(text, str):
        raise CaseError(key, f"{text!r} has no unit", example)
    number, _, unit = text.strip().partition(" ")
    unit = unit.strip()
    try:
        value = float(number)
    except ValueError:
        raise CaseError(key, f"{text!r} is not a number with a unit", example) from None
    if unit in table:
        return value * table[unit]
    options = ", ".join(table)
    for other, names in UNITS.items():
        if unit in names:
            raise CaseError(key, f"{text!r} is a {other}", f"a {dimension} is needed: {options}")
    problem = f"{text!r} has no unit" if not unit else f"unknown unit '{unit}' in {text!r}"
    raise CaseError(key, problem, f"a {dimension} is needed: {options}")


def in_unit(value: float, unit: str) -> float:
    """Return an SI value expressed in `unit`."""
    for names in UNITS.values():
        if unit in names:
            return value / names[unit]
    raise KeyError(unit)
