"""A law with constants that are good enough to try it."""

import dataclasses
import typing
from collections.abc import Mapping
from typing import Any

from needlefem._parameter import ParameterInfo, parameter_info
from needlefem.errors import CaseError, nearest
from needlefem.materials.catalogue import law_class
from needlefem.units import UNITS, parse_quantity
from needlefem.validation import validate

STAND_INS = {"pressure": 10e3, "time": 1.0}
"""Taken for constants without a default, by dimension, SI."""
RATIO = 0.3
"""Taken for those of any other dimension or none."""


def example(name: str, settings: Mapping[str, str], key: str = "--material") -> Any:
    """Return a law of the catalogue, or of the user's, with stand-in constants.

    Parameters
    ----------
    name : str
        Such as ``"isotropic"`` or ``"my_tissue:MyMaterial"``.
    settings : mapping
        Constants to replace, as in a case: ``{"youngs_modulus": "3 kPa"}``.

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
    values = {}
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
        found = law(**values)
        validate(found, "material")
    except CaseError as error:
        key = error.key.replace("material.", "--set ", 1)
        raise CaseError(key, error.problem, error.remedy) from None
    return found


def _given(text: str, declared: ParameterInfo | None, key: str, *, several: bool) -> Any:
    parts = [part.strip() for part in text.strip("[]() ").split(",")]
    if declared is not None and declared.dimension in UNITS:
        values = tuple(parse_quantity(part, declared.dimension, key) for part in parts)
    else:
        try:
            values = tuple(float(part) for part in parts)
        except ValueError:
            raise CaseError(key, f"'{text}' is no number", "write a number") from None
    return values if several or len(values) > 1 else values[0]
