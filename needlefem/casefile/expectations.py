"""What a case says its results must be."""

import typing
from collections.abc import Sequence
from typing import Any

from needlefem.casefile.tables import required
from needlefem.errors import CaseError, short
from needlefem.io.expectations import check_key
from needlefem.scene import Expectation
from needlefem.units import UNITS, parse_quantity
from needlefem.validation import made, refuse_unknown


def read_expectations(items: Any, axes: Sequence[str]) -> tuple[Expectation, ...]:
    """Return the expectations of a case: its [[expect]] tables; `axes` may pick coordinates."""
    if not isinstance(items, list):
        raise CaseError("expect", f"{short(items)} is not a list of tables", "write [[expect]]")
    found = tuple(read_expectation(item, number) for number, item in enumerate(items))
    for number, item in enumerate(found):
        check_key(item.key, axes, f"expect.{number}.key")
    return found


def read_expectation(item: Any, number: int) -> Expectation:
    """Return the expectation of one [[expect]] table; `number` counts them."""
    prefix = f"expect.{number}"
    if not isinstance(item, dict):
        raise CaseError(prefix, f"{short(item)} is not a table", "write [[expect]]")
    refuse_unknown(item, ("key", "value", "tolerance", "kind", "source"), prefix)
    value, unit = _any_quantity(required(item, "value", prefix), f"{prefix}.value")
    tolerance = None
    if "tolerance" in item:
        bound, _ = _any_quantity(item["tolerance"], f"{prefix}.tolerance")
        if isinstance(bound, tuple):
            raise CaseError(f"{prefix}.tolerance", "a list", "write one number")
        tolerance = bound
    fields = {
        "key": required(item, "key", prefix),
        "value": value,
        "tolerance": tolerance,
        "unit": unit,
        "kind": item.get("kind", ""),
        "source": item.get("source", ""),
    }
    found: Expectation = made(lambda: Expectation(**fields), Expectation.TABLE, prefix)
    return found


def _any_quantity(raw: Any, key: str) -> tuple[float | tuple[float, ...], str]:
    """Return a value in SI and its unit ('' for a plain number); a list gives a tuple."""
    if isinstance(raw, list):
        if not raw or any(isinstance(item, list) for item in raw):
            raise CaseError(key, f"{short(raw)} is not a point", "give a number for each axis")
        parts = [_any_quantity(item, key) for item in raw]
        return tuple(typing.cast(float, value) for value, _ in parts), parts[0][1]
    if isinstance(raw, int | float) and not isinstance(raw, bool):
        return float(raw), ""
    unit = str(raw).strip().partition(" ")[2].strip()
    for dimension, units in UNITS.items():
        if unit in units:
            return parse_quantity(raw, dimension, key), unit
    raise CaseError(
        key, f"{short(raw)} is no number with a unit", "write a number, or one with a unit"
    )
