"""A law with constants that are good enough to try it."""

import dataclasses
from collections.abc import Mapping
from typing import Any

from needlefem.errors import CaseError, nearest
from needlefem.knobs import Knob, check_ranges, knob_of
from needlefem.materials.catalogue import law_class
from needlefem.units import UNITS, parse_quantity

STIFFNESS, RATIO = 10e3, 0.3
"""Taken for every pressure (Pa), and every number without unit, that has no default."""


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
        declared = knob_of(field)
        if field.name in settings:
            values[field.name] = _given(settings[field.name], declared, f"--set {field.name}")
        elif field.default is dataclasses.MISSING:
            has_unit = declared is not None and declared.dimension == "pressure"
            values[field.name] = STIFFNESS if has_unit else RATIO
    found = law(**values)
    check_ranges(found, "--set ")
    return found


def _given(text: str, declared: Knob | None, key: str) -> Any:
    if declared is not None and declared.dimension in UNITS:
        return parse_quantity(text, declared.dimension, key)
    numbers = [part.strip() for part in text.strip("[]() ").split(",")]
    try:
        values = tuple(float(part) for part in numbers)
    except ValueError:
        raise CaseError(key, f"'{text}' is no number", "write a number") from None
    return values[0] if len(values) == 1 else values
