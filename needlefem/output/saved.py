"""Results that were written, read again."""

import csv
import dataclasses
import json
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from needlefem.arrays import Points
from needlefem.errors import CaseError
from needlefem.frame import Frame, Voxels
from needlefem.shown import Shown

KINDS = {
    "plan.json": "plan",
    "run.json": "run",
    "modes.json": "modes",
    "motion.json": "motion",
    "verification.json": "verification",
}
"""Names of the files with a command's result, in the order of preference."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class SavedResult(Shown):
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
        Times (s) and VTU files that a PVD file beside it lists.
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
    def frame(self) -> Frame | None:
        """The case's plane in the scanner's space, where the case has one."""
        said = self.record.get("frame")
        if said is None:
            return None
        voxels = said["voxels"]
        own = None if voxels is None else Voxels(**{k: _tuples(v) for k, v in voxels.items()})
        return Frame(**{k: _tuples(v) for k, v in said.items() if k != "voxels"}, voxels=own)


def load_result(path: str | Path) -> SavedResult:
    """Read what ``needlefem run``, ``plan`` and others wrote with ``--out``.

    Parameters
    ----------
    path : str or Path
        The folder, or the JSON file in it.

    Raises
    ------
    CaseError
        There is no result, or it is no JSON.
    """
    file = _file(Path(path))
    try:
        record = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise CaseError("result", f"'{file}' can't be read: {error}", "write it anew") from None
    if not isinstance(record, dict):
        raise CaseError("result", f"'{file}' holds no object", f"give one of {', '.join(KINDS)}")
    folder = file.parent
    return SavedResult(
        kind=KINDS[file.name],
        path=file,
        record=record,
        tables={table.stem: read_table(table) for table in sorted(folder.glob("*.csv"))},
        snapshots=tuple(s for pvd in sorted(folder.glob("*.pvd")) for s in _snapshots(pvd)),
    )


def _file(path: Path) -> Path:
    file = next((path / name for name in KINDS if (path / name).is_file()), path)
    if file.name in KINDS and file.is_file():
        return file
    remedy = f"give the folder of --out, or one of {', '.join(KINDS)} in it"
    raise CaseError("result", f"there is none at '{path}'", remedy)


def read_table(path: Path) -> dict[str, np.ndarray]:
    """Return the columns of a CSV file by header: numbers, or texts where one is no number."""
    with path.open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    return {name: _column([row[i] for row in rows]) for i, name in enumerate(header)}


def _column(cells: list[str]) -> np.ndarray:
    try:
        return np.array([float(cell) if cell else np.nan for cell in cells])
    except ValueError:
        return np.array(cells)


def _snapshots(path: Path) -> list[tuple[float, Path]]:
    sets = ET.parse(path).getroot().iter("DataSet")
    return [(float(s.attrib["timestep"]), path.parent / s.attrib["file"]) for s in sets]


def _tuples(value: Any) -> Any:
    return tuple(_tuples(item) for item in value) if isinstance(value, list) else value
