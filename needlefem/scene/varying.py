"""Scenes with something changed."""

import dataclasses
from collections.abc import Mapping
from typing import Any

from needlefem.scene.parts import Scene


def vary(scene: Scene, changes: Mapping[str, Any]) -> Scene:
    """Return the scene with fields replaced.

    Parameters
    ----------
    scene : Scene
        Stays as it is.
    changes : mapping
        Dotted names, which go through mappings too, and values in SI units:
        ``{"needle.tip_radius": 1e-3, "materials.fat.density": 900}``.
    """
    varied: Scene = scene
    for name, value in changes.items():
        varied = _replaced(varied, name.split("."), value)
    return varied


def field_of(scene: Scene, name: str) -> Any:
    """Return a field of a scene by its dotted name, the one that `vary` would change."""
    value: Any = scene
    for part in name.split("."):
        value = value[part] if isinstance(value, Mapping) else getattr(value, part)
    return value


def _replaced(node: Any, path: list[str], value: Any) -> Any:
    if not path:
        return value
    head, rest = path[0], path[1:]
    if isinstance(node, Mapping):
        return {**node, head: _replaced(node[head], rest, value)}
    return dataclasses.replace(node, **{head: _replaced(getattr(node, head), rest, value)})
