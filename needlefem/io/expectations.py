"""Comparison of a result with the expectations of its case."""

import math
from collections.abc import Iterator, Mapping, Sequence, Sized
from typing import Protocol, SupportsFloat, runtime_checkable

from needlefem._table import Table
from needlefem.errors import CaseError, nearest, short
from needlefem.scene import Expectation, Scene, canonical
from needlefem.studies import STUDIES
from needlefem.units import in_unit

VALUE, LIST, TABLE = "a number or a text", "a list", "a table"
ORIGIN = {"case": VALUE, "source": VALUE, "overrides": TABLE}
EVIDENCE = {
    "energy": TABLE, "validity": TABLE, "timings": TABLE, "skipped": TABLE, "reasons": TABLE,
    "warnings": LIST, "scanner": TABLE, "discretization": TABLE, "frame": TABLE,
}  # fmt: skip
KEYS = {
    "run": ORIGIN | EVIDENCE | {
        "status": VALUE, "sentence": VALUE, "entry": LIST, "puncture_depth": VALUE, "depth": LIST,
        "tip_path": LIST, "tip_force": LIST, "shaft_force": LIST, "lateral_force": LIST,
        "time": LIST, "tip_phase": LIST, "sticking_segments": LIST, "events": LIST,
        "ruptures": LIST, "contact_solves": VALUE, "seeds": LIST,
    },
    "plan": ORIGIN | EVIDENCE | {
        "status": VALUE, "sentence": VALUE, "target": LIST, "release_point": LIST,
        "placed_at": LIST, "placement_error": VALUE, "entry": LIST, "release_depth": VALUE,
        "unplanned": TABLE, "depth_only": TABLE, "insertions": VALUE, "search": TABLE,
        "other_solutions": LIST, "scan_insertions": VALUE, "ruptures": VALUE, "direction": LIST,
        "obstacles": LIST, "blocked": TABLE, "rejected_directions": LIST, "energy_residual": VALUE,
        "estimate": TABLE, "refinement_history": LIST, "preflight": LIST, "headline": TABLE,
        "missing": TABLE,
    },
}  # fmt: skip
"""What the results of a command have in them, so that a key that can't exist is refused early."""
MOST_SHOWN = 4
"""Entries of a list that a row shows one by one."""
HARMLESS = ("title", "outputs", "limits", "schema_version")
"""Sections that change no result."""


@runtime_checkable
class _Listed(Protocol):
    """A list, a tuple or an array."""

    def __len__(self) -> int: ...

    def __iter__(self) -> Iterator[object]: ...

    def __getitem__(self, number: int, /) -> object: ...


def check_key(name: str, axes: Sequence[str], key: str) -> None:
    """Raise a `CaseError` for an expectation of what no result has.

    Parameters
    ----------
    name : str
        Dotted name of the quantity: ``run``, ``plan`` or a study, then the key of its JSON.
    axes : sequence of str
        Names of the scene's axes, which may pick a coordinate.
    key : str
        Where the case says it.
    """
    root, *path = name.split(".")
    roots = (*KEYS, *STUDIES)
    if root not in roots or not path:
        remedy = nearest(root, roots) if root not in roots else f"write {root}.KEY"
        raise CaseError(key, f"{short(name)} is the key of no result", remedy)
    if root not in KEYS:
        return
    kinds = KEYS[root]
    if path[0] not in kinds:
        raise CaseError(key, f"no {short(path[0])} in what '{root}' gives", nearest(path[0], kinds))
    kind, rest = kinds[path[0]], path[1:]
    if kind is LIST and rest and rest[0] not in axes and not _is_number(rest[0]):
        remedy = "number its entries from 0, or from -1 backwards"
        raise CaseError(key, f"{root}.{path[0]} is a list without {short(rest[0])}", remedy)
    if kind is VALUE and rest:
        raise CaseError(
            key, f"{root}.{path[0]} is {VALUE} without {short(rest[0])}", "leave it out"
        )


def set_aside(scene: Scene, root: str) -> str:
    """Return why the case's expectations under ``root.`` do not hold; empty if they do.

    They belong to the case as it is written: what ``--set`` changes has other results, unless
    expectations were set as well.
    """
    keys = [key for key in scene.overrides if canonical(key).split(".")[0] not in HARMLESS]
    theirs = any(item.key.split(".")[0] == root for item in scene.expect)
    if not theirs or not keys or any(key.split(".")[0] == "expect" for key in keys):
        return ""
    return f"the case's expectations are not compared, because --set changed {', '.join(keys)}"


def judged(scene: Scene, record: Mapping[str, object], root: str) -> tuple[Table | None, str]:
    """Return the table of a scene's expectations, or None, and why there is none if one is due."""
    why = set_aside(scene, root)
    return (None if why else compare(scene.expect, record, root, scene.axes)), why


def expect_record(table: Table | None, why: str) -> dict[str, object]:
    """Return what `judged` found as plain data for JSON."""
    return {"expect": None if table is None else table.record(), "expect_skipped": why or None}


def compare(
    expected: Sequence[Expectation], record: Mapping[str, object], root: str, axes: Sequence[str]
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


def look_up(record: object, path: Sequence[str], axes: Sequence[str]) -> object:
    """Return the entry of a record at a dotted path; the last part may name an axis.

    None where there is no such entry.
    """
    for part in path:
        if isinstance(record, Mapping):
            record = record.get(part)
        elif isinstance(record, str) or not isinstance(record, _Listed):
            return None
        elif part in axes or _is_number(part):
            number = axes.index(part) if part in axes else int(part)
            record = record[number] if -len(record) <= number < len(record) else None
        else:
            return None
    return record


def _is_number(part: str) -> bool:
    digits = part.removeprefix("-")
    return digits.isascii() and digits.isdigit() and len(digits) < 10


def _row(item: Expectation, found: object) -> list[object]:
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


def _text(value: object, unit: str) -> str:
    if value is None:
        return "none"
    if isinstance(value, str):
        return str(value)
    if isinstance(value, Mapping):
        return "a table"
    if isinstance(value, _Listed):
        if len(value) > MOST_SHOWN:
            return f"a list of {len(value)}"
        return "(" + ", ".join(_text(item, unit) for item in value) + ")"
    return f"{_scaled(float(value), unit):.4g}" if isinstance(value, SupportsFloat) else str(value)


def _holds(item: Expectation, found: object) -> bool:
    """Say whether a value is as expected; one of another kind never is."""
    if isinstance(item.value, tuple):
        values = None if isinstance(found, str | Mapping) else _numbers(found)
        if values is None or len(values) != len(item.value):
            return False
        return math.dist(item.value, values) <= (item.tolerance or 0.0)
    if isinstance(found, str | Sized) or not isinstance(found, SupportsFloat):
        return False
    if item.tolerance is None:
        return float(found) <= item.value
    return abs(float(found) - item.value) <= item.tolerance


def _numbers(found: object) -> list[float] | None:
    """Return the numbers of a list; None if there is anything else in it, or no list."""
    if not isinstance(found, _Listed):
        return None
    plain = [float(x) for x in found if isinstance(x, SupportsFloat) and not isinstance(x, Sized)]
    return plain if len(plain) == len(found) else None
