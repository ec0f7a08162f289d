"""Named tissues: a table of laws with value, range and source."""

import tomllib
from functools import cache
from importlib import resources
from typing import Any

from needlefem.errors import CaseError, nearest

NOTES = ("range", "source", "note")
"""What an entry says beside the keys of its law."""


@cache
def library() -> dict[str, dict[str, Any]]:
    """Return all entries of the library, as read from ``tissues.toml``."""
    text = (resources.files("needlefem.materials") / "tissues.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)


def tissue_table(name: str, key: str) -> dict[str, Any]:
    """Return the keys of a named tissue's law, as a case would write them.

    Raises
    ------
    CaseError
        There is no tissue of that name; the nearest is named.
    """
    if name not in library():
        raise CaseError(key, f"no tissue '{name}'", nearest(name, library()))
    return {k: value for k, value in library()[name].items() if k not in NOTES}


def describe_tissues() -> str:
    """Return the library as a Markdown table."""
    rows = ["| tissue | law | values | range | source |", "|---|---|---|---|---|"]
    for name, entry in library().items():
        values = [f"{key} = {value}" for key, value in entry.items() if key not in (*NOTES, "law")]
        source = entry.get("source") or "assumption"
        note = f" ({entry['note']})" if "note" in entry else ""
        law = entry.get("law", "isotropic")
        cells = [f"`{name}`", law, ", ".join(values), entry.get("range", ""), source + note]
        rows.append("| " + " | ".join(cells) + " |")
    return "\n".join(rows) + "\n"
