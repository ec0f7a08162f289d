"""TOML tables and what can be wrong with them."""

from collections.abc import Mapping
from typing import Any

from needlefem.errors import CaseError, short
from needlefem.validation import dotted

Table = Mapping[str, Any]


def table(data: Table, key: str) -> Table:
    """Return a sub-table, or raise a `CaseError` if it is missing or none."""
    found = required(data, key, "")
    if not isinstance(found, dict):
        raise CaseError(key, f"{short(found)} is not a table", f"write [{key}]")
    return found


def tables(data: Table, key: str) -> dict[str, Table]:
    """Return a group of named sub-tables; empty when there is none."""
    group = data.get(key, {})
    if not isinstance(group, dict) or not all(isinstance(t, dict) for t in group.values()):
        raise CaseError(key, "must hold one table for every name", f"write [{key}.name]")
    return group


def required(table: Table, key: str, prefix: str) -> Any:
    """Return the value of a key, or raise a `CaseError` if it is missing."""
    if key not in table:
        where = f"[{prefix}]" if prefix else "the case"
        raise CaseError(dotted(prefix, key), "missing", f"add it to {where}")
    return table[key]
