"""Keys that a case leaves open: ``"?"``, as ``needlefem new`` writes what its file can't say."""

import dataclasses
from collections.abc import Iterator
from typing import Any

from needlefem._parameter import parameter_info
from needlefem._toml import dotted_key
from needlefem.casefile.tables import Table
from needlefem.errors import CaseError
from needlefem.materials import LAWS
from needlefem.materials.catalogue import library
from needlefem.scene import BoxMesh, FileMesh, Motion, Needle, Region, Support
from needlefem.units import UNITS, dimension_of

OPEN = "?"
_CLASSES: dict[str, tuple[type, ...]] = {
    "mesh": (FileMesh, BoxMesh),
    "regions": (Region,),
    "supports": (Support,),
    "needle": (Needle,),
    "motion": (Motion,),
}
_SENTENCES = {
    "target.point": 'the point to hit, such as ["1.5 cm", "3 cm"]',
    "tissue.background": "the material outside all regions",
}


def refuse_open(data: Table, file: str = "") -> None:
    """Raise a `CaseError` for the first value that is ``"?"``; it names the file and the others."""
    keys = [path for path in _open_keys(data, ()) if not _is_name(data, path)]
    if not keys:
        return
    rest = f"; so are {', '.join(map(dotted_key, keys[1:]))}" if len(keys) > 1 else ""
    key = dotted_key(keys[0])
    where = f" in {file}" if file else ""
    raise CaseError(key, f"'{OPEN}' is still open{where}{rest}", f"write {_what(keys[0])}")


def _is_name(data: Table, path: tuple[str, ...]) -> bool:
    """Say whether a key's value is somebody's name for a thing, of which ``"?"`` may be one."""
    if path == ("title",) or path[-1] in ("group", "file"):
        return True
    materials = data.get("materials")
    return path[-1] in ("material", "background") and isinstance(materials, dict) and (
        OPEN in materials
    )  # fmt: skip


def _open_keys(node: Any, path: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
    if node == OPEN:
        yield path
    elif isinstance(node, dict):
        for key, value in node.items():
            yield from _open_keys(value, (*path, str(key)))
    elif isinstance(node, list) and OPEN in node:
        yield path


def _what(path: tuple[str, ...]) -> str:
    """Return what belongs to a key, from its field's own declaration."""
    name, dotted = path[-1], ".".join(path)
    if name == "tissue" and path[0] == "materials":
        return f"a tissue of the library ({', '.join(library())}) or its constants instead"
    for cls in tuple(LAWS.values()) if path[0] == "materials" else _CLASSES.get(path[0], ()):
        for field in dataclasses.fields(cls):
            declared = parameter_info(field)
            if field.name == name and declared is not None:
                sentence = declared.sentence[0].lower() + declared.sentence[1:]
                return sentence + _example(declared.dimension)
    return _SENTENCES.get(dotted, "its value")


def _example(dimension: str | None) -> str:
    if dimension is None:
        return ""
    unit = next(iter(UNITS[dimension_of(dimension)]))
    return f', such as "1 {unit}"'
