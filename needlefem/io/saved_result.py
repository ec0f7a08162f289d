"""Results that were written, read again."""

import dataclasses
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from needlefem._arrays import Points
from needlefem._inputfile import read_bytes, require_file
from needlefem.errors import CaseError
from needlefem.geometry.image_frame import ImageFrame, Voxels
from needlefem.io.record_shape import (
    ANEW,
    KEY,
    read_record,
    read_tables,
    require_same_histories,
)
from needlefem.io.result_folder import mark_of

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
    def frame(self) -> ImageFrame | None:
        """The case's plane in the scanner's space, where the case has one."""
        said = self.record.get("frame")
        if said is None:
            return None
        voxels = said["voxels"]
        own = None if voxels is None else Voxels(**{k: _tuples(v) for k, v in voxels.items()})
        return ImageFrame(**{k: _tuples(v) for k, v in said.items() if k != "voxels"}, voxels=own)


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
    except (CaseError, TypeError) as error:
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
        listed = [(float(s.attrib["timestep"]), s.attrib["file"]) for s in root.iter("DataSet")]
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


def _tuples(value: Any) -> Any:
    return tuple(_tuples(item) for item in value) if isinstance(value, list) else value
