"""A result's case, read again from what ``run --out`` or ``plan --out`` wrote."""

import dataclasses
import json
from pathlib import Path
from typing import Any

from needlefem.casefile.load import load_case
from needlefem.errors import CaseError
from needlefem.scene import Scene

FILES = ("run.json", "plan.json")


@dataclasses.dataclass(frozen=True, eq=False)
class Again:
    """A case that a result came from.

    Parameters
    ----------
    scene : Scene
        With the result's overrides.
    record : dict
        What was written.
    """

    scene: Scene
    record: dict[str, Any]

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
        There is no such file, or it does not say from which case it came.
    """
    path = Path(path)
    found = [path / name for name in FILES if (path / name).is_file()] if path.is_dir() else [path]
    if not found:
        remedy = "give a case.toml, or a folder that run --out or plan --out wrote"
        raise CaseError(str(path), f"neither {' nor '.join(FILES)} is there", remedy)
    try:
        record = json.loads(found[0].read_text(encoding="utf-8"))
        source, overrides = record["source"], record["overrides"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        remedy = "write it anew with run --out or plan --out"
        problem = f"is no result of this version ({error!r})"
        raise CaseError(str(found[0]), problem, remedy) from None
    assignments = [f"{key}={json.dumps(value)}" for key, value in overrides.items()]
    return Again(load_case(source, assignments), record)
