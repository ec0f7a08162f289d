"""Results of earlier commands: their keys, columns and kinds of values, and how they are read.

Edited, truncated or mixed files are refused by name before anything is computed from them. Keys and
columns may be added to results; those below exist since the first version.
"""

import csv
import dataclasses
import json
import math
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from needlefem._arrays import Points
from needlefem._inputfile import LARGEST_DATA, read_bytes, read_text, require_file
from needlefem.errors import CaseError, short
from needlefem.geometry.image_frame import ImageFrame
from needlefem.io.result_folder import TABLES, mark_of
from needlefem.scene.version_1 import EVENTS, PHASES, renewed_record
from needlefem.validation import filled

KEY = "result"
ANEW = "write the result anew"
SAME = 1e-8
"""Relative difference up to which a number of nine digits is the one in the record."""
UNIT = 1e-6
"""Difference of a unit vector's length from 1."""
TEXTS = ("tip", "event", "name")
"""Columns of words; all others hold numbers, or nothing."""


@dataclasses.dataclass(frozen=True)
class Maybe:
    """A value of some kind, or null."""

    kind: "Kind"


Kind: TypeAlias = "type | Maybe | list[Kind] | dict[str, Kind]"
"""What a value is: of a type, that or null, a list of such values, or an object with such keys."""
POINT: Kind = [float]
RELEASE = Maybe({"release_point": POINT, "placed_at": POINT, "placement_error": float})
ORIGIN: dict[str, Kind] = {"case": str, "source": Maybe(str), "overrides": dict}
RECORDS: Mapping[str, Mapping[str, Kind]] = {
    "run": ORIGIN | {
        "status": str, "sentence": str, "puncture_depth": Maybe(float),
        "time": [float], "depth": [float], "tip_phase": [str], "tip_path": [POINT],
        "tip_force": [Maybe(float)], "shaft_force": [Maybe(float)],
        "lateral_force": [[Maybe(float)]], "sticking_segments": [Maybe(int)],
        "events": [{"kind": str, "time": float, "depth": float, "point": POINT}],
        "seeds": [{"name": str, "released_at": POINT, "placed_at": POINT, "status": str,
                   "placement_error": Maybe(float)}],
        "energy": Maybe(dict), "validity": Maybe(dict), "warnings": [str],
        "skipped": dict, "reasons": dict,
    },
    "plan": ORIGIN | {
        "status": str, "sentence": str, "target": POINT, "release_point": Maybe(POINT),
        "placed_at": Maybe(POINT), "placement_error": Maybe(float), "unplanned": RELEASE,
        "depth_only": RELEASE, "insertions": int, "search": dict, "direction": POINT,
        "obstacles": [dict], "rejected_directions": [dict],
    },
    "modes": {
        "case": str, "element": str, "unknowns": int, "supported": bool, "frequencies": [float],
        "critical_steps": dict,
    },
    "motion": {
        "status": str, "steps": int, "step": float, "duration": float, "points": dict,
        "snapshots": [{"time": float, "file": str}],
    },
    "verification": {"passed": bool, "quick": bool, "packages": dict, "problems": [dict]},
}  # fmt: skip
"""Keys of every record and what their values are; `float` stands for any finite number."""
FRAME: dict[str, Kind] = {
    "space": str, "origin": POINT, "axes": [POINT],
    "voxels": Maybe({"file": str, "origin": POINT, "axes": [POINT], "spacing": POINT,
                     "size": [int]}),
}  # fmt: skip
HISTORIES = ("time", "depth", "tip_phase", "tip_path", "tip_force", "shaft_force", "lateral_force",
             "sticking_segments")  # fmt: skip
"""Keys of a run's record with an entry for every state."""
COLUMNS = {
    "insertion": ("time [s]", "depth [m]", "speed [m/s]", "tip"),
    "events": ("time [s]", "depth [m]", "event", "name"),
    "shaft": ("time [s]", "from [m]", "to [m]", "slip"),
    "motion": ("time [s]",),
}
"""Columns of the tables beside a record."""
WORDS = {
    str: "a text", float: "a number", int: "a whole number", bool: "true or false",
    dict: "an object", list: "a list",
}  # fmt: skip


def read_record(file: Path, kind: str) -> dict[str, Any]:
    """Read the JSON file of a result.

    Raises
    ------
    CaseError
        It is no JSON object, a key is missing, or a value is of another kind or not finite.
    """
    text = read_text(file, KEY, remedy="give the folder of --out", largest=LARGEST_DATA)
    try:
        record = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise CaseError(KEY, f"'{file}' can't be read: {error}", ANEW) from None
    if not isinstance(record, dict):
        raise CaseError(KEY, f"'{file}' holds no object", ANEW)
    record = renewed_record(record, kind)
    shape = dict(RECORDS[kind])
    if record.get("frame") is not None:
        shape["frame"] = FRAME
    _require(record, shape, "", file)
    _require_finite(record, "", file)
    if kind == "run":
        _require_equal_lengths(record, file)
    _require_equal_points(record, file)
    return record


def _require(value: object, kind: Kind, key: str, file: Path) -> None:
    """Raise a `CaseError` unless a value is of a kind; keys that are not listed may be there."""
    if isinstance(kind, Maybe):
        if value is not None:
            _require(value, kind.kind, key, file)
        return
    plain = kind if isinstance(kind, type) else type(kind)
    fits = isinstance(value, int | float if plain is float else plain)
    if not fits or (isinstance(value, bool) and plain is not bool):
        raise _wrong(value, WORDS[plain], key, file)
    if isinstance(kind, list) and isinstance(value, list):
        for number, item in enumerate(value):
            _require(item, kind[0], f"{key}[{number}]", file)
    elif isinstance(kind, dict) and isinstance(value, dict):
        for name, inner in kind.items():
            own = f"{key}.{name}" if key else name
            if name not in value:
                raise CaseError(KEY, f"'{file}' has no key '{own}'", ANEW)
            _require(value[name], inner, own, file)


def _wrong(value: object, wanted: str, key: str, file: Path) -> CaseError:
    return CaseError(KEY, f"'{key}' in '{file}' is {short(value)}, not {wanted}", ANEW)


def _require_finite(value: object, key: str, file: Path) -> None:
    if isinstance(value, dict):
        for name, item in value.items():
            _require_finite(item, f"{key}.{name}" if key else name, file)
    elif isinstance(value, list):
        for number, item in enumerate(value):
            _require_finite(item, f"{key}[{number}]", file)
    elif isinstance(value, float) and not math.isfinite(value):
        raise _wrong(value, "a finite number", key, file)
    elif isinstance(value, int) and abs(value) > 1e300:
        raise _wrong(value, "a number of this size", key, file)


def _require_equal_points(record: Mapping[str, Any], file: Path) -> None:
    """Raise a `CaseError` unless all points have two coordinates, or all have three."""
    names = ("target", "direction", "release_point", "placed_at")
    points = {name: record[name] for name in names if record.get(name) is not None}
    points |= {f"tip_path[{n}]": point for n, point in enumerate(record.get("tip_path", ()))}
    count = len(next(iter(points.values()), (0, 0)))
    for name, point in points.items():
        if len(point) != count or count not in (2, 3):
            problem = f"'{name}' in '{file}' has {len(point)} coordinates"
            raise CaseError(KEY, problem, ANEW)
    if "direction" in points and abs(math.hypot(*points["direction"]) - 1.0) > UNIT:
        raise _wrong(points["direction"], "a unit vector", "direction", file)


def _require_equal_lengths(record: Mapping[str, Any], file: Path) -> None:
    count = len(record["depth"])
    if not count:
        raise CaseError(KEY, f"'depth' in '{file}' is empty", ANEW)
    for key in HISTORIES:
        if len(record[key]) != count:
            problem = f"'{key}' in '{file}' has {len(record[key])} entries, 'depth' has {count}"
            raise CaseError(KEY, problem, ANEW)


def read_tables(folder: Path, kind: str) -> dict[str, dict[str, np.ndarray]]:
    """Read the tables of a result, by name without ``.csv``; other tables are the user's own.

    Raises
    ------
    CaseError
        One is missing, cut, or not of the columns that it has.
    """
    return {name: read_table(folder / f"{name}.csv") for name in TABLES.get(kind, ())}


def read_table(path: Path) -> dict[str, np.ndarray]:
    """Return the columns of a CSV file by header: numbers, NaN where there is none, or texts.

    Raises
    ------
    CaseError
        It can't be read, was cut, lacks a column, or a cell is not a number.
    """
    text = read_text(path, KEY, remedy=ANEW, largest=LARGEST_DATA)
    if not text.strip():
        raise CaseError(KEY, f"'{path}' is empty", ANEW)
    if not text.endswith("\n"):
        raise CaseError(KEY, f"'{path}' was cut in its last line", ANEW)
    try:
        header, *rows = csv.reader(text.splitlines(), strict=True)
    except csv.Error as error:
        raise CaseError(KEY, f"'{path}' can't be read: {error}", ANEW) from None
    if len(set(header)) < len(header):
        raise CaseError(KEY, f"two columns of '{path}' have one name", ANEW)
    for name in COLUMNS.get(path.stem, ()):
        if name not in header:
            raise CaseError(KEY, f"'{path}' has no column '{name}'", ANEW)
    for number, row in enumerate(rows, 2):
        if len(row) != len(header):
            problem = f"line {number} of '{path}' has {len(row)} cells, the header {len(header)}"
            raise CaseError(KEY, problem, ANEW)
    return {name: _column(name, [row[i] for row in rows], path) for i, name in enumerate(header)}


def _column(name: str, cells: Sequence[str], path: Path) -> np.ndarray:
    if name in TEXTS:
        words = PHASES if name == "tip" else EVENTS if name == "event" else {}
        return np.array([words.get(cell, cell) for cell in cells], dtype=str)
    found = np.full(len(cells), np.nan)
    for number, cell in enumerate(cells):
        try:
            found[number] = float(cell) if cell else np.nan
        except ValueError:
            found[number] = np.inf
        if cell and not math.isfinite(found[number]):
            problem = f"line {number + 2} of '{path}' has {short(cell)} in the column '{name}'"
            raise CaseError(KEY, problem, ANEW)
    return found


def require_same_histories(
    record: Mapping[str, Any], tables: Mapping[str, Mapping[str, np.ndarray]], folder: Path
) -> None:
    """Raise a `CaseError` unless the tables of a run and its record tell the same motion."""
    table = tables["insertion"]
    file, tips = folder / "insertion.csv", np.array(record["tip_path"], dtype=float)
    names = list(table)
    if len(table["depth [m]"]) != len(tips):
        problem = f"'{file}' has {len(table['depth [m]'])} states, 'run.json' has {len(tips)}"
        raise CaseError(KEY, problem, ANEW)
    places = names[names.index("tip") + 1 :][: tips.shape[1]]
    events = list(tables["events"])
    if places != events[events.index("name") + 1 :][: tips.shape[1]]:
        problem = f"'{file}' and '{folder / 'events.csv'}' name other axes"
        raise CaseError(KEY, problem, ANEW)
    wanted = {"time [s]": record["time"], "depth [m]": record["depth"], "tip": record["tip_phase"]}
    wanted |= dict(zip(places, tips.T, strict=False))
    for name, values in wanted.items():
        if not _same(table[name], np.asarray(values)):
            problem = f"the column '{name}' of '{file}' is not what 'run.json' has"
            raise CaseError(KEY, problem, ANEW)


def _same(found: np.ndarray, values: np.ndarray) -> bool:
    if found.dtype.kind != values.dtype.kind and "U" in (found.dtype.kind, values.dtype.kind):
        return False
    if found.dtype.kind == "U":
        return bool(np.array_equal(found, values))
    return bool(np.allclose(found, values, rtol=SAME, atol=1e-12))


# Reading of results.


KINDS = {
    "plan.json": "plan",
    "run.json": "run",
    "modes.json": "modes",
    "motion.json": "motion",
    "verification.json": "verification",
}
"""Names of the files with a command's result."""
PVD = {"run": "insertion.pvd", "motion": "motion.pvd"}
"""Names of the files that list snapshots."""
VTU_END = b"</VTKFile>"


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class SavedResult:
    """What a command wrote into a folder.

    Parameters
    ----------
    kind : str
        ``plan``, ``run``, ``modes``, ``motion`` or ``verification``.
    path : Path
        Of the JSON file.
    record : mapping
        Its content, as ``docs/json.md`` says; ``result["status"]`` looks up in it.
    tables : mapping of names to mapping of headers to arrays
        The CSV files beside it, by name without ``.csv``; headers name their units. A column of
        texts is an array of texts; an empty number is NaN.
    snapshots : tuple of (float, Path)
        Times (s) and VTU files of the tissue that a PVD file beside it lists.
    """

    kind: str
    path: Path
    record: Mapping[str, Any]
    tables: Mapping[str, Mapping[str, np.ndarray]]
    snapshots: tuple[tuple[float, Path], ...]

    def __getitem__(self, key: str) -> Any:
        return self.record[key]

    def points(self, key: str) -> Points:
        """Return a point or a path of the record as an array, m."""
        found: Points = np.array(self.record[key], dtype=float)
        return found

    @property
    def frame(self) -> ImageFrame | None:
        """The case's plane in the scanner's space, where the case has one."""
        said = self.record.get("frame")
        return None if said is None else filled(ImageFrame, said, "frame")


def load_result(path: str | Path) -> SavedResult:
    """Read what ``needlefem run``, ``plan`` and others wrote with ``--out``.

    Parameters
    ----------
    path : str or Path
        The folder, or the JSON file in it.

    Raises
    ------
    CaseError
        There is no result, its command was stopped, or a file of it is missing, was cut, or
        holds other keys, columns or kinds of values; the message names file and key.
    """
    file = _file(Path(path))
    kind, folder = KINDS[file.name], file.parent
    mark = mark_of(folder)
    if mark is not None:
        problem = f"the command that writes into '{folder}' was stopped, or is still at work"
        raise CaseError(KEY, problem, ANEW)
    record = read_record(file, kind)
    tables = read_tables(folder, kind)
    if kind == "run":
        require_same_histories(record, tables, folder)
    found = SavedResult(
        kind=kind, path=file, record=record, tables=tables, snapshots=_snapshots(folder, kind)
    )
    try:
        _ = found.frame
    except CaseError as error:
        raise CaseError(KEY, f"'frame' in '{file}' is none: {error}", ANEW) from None
    return found


def _file(path: Path) -> Path:
    files = [path / name for name in KINDS if (path / name).is_file()]
    if len(files) > 1:
        names = " and ".join(f"'{file.name}'" for file in files)
        raise CaseError(KEY, f"'{path}' holds {names}", "give the path of one of them")
    file = files[0] if files else path
    if file.name in KINDS and file.is_file():
        return file
    remedy = f"give the folder of --out, or one of {', '.join(KINDS)} in it"
    if path.is_dir() and mark_of(path) is not None:
        problem = f"the command that writes into '{path}' was stopped, or is still at work"
        raise CaseError(KEY, problem, ANEW)
    raise CaseError(KEY, f"there is none at '{path}'", remedy)


def _snapshots(folder: Path, kind: str) -> tuple[tuple[float, Path], ...]:
    """Return times and files of the snapshots that a result has."""
    path = folder / PVD.get(kind, "none")
    if not path.exists():
        return ()
    content = read_bytes(path, KEY, remedy=ANEW)
    try:
        root = ET.fromstring(content)
        listed = [
            (float(s.attrib["timestep"]), s.attrib["file"])
            for s in root.iter("DataSet")
            if s.get("part", "0") == "0"
        ]
    except (ET.ParseError, LookupError, ValueError) as error:
        raise CaseError(KEY, f"'{path}' can't be read: {error}", ANEW) from None
    if root.tag != "VTKFile" or not listed or not all(np.isfinite(time) for time, _ in listed):
        raise CaseError(KEY, f"'{path}' lists no snapshots by time", ANEW)
    found = [(time, folder / file) for time, file in listed]
    for _, file in found:
        require_file(file, KEY, remedy=ANEW)
        with file.open("rb") as snapshot:
            snapshot.seek(max(file.stat().st_size - len(VTU_END) - 8, 0))
            if VTU_END not in snapshot.read():
                raise CaseError(KEY, f"'{file}' was cut", ANEW)
    return tuple(found)
