"""A case's [expect] against a result."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from needlefem.scene import Expectation
from needlefem.table import Table
from needlefem.units import in_unit


def compare(
    expected: Sequence[Expectation], record: Mapping[str, Any], root: str, axes: Sequence[str]
) -> Table | None:
    """Return a table of what was expected under ``root.`` and what is in the record.

    None if the case expects nothing of this kind of result.
    """
    mine = [item for item in expected if item.key.split(".")[0] == root]
    if not mine:
        return None
    rows = [_row(item, look_up(record, item.key.split(".")[1:], axes)) for item in mine]
    return Table(
        title="expected by the case",
        columns=("quantity", "here", "expected", "tolerance", "unit", "kind", "holds", "source"),
        rows=rows,
        passed=all(row[6] for row in rows),
    )


def look_up(record: Any, path: Sequence[str], axes: Sequence[str]) -> Any:
    """Return the entry of a record at a dotted path; the last part may name an axis.

    None where there is no such entry.
    """
    for part in path:
        if record is None:
            return None
        if isinstance(record, Mapping):
            record = record.get(part)
        else:
            number = axes.index(part) if part in axes else int(part)
            record = record[number] if -len(record) <= number < len(record) else None
    return record


def _row(item: Expectation, found: Any) -> list[Any]:
    return [
        item.key,
        _text(found, item.unit),
        _text(item.value, item.unit),
        "at most" if item.tolerance is None else f"{_scaled(item.tolerance, item.unit):g}",
        item.unit,
        item.kind,
        _holds(item, found),
        item.source,
    ]


def _scaled(value: float, unit: str) -> float:
    return in_unit(value, unit) if unit else value


def _text(value: Any, unit: str) -> str:
    if value is None:
        return "none"
    if isinstance(value, str):
        return value
    if isinstance(value, int | float):
        return f"{_scaled(float(value), unit):.4g}"
    return "(" + ", ".join(_text(item, unit) for item in value) + ")"


def _holds(item: Expectation, found: Any) -> bool:
    if found is None:
        return False
    if isinstance(item.value, tuple):
        apart = math.dist(item.value, [float(x) for x in found])
        return apart <= (item.tolerance or 0.0)
    if item.tolerance is None:
        return float(found) <= item.value
    return abs(float(found) - item.value) <= item.tolerance
