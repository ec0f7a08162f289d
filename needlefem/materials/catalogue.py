"""Named tissues: a table of laws with value, range and source."""

import dataclasses
import tomllib
from collections.abc import Iterator, Mapping
from functools import cache
from importlib import import_module, resources
from typing import Any

from needlefem import _plugin
from needlefem.errors import CaseError, matching, nearest, short

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


# The laws that a case can name.


HOMES = {
    "isotropic": "linear_elastic:Isotropic",
    "transversely-isotropic": "anisotropic:TransverselyIsotropic",
    "orthotropic": "anisotropic:Orthotropic",
    "viscoelastic": "viscoelastic:Viscoelastic",
}


class _Laws(Mapping[str, type]):
    """The laws by their names in a case, imported when asked for."""

    def __getitem__(self, name: str) -> type:
        module, law = HOMES[name].split(":")
        found: type = getattr(import_module(f"needlefem.materials.{module}"), law)
        return found

    def __iter__(self) -> Iterator[str]:
        return iter(HOMES)

    def __len__(self) -> int:
        return len(HOMES)


LAWS = _Laws()


def law_class(name: str, key: str) -> type:
    """Return the dataclass of a law: of the catalogue, or of the user's (``module:Class``).

    Raises
    ------
    CaseError
        There is none of that name (the nearest is named), or it is no dataclass.
    """
    if not _plugin.is_foreign(name):
        known = matching(name, LAWS)
        if known is None:
            raise CaseError(key, f"no law {short(name)}", nearest(name, LAWS))
        return LAWS[known]
    found = _plugin.load(name, key)
    if not (isinstance(found, type) and dataclasses.is_dataclass(found)):
        raise CaseError(key, f"'{name}' is no dataclass", "see docs/how-to/own-material.md")
    return found
