"""A drawn case: the tree of its TOML file with typed quantities, its contours and its mesh."""

import dataclasses
import json
from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

from needlefem._arrays import Ints, Points

EXPONENTS = {
    "length": ("m", 1, 0, 0),
    "pressure": ("Pa", -2, 1, 0),
    "force per length": ("N/m", -1, 1, 0),
    "force per volume": ("N/m^3", -3, 1, 0),
    "density": ("kg/m^3", -4, 1, 2),
    "speed": ("m/s", 1, 0, -1),
    "time": ("s", 0, 0, 1),
    "rate": ("1/s", 0, 0, -1),
}
"""By dimension: the unit that is written, and the exponents of length, force and time."""


class DrawnQuantity(NamedTuple):
    """A number in SI units with its dimension."""

    value: float
    dimension: str

    def __str__(self) -> str:
        return f"{float(self.value)!r} {EXPONENTS[self.dimension][0]}"


class Units(NamedTuple):
    """Factors by which a scene's lengths, forces and times are multiplied."""

    length: float = 1.0
    force: float = 1.0
    time: float = 1.0

    def of(self, quantity: DrawnQuantity) -> DrawnQuantity:
        """Return the quantity in the other units."""
        _, length, force, time = EXPONENTS[quantity.dimension]
        factor = self.length**length * self.force**force * self.time**time
        return DrawnQuantity(quantity.value * factor, quantity.dimension)


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class DrawnMesh:
    """A mesh to be written as a file.

    Parameters
    ----------
    points : array, shape (n, 2), m
    cells : array, shape (m, 3) or (m, 4)
    regions : array, shape (m,)
        Number of the group of every cell; 0 is the background.
    region_names : tuple of str
        Of the groups from 1 on.
    faces : mapping
        Edges of the boundary by their group's name, shape (k, 2).
    file_format : str
        Of meshio's.
    """

    points: Points
    cells: Ints
    regions: Ints
    region_names: tuple[str, ...]
    faces: Mapping[str, Ints]
    file_format: str


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class DrawnCase:
    """A case as it was drawn.

    Parameters
    ----------
    data : mapping
        Tree of the TOML file; its leaves are TOML values and `DrawnQuantity`.
    contours : mapping
        Corners of the contours by file name, shape (n, 2), m.
    mesh : DrawnMesh, optional
        Written beside the case.
    kinds : mapping
        What was drawn, by aspect, for the report's table.
    command : str
        ``run`` or ``plan``.
    check : str
        Which symmetry is checked; empty for none.
    """

    data: Mapping[str, Any]
    contours: Mapping[str, Points]
    mesh: DrawnMesh | None
    kinds: Mapping[str, str]
    command: str
    check: str = ""


MESH_UNIT = 1e-3
"""Length of one unit of the coordinates in a mesh file, m."""


def in_units(case: DrawnCase, units: Units) -> DrawnCase:
    """Return the case with all lengths, forces and times multiplied."""
    contours = {name: units.length * points for name, points in case.contours.items()}
    scaled = _walked(case.data, units.of)  # with the unit of the mesh file's coordinates
    return dataclasses.replace(case, data=scaled, contours=contours)


def _walked(node: Any, of: Callable[[DrawnQuantity], DrawnQuantity]) -> Any:
    if isinstance(node, DrawnQuantity):
        return of(node)
    if isinstance(node, Mapping):
        return {key: _walked(value, of) for key, value in node.items()}
    if isinstance(node, list):
        return [_walked(item, of) for item in node]
    return node


def toml_lines(table: Mapping[str, Any], prefix: str = "") -> Iterator[str]:
    """Yield the lines of a TOML file for a tree with `DrawnQuantity` leaves."""
    deeper = []
    for key, value in table.items():
        bare = key.isascii() and key.replace("-", "").replace("_", "").isalnum()
        name = key if bare else json.dumps(key, ensure_ascii=False)
        tables = isinstance(value, list) and all(isinstance(item, Mapping) for item in value)
        if isinstance(value, Mapping) or (tables and value):
            deeper.append((prefix + name, value))
        else:
            yield f"{name} = {_toml(value)}"
    for name, value in deeper:
        if isinstance(value, Mapping):
            yield ""
            yield f"[{name}]"
            yield from toml_lines(value, f"{name}.")
        else:
            for item in value:
                yield ""
                yield f"[[{name}]]"
                yield from toml_lines(item, f"{name}.")


def _toml(value: Any) -> str:
    if isinstance(value, DrawnQuantity):
        return json.dumps(str(value))
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, list):
        return "[" + ", ".join(_toml(item) for item in value) + "]"
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{json.dumps(k)} = {_toml(v)}" for k, v in value.items()) + "}"
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(value)
