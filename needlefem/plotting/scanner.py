"""Results in the coordinates of the scanner that the anatomy comes from."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from needlefem.geometry.image_frame import ImageFrame
from needlefem.scene import Scene

POINTS = ("target", "release_point", "placed_at", "released_at", "now_at", "entry")
"""Keys of a record that are points of the case."""
NESTED = ("unplanned", "depth_only", "barred", "seeds", "ours")
"""Keys of a record with such points below them."""


def with_scanner(record: Mapping[str, Any], scene: Scene) -> dict[str, Any]:
    """Return the record of a plan or a run with ``frame`` and ``scanner`` beside what it has.

    ``frame`` is the case's plane in the scanner; ``scanner`` has every point of the record in the
    scanner's space (m, three numbers) under the record's own keys, and the needle's direction.
    Both are None for a case without a frame.
    """
    frame = scene.frame
    if frame is None:
        return {**record, "frame": None, "scanner": None}
    direction = record.get("direction", scene.motion.direction)
    found = {"space": frame.space, "direction": frame.turned(np.array(direction))}
    return {**record, "frame": dataclasses.asdict(frame), "scanner": found | _points(record, frame)}


def _points(record: Mapping[str, Any], frame: ImageFrame) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in record.items():
        if key in POINTS:
            found[key] = None if value is None else frame.to_scanner(np.array(value))
        elif key in NESTED and isinstance(value, Mapping):
            found[key] = _points(value, frame)
        elif key in NESTED and isinstance(value, Sequence):
            found[key] = [_points(item, frame) for item in value]
    return found


def scanner_lines(scanner: Mapping[str, Any] | None) -> list[str]:
    """Return lines that say where release points and seeds are in the scanner, mm."""
    if scanner is None:
        return []
    named = {
        "entry": scanner.get("entry"),
        "release at": scanner.get("release_point"),
        "comes to rest": scanner.get("placed_at"),
    }
    for number, seed in enumerate(scanner.get("seeds", ()), 1):
        named[f"seed {number} rests"] = seed["placed_at"]
    return [
        f"  in the scanner ({scanner['space']}): {name} "
        f"({', '.join(f'{1e3 * float(x):.2f}' for x in point)}) mm"
        for name, point in named.items()
        if point is not None
    ]
