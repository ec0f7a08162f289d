"""The laws that a case can name, and the library of named tissues with values and sources."""

import dataclasses
import tomllib
import typing
from collections.abc import Iterator, Mapping
from functools import cache
from importlib import import_module, resources

from needlefem import _plugin
from needlefem.errors import CaseError, matching, nearest, short
from needlefem.materials.base import Material
from needlefem.units import UNITS, parse_quantity
from needlefem.validation import ParameterInfo, parameter_info, validate

NOTES = ("range", "source", "note")
"""Keys of an entry in the library that are not constants of its law."""


@cache
def library() -> dict[str, dict[str, object]]:
    """Return all entries of the library ``tissues.toml``."""
    text = (resources.files("needlefem.materials") / "tissues.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)


def tissue_table(name: str, key: str) -> dict[str, object]:
    """Return the keys of a named tissue's law as they would be written in a case.

    Raises
    ------
    CaseError
        The tissue does not exist; the message gives the most similar name.
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
        law, bounds = str(entry.get("law", "isotropic")), str(entry.get("range", ""))
        cells = [f"`{name}`", law, ", ".join(values), bounds, f"{source}{note}"]
        rows.append("| " + " | ".join(cells) + " |")
    return "\n".join(rows) + "\n"


HOMES = {
    "isotropic": "linear_elastic:Isotropic",
    "transversely-isotropic": "linear_elastic:TransverselyIsotropic",
    "orthotropic": "linear_elastic:Orthotropic",
    "viscoelastic": "viscoelastic:Viscoelastic",
}


class _Laws(Mapping[str, type]):
    """The laws by their names in a case; a law is imported when it is first used."""

    def __getitem__(self, name: str) -> type:
        module, law = HOMES[name].split(":")
        found: type = getattr(import_module(f"needlefem.materials.{module}"), law)
        return found

    def __iter__(self) -> Iterator[str]:
        return iter(HOMES)

    def __len__(self) -> int:
        return len(HOMES)


LAWS = _Laws()
"""The classes of the laws that a case can name, by their names."""


def law_class(name: str, key: str) -> type:
    """Return the dataclass of a law of the catalogue or of the user (``module:Class``).

    Raises
    ------
    CaseError
        The name does not exist (the most similar one is given), or the class is not a dataclass.
    """
    if not _plugin.is_foreign(name):
        known = matching(name, LAWS)
        if known is None:
            raise CaseError(key, f"no law {short(name)}", nearest(name, LAWS))
        return LAWS[known]
    found = _plugin.load(name, key)
    if not (isinstance(found, type) and dataclasses.is_dataclass(found)):
        raise CaseError(key, f"'{name}' is not a dataclass", "see docs/how-to/own-material.md")
    return found


# Laws with example constants, for checks.


STAND_INS = {"pressure": 10e3, "time": 1.0}
"""Example values of constants without a default, by dimension, SI."""
RATIO = 0.3
"""Example value of constants of any other dimension."""


def example(name: str, settings: Mapping[str, str], key: str = "--material") -> Material:
    """Return a law of the catalogue or of the user with example constants.

    Parameters
    ----------
    name : str
        Such as ``"isotropic"`` or ``"my_tissue:MyMaterial"``.
    settings : mapping
        Constants to be replaced, as in a case: ``{"youngs_modulus": "3 kPa"}``.

    Raises
    ------
    CaseError
        An unknown law or constant, or a value out of its range.
    """
    law = law_class(name, key)
    fields = {field.name: field for field in dataclasses.fields(law)}
    for wanted in settings:
        if wanted not in fields:
            raise CaseError(f"--set {wanted}", "unknown constant", nearest(wanted, fields))
    values: dict[str, float | tuple[float, ...]] = {}
    for field in fields.values():
        declared = parameter_info(field)
        if field.name in settings:
            several = typing.get_origin(field.type) is tuple
            text, key_of = settings[field.name], f"--set {field.name}"
            values[field.name] = _given(text, declared, key_of, several=several)
        elif field.default is dataclasses.MISSING:
            value = STAND_INS.get((declared and declared.dimension) or "", RATIO)
            values[field.name] = (value,) if typing.get_origin(field.type) is tuple else value
    try:
        found: Material = law(**values)
        validate(found, "material")
    except CaseError as error:
        key = error.key.replace("material.", "--set ", 1)
        raise CaseError(key, error.problem, error.remedy) from None
    return found


def _given(
    text: str, declared: ParameterInfo | None, key: str, *, several: bool
) -> float | tuple[float, ...]:
    parts = [part.strip() for part in text.strip("[]() ").split(",")]
    if declared is not None and declared.dimension in UNITS:
        values = tuple(parse_quantity(part, declared.dimension, key) for part in parts)
    else:
        try:
            values = tuple(float(part) for part in parts)
        except ValueError:
            raise CaseError(key, f"'{text}' is not a number", "write a number") from None
    return values if several or len(values) > 1 else values[0]
