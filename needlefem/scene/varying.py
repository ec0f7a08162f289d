"""Scenes with changed fields, and dotted names of fields."""

import dataclasses
import warnings
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, TypeVar

from needlefem._toml import key_parts
from needlefem.errors import CaseError, nearest, short
from needlefem.scene.schema import KEYS, Scene
from needlefem.scene.version_1 import OldWord, renewed_case, renewed_path, report
from needlefem.validation import dotted, made

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

ALIASES = {key: name for name, key in KEYS.items()} | {"background": "default_material"}
"""Keys of a case file, or of version 1, for fields of a scene."""
SPELLINGS = {"discretisation": "discretization"}
"""Sections in another spelling."""
_KEPT = object()
D = TypeVar("D", bound="DataclassInstance")


def vary(scene: Scene, changes: Mapping[str, object]) -> Scene:
    """Return the scene with fields replaced; all are replaced at once, then checked.

    Parameters
    ----------
    scene : Scene
        Stays as it is.
    changes : mapping
        Dotted names, which go through mappings too, and values in SI units or with a unit:
        ``{"needle.tip_radius": 1e-3, "materials.fat.density": "900 kg/m^3"}``.

    Raises
    ------
    CaseError
        There is no such field, or the scene does not admit the value.
    """
    if not isinstance(changes, Mapping):
        raise CaseError("vary", f"{short(changes)} is not a mapping", "give {'name': value}")
    tree, old = _Change(), list[OldWord]()
    for name, value in changes.items():
        path = _path(name, old)
        tree.add(path, renewed_case(value, old, tuple(path)))
    if old:
        warnings.warn(report(old, "vary"), FutureWarning, stacklevel=2)
    return _replaced(scene, tree.fields_of(scene, ""), "") if tree.below else scene


def field_of(scene: Scene, name: str) -> Any:
    """Return a field of a scene by its dotted name, the one that `vary` would change."""
    value: object = scene
    for i, part in enumerate(path := _path(name)):
        value = _part(value, part, ".".join(path[: i + 1]))
    return value


def contour_sizes(scene: Scene, factor: float) -> dict[str, object]:
    """Return the changes that multiply the element sizes along all contours, for `vary`.

    Those of the regions' own go with the one of the mesh. The scene's mesh is a box.
    """
    regions = {
        name: dataclasses.replace(region, contour_size=factor * region.contour_size)
        for name, region in scene.regions.items()
    }
    size = field_of(scene, "mesh.refine.contour_size")
    return {"mesh.refine.contour_size": factor * size, "regions": regions}


def one_contour_size(scene: Scene, size: float) -> dict[str, object]:
    """Return the changes that give all contours one element size (m), for `vary`."""
    return contour_sizes(scene, 0.0) | {"mesh.refine.contour_size": size}


def canonical(name: str, old: list[OldWord] | None = None) -> str:
    """Return the name of a scene's field for a key in another spelling or of a case file.

    Words of version 1 that were replaced are appended to `old`.
    """
    section, *rest = name.split(".")
    path = renewed_path([SPELLINGS.get(section, section), *rest], [] if old is None else old)
    name = ".".join(path)
    for alias, meant in ALIASES.items():
        if name == alias or name.startswith(f"{alias}."):
            return meant + name[len(alias) :]
    return name


def _path(name: object, old: list[OldWord] | None = None) -> list[str]:
    if not isinstance(name, str):
        raise CaseError("vary", f"{short(name)} is not a name", "give {'needle.tip_radius': 1e-3}")
    name, quotes = canonical(name, old), '"' in name
    return key_parts(name) if quotes else name.split(".")


def _part(node: object, name: str, key: str) -> object:
    """Return an entry of a mapping or a field of a dataclass."""
    if isinstance(node, Mapping):
        if name not in node:
            raise CaseError(key, "unknown key", nearest(name, node))
        return node[name]
    if not dataclasses.is_dataclass(node):
        table = key.rpartition(".")[0]
        raise CaseError(key, f"{table} is {short(node)} here", f"give all of {table} instead")
    if not any(field.name == name for field in dataclasses.fields(node)):
        known = [field.name for field in dataclasses.fields(node)]
        raise CaseError(key, "unknown key", nearest(name, known))
    return getattr(node, name)


class _Change:
    """What becomes of a node: another value, or changes below it, or both in this order."""

    def __init__(self) -> None:
        self.value: object = _KEPT
        self.below: dict[str, _Change] = {}

    def add(self, path: list[str], value: object) -> None:
        """Note the value of what a path leads to."""
        if path:
            self.below.setdefault(path[0], _Change()).add(path[1:], value)
        else:
            self.value, self.below = value, {}

    def applied(self, node: object, key: str) -> object:
        """Return a node as changed."""
        node = node if self.value is _KEPT else self.value
        if not self.below:
            return node
        found = self.fields_of(node, key)
        if isinstance(node, Mapping):
            return {**node, **found}
        assert dataclasses.is_dataclass(node)  # `_part` refuses anything else
        assert not isinstance(node, type)
        return _replaced(node, found, key)

    def fields_of(self, node: object, key: str) -> dict[str, object]:
        """Return the entries or fields of a node that change, as changed."""
        found = {}
        for name, change in self.below.items():
            inner = dotted(key, name)
            new = isinstance(node, Mapping) and change.value is not _KEPT
            found[name] = change.applied(None if new else _part(node, name, inner), inner)
        return found


def _replaced(node: D, changes: Mapping[str, object], key: str) -> D:
    """Return an instance of a dataclass with other fields; `key` names it in messages."""
    own = getattr(type(node), "TABLE", "")
    return made(lambda: dataclasses.replace(node, **changes), own, key)
