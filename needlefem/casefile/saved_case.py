"""A result's case, read again from what ``run --out`` or ``plan --out`` wrote."""

import dataclasses
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from needlefem._toml import key_of, quoted
from needlefem.casefile.load import load_case
from needlefem.errors import CaseError
from needlefem.io.saved_result import SavedResult, load_result
from needlefem.scene import Scene


@dataclasses.dataclass(frozen=True, eq=False)
class SavedCase:
    """A case that a result came from.

    Parameters
    ----------
    scene : Scene
        With the result's overrides.
    record : mapping
        What was written.
    """

    scene: Scene
    record: Mapping[str, Any]

    @property
    def planned(self) -> bool:
        """Whether the result is a plan's."""
        return "release_point" in self.record


def read_again(path: str | Path) -> SavedCase:
    """Read the case of a result.

    Parameters
    ----------
    path : str or Path
        A folder with ``run.json`` or ``plan.json``, or one of these files.

    Raises
    ------
    CaseError
        There is no result, or it does not say from which case it came.
    """
    saved = load_result(path)
    if saved.kind not in ("run", "plan") or not saved.record.get("source"):
        remedy = "write it anew with run --out or plan --out"
        raise CaseError(str(path), "does not say from which case it came", remedy)
    assignments = [
        f"{key}={_toml(value, key, saved.path)}" for key, value in saved.record["overrides"].items()
    ]
    return SavedCase(load_case(_source(saved), assignments), saved.record)


def _source(saved: SavedResult) -> Path:
    """Return the case's path; where it is not there any more, that of one beside the result."""
    source = Path(saved.record["source"])
    beside = saved.path.parent / source.name
    return beside if not source.exists() and beside.is_file() else source


def _toml(value: Any, key: str, file: Path) -> str:
    """Return a value of JSON as TOML."""
    if isinstance(value, list):
        return f"[{', '.join(_toml(item, key, file) for item in value)}]"
    if isinstance(value, dict):
        inner = (f"{key_of(name)} = {_toml(item, key, file)}" for name, item in value.items())
        return f"{{{', '.join(inner)}}}"
    if value is None:
        problem = f"'overrides' in '{file}' has null for '{key}'"
        raise CaseError("result", problem, "write it anew with run --out or plan --out")
    return quoted(value) if isinstance(value, str) else json.dumps(value)
