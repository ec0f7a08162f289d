"""The keys of a case as a table, from what the fields declare."""

import dataclasses
import typing
from typing import Any

from needlefem.geometry import ImageFrame, Voxels
from needlefem.materials import LAWS
from needlefem.scene import (
    BoxMesh,
    Discretization,
    FileMesh,
    Limits,
    Motion,
    Needle,
    Obstacle,
    Outputs,
    Planning,
    Rayleigh,
    Refinement,
    Region,
    Stage,
    Support,
    TargetDraw,
)
from needlefem.validation import ParameterInfo, parameter_info

TABLES: dict[str, type] = {
    "`[mesh]`": BoxMesh,
    "`[mesh.refine]`": Refinement,
    "`[mesh]` with a `file`": FileMesh,
    **{f'`[materials.NAME]` with `law = "{law}"`': cls for law, cls in LAWS.items()},
    "`[regions.NAME]`": Region,
    "`[supports.NAME]`": Support,
    "`[obstacles.NAME]`": Obstacle,
    "`[damping]`": Rayleigh,
    "`[discretization]`": Discretization,
    "`[needle]`": Needle,
    "`[motion]`": Motion,
    "`[[motion.stages]]`": Stage,
    "`[planning]`": Planning,
    "`[targets]`": TargetDraw,
    "`[outputs]`": Outputs,
    "`[limits]`": Limits,
    "`[frame]`": ImageFrame,
    "`[frame.voxels]`": Voxels,
}


def describe() -> str:
    """Return all keys as Markdown tables: meaning, dimension, range and default (SI)."""
    parts = []
    for name, cls in TABLES.items():
        rows = [row for field in dataclasses.fields(cls) if (row := _row(field)) is not None]
        head = ["| key | meaning | dimension | range | default |", "|---|---|---|---|---|"]
        parts.append("\n".join([f"## {name}", "", *head, *rows]))
    return "\n\n".join(parts) + "\n"


def _row(field: "dataclasses.Field[Any]") -> str | None:
    declared = parameter_info(field)
    if declared is None:
        return None
    cells = [
        f"`{field.name}`",
        declared.sentence,
        declared.dimension or "",
        _range(declared),
        _default(field),
    ]
    return "| " + " | ".join(cells) + " |"


def _range(declared: ParameterInfo) -> str:
    if declared.choices:
        return ", ".join(f"`{choice}`" for choice in declared.choices)
    text = declared.range_text()
    return "" if text == "finite" else text


def _default(field: "dataclasses.Field[Any]") -> str:
    if field.default is dataclasses.MISSING:
        return "required"
    if field.default in ((), None):
        return "none"
    value = typing.cast(object, field.default)
    return f"{value:g}" if isinstance(value, float) else str(value)
