"""A result's case, read again from what ``run --out`` or ``plan --out`` wrote."""

import dataclasses
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from needlefem.casefile.load import load_case
from needlefem.errors import CaseError
from needlefem.output.saved import load_result
from needlefem.scene import Scene


@dataclasses.dataclass(frozen=True, eq=False)
class Again:
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


def read_again(path: str | Path) -> Again:
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
    overrides = saved.record["overrides"].items()
    assignments = [f"{key}={json.dumps(value)}" for key, value in overrides]
    return Again(load_case(saved.record["source"], assignments), saved.record)
