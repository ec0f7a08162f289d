"""Gmsh's own files: MSH 2.2, 4.0 and 4.1, text and binary, with all physical groups.

The layout is that of the Gmsh reference manual, sections "MSH file format" and "Legacy formats".
Each count is compared with the remaining size of the file before memory is allocated.
"""

import dataclasses
from typing import NamedTuple, NoReturn

import numpy as np

from needlefem._arrays import Floats, Ints
from needlefem.mesh.file import CellBlock, Contents, UnreadableMeshError, printable

SAVE_AGAIN = "save it again with Gmsh as version 4.1 or 2.2"
SURFACE = 2
MOST_TAGS = 1000
"""Tags of an element in version 2.2: its group, its entity and its partitions."""


class _Type(NamedTuple):
    """An element type of Gmsh."""

    dim: int
    corners: int
    nodes: int
    order: int


_TYPES = {
    15: _Type(0, 1, 1, 1),
    1: _Type(1, 2, 2, 1), 8: _Type(1, 2, 3, 2), 26: _Type(1, 2, 4, 3), 27: _Type(1, 2, 5, 4),
    28: _Type(1, 2, 6, 5),
    2: _Type(2, 3, 3, 1), 9: _Type(2, 3, 6, 2), 20: _Type(2, 3, 9, 3), 21: _Type(2, 3, 10, 3),
    22: _Type(2, 3, 12, 4), 23: _Type(2, 3, 15, 4), 24: _Type(2, 3, 15, 5), 25: _Type(2, 3, 21, 5),
    3: _Type(2, 4, 4, 1), 16: _Type(2, 4, 8, 2), 10: _Type(2, 4, 9, 2), 39: _Type(2, 4, 12, 3),
    36: _Type(2, 4, 16, 3), 40: _Type(2, 4, 16, 4), 37: _Type(2, 4, 25, 4), 38: _Type(2, 4, 36, 5),
    4: _Type(3, 4, 4, 1), 5: _Type(3, 8, 8, 1), 6: _Type(3, 6, 6, 1), 7: _Type(3, 5, 5, 1),
    11: _Type(3, 4, 10, 2), 12: _Type(3, 8, 27, 2), 13: _Type(3, 6, 18, 2), 14: _Type(3, 5, 14, 2),
    17: _Type(3, 8, 20, 2), 18: _Type(3, 6, 15, 2), 19: _Type(3, 5, 13, 2), 29: _Type(3, 4, 20, 3),
    30: _Type(3, 4, 35, 4), 31: _Type(3, 4, 56, 5),
}  # fmt: skip


def _refuse(problem: str, remedy: str = SAVE_AGAIN) -> NoReturn:
    raise UnreadableMeshError(problem, remedy)


class _Text:
    """Numbers of a section of a text file in sequence."""

    def __init__(self, name: str, body: bytes) -> None:
        self._name, self._at = name, 0
        try:
            self._values = np.array(body.split(), dtype=float)
        except ValueError as error:
            _refuse(f"section ${name} holds something that is not a number ({_told(error)})")

    def table(self, rows: int, *columns: tuple[str, int]) -> list[np.ndarray]:
        """Return the next rows of columns, each (kind, width): "i" int, "s" size, "d" float."""
        width = sum(count for _, count in columns)
        left = len(self._values) - self._at
        if min(rows, *(count for _, count in columns)) < 0 or rows * width > left:
            _refuse(f"section ${self._name} ends too early: the file is cut or damaged")
        end = self._at + rows * width
        values = self._values[self._at : end].reshape(rows, width)
        self._at = end
        found: list[np.ndarray] = []
        for kind, count in columns:
            part, values = values[:, :count], values[:, count:]
            found.append(part if kind == "d" else _whole(part, self._name))
        return found

    def alike(self, width: int, most: int) -> int:
        """Return how many of the next rows have the same second and third number as the first."""
        rest = self._values[self._at :]
        most, step, count = min(most, len(rest) // width), 1, 1
        while count < most:
            step = min(2 * step, most - count)
            rows = rest[count * width : (count + step) * width].reshape(step, width)
            differs = np.any(rows[:, 1:3] != rest[1:3], axis=1)
            if np.any(differs):
                return count + int(np.argmax(differs))
            count += step
        return count

    def back(self, values: int) -> None:
        """Set the position back to an earlier number."""
        self._at -= values


class _Binary:
    """Numbers of a section of a binary file in sequence."""

    def __init__(self, name: str, body: bytes, order: str, size: int) -> None:
        self._name, self._body, self._at = name, body, 0
        self._kinds = {"i": f"{order}i4", "s": f"{order}u{size}", "d": f"{order}f8"}

    def table(self, rows: int, *columns: tuple[str, int]) -> list[np.ndarray]:
        """See `_Text.table`."""
        most = len(self._body)
        if not all(0 <= count <= most for count in (rows, *(count for _, count in columns))):
            _refuse(f"section ${self._name} ends too early: the file is cut or damaged")
        names = [f"f{n}" for n in range(len(columns))]
        shapes = [(self._kinds[kind], (count,)) for kind, count in columns]
        record = np.dtype([(name, *shape) for name, shape in zip(names, shapes, strict=True)])
        if rows * record.itemsize > most - self._at:
            _refuse(f"section ${self._name} ends too early: the file is cut or damaged")
        values = np.frombuffer(self._body, record, rows, self._at)
        self._at += rows * record.itemsize
        return [
            values[name].astype(float if kind == "d" else np.int64)
            for name, (kind, _) in zip(names, columns, strict=True)
        ]

    def line(self) -> str:
        """Return the next line of text: the counts of version 2.2."""
        end = self._body.find(b"\n", self._at)
        end = len(self._body) if end < 0 else end
        text, self._at = self._body[self._at : end], end + 1
        return text.decode("ascii", "replace").strip()


_Section = _Text | _Binary


def _told(error: Exception) -> str:
    return printable(" ".join(str(error).split())[:100])


def _whole(values: Floats, section: str) -> Ints:
    if not np.all(np.abs(values) < 2.0**53) or np.any(values != np.trunc(values)):
        _refuse(f"section ${section} has a fraction where an integer is required")
    return values.astype(np.int64)


def _row(section: _Section, kinds: str) -> list[int]:
    """Return one row of integers, one for each letter of `kinds`."""
    return [int(part[0, 0]) for part in section.table(1, *((kind, 1) for kind in kinds))]


def _list(section: _Section, counted_by: str, kind: str) -> list[int]:
    """Return a list that is preceded by its length."""
    (count,) = _row(section, counted_by)
    if not count:
        return []
    return [int(x) for x in section.table(1, (kind, count))[0][0]]


@dataclasses.dataclass(eq=False)
class _Layout:
    """Format of the file: version, text or binary."""

    version: str
    order: str
    size: int

    def open(self, name: str, body: bytes) -> _Section:
        """Return a section's numbers."""
        return _Binary(name, body, self.order, self.size) if self.order else _Text(name, body)


def is_msh(start: bytes) -> bool:
    """Return whether a file is a Gmsh file, from its first bytes."""
    return b"$MeshFormat" in start or b"$NOD" in start or start.lstrip().startswith(b"$Comments")


def read_msh(data: bytes) -> Contents:
    """Read a Gmsh file.

    Raises
    ------
    UnreadableMeshError
        The version is not supported, the file is damaged, or it is a part of a mesh.
    """
    sections = _sections(data)
    layout = _layout(sections)
    for name in ("Nodes", "Elements"):
        if name not in sections:
            _refuse(f"there is no section ${name}: the file is cut or damaged")
    names = _physical_names(sections.get("PhysicalNames", b""))
    if layout.version == "2.2":
        tags, points = _nodes_2(layout.open("Nodes", sections["Nodes"]))
        blocks = _elements_2(layout.open("Elements", sections["Elements"]))
    else:
        groups, surfaces = _entities(layout, sections)
        tags, points = _nodes_4(layout, layout.open("Nodes", sections["Nodes"]))
        blocks = _elements_4(
            layout, layout.open("Elements", sections["Elements"]), groups, surfaces
        )
    return _contents(tags, points, blocks, names)


def _sections(data: bytes) -> dict[str, bytes]:
    """Return the body of every section, without the first line break."""
    found: dict[str, bytes] = {}
    at = data.find(b"$")
    while at >= 0:
        stop = data.find(b"\n", at)
        name = data[at + 1 : stop if stop >= 0 else len(data)].strip()
        end = data.find(b"$End" + name, stop) if stop >= 0 and name else -1
        shown = printable(name[:40].decode("ascii", "replace"))
        if end < 0:
            _refuse(f"section ${shown} does not end: the file is cut or damaged")
        found.setdefault(shown, data[stop + 1 : end])
        at = data.find(b"$", end + 4 + len(name))
    return found


def _layout(sections: dict[str, bytes]) -> _Layout:
    if "MeshFormat" not in sections:
        _refuse("it is of version 1 of Gmsh's format")
    first, _, rest = sections["MeshFormat"].partition(b"\n")
    parts = first.decode("ascii", "replace").split()
    version = {"2": "2.2", "2.2": "2.2", "4": "4.0", "4.0": "4.0", "4.1": "4.1"}.get(
        parts[0] if parts else ""
    )
    if version is None or len(parts) < 3 or parts[1] not in "01" or parts[2] not in "48":
        _refuse(f"version '{printable(' '.join(parts)[:40])}' of Gmsh's format is not read")
    order = ""
    if parts[1] == "1":
        order = ">" if rest[:4] == b"\0\0\0\1" else "<"
        if rest[:4] not in (b"\0\0\0\1", b"\1\0\0\0"):
            _refuse("it says that it is binary, but the mark of its byte order is damaged")
    return _Layout(version, order, int(parts[2]))


def _physical_names(body: bytes) -> dict[tuple[int, int], str]:
    """Return the names of groups by dimension and number."""
    found = {}
    for line in body.splitlines()[1:]:
        head, quote, rest = line.partition(b'"')
        numbers = head.split()
        if not quote or len(numbers) != 2:
            continue
        try:
            key = int(numbers[0]), abs(int(numbers[1]))
        except ValueError:
            _refuse("section $PhysicalNames is damaged")
        raw = rest.rpartition(b'"')[0]
        try:
            text = raw.decode("utf-8")
        except UnicodeDecodeError:
            text = raw.decode("latin-1")
        if text:
            found[key] = printable(text)
    return found


def _nodes_2(section: _Section) -> tuple[Ints, Floats]:
    rows = _count_2(section)
    tags, points = section.table(rows, ("i", 1), ("d", 3))
    return tags[:, 0], points


def _count_2(section: _Section) -> int:
    if isinstance(section, _Text):
        return _row(section, "i")[0]
    line = section.line()
    if not line.isdigit():
        _refuse("a count is not an integer: the file is damaged")
    return int(line)


def _type(number: int) -> _Type:
    if number not in _TYPES:
        _refuse(f"element type {number} of Gmsh's is not known here")
    return _TYPES[number]


_Block = tuple[_Type, Ints, frozenset[int]]
"""Type, nodes of all elements, shape (n, nodes), and numbers of their physical groups."""


def _elements_2(section: _Section) -> list[_Block]:
    """Return elements by type and group."""
    rows: dict[tuple[int, int], list[Ints]] = {}
    left = _count_2(section)
    while left > 0:
        one, other, ntags = _row(section, "iii")
        number, count = (other, 1) if isinstance(section, _Text) else (one, other)
        if count < 1 or not 0 <= ntags <= MOST_TAGS:
            _refuse("section $Elements is damaged")
        kind = _type(number)
        if isinstance(section, _Text):
            section.back(3)
            count = section.alike(3 + ntags + kind.nodes, left)
        before = 3 if isinstance(section, _Text) else 1
        _, tags, nodes = section.table(count, ("i", before), ("i", ntags), ("i", kind.nodes))
        groups = tags[:, 0] if ntags else np.zeros(count, dtype=np.int64)
        for group in np.unique(groups):
            rows.setdefault((number, int(group)), []).append(nodes[groups == group])
        left -= count
    return [
        (_type(number), np.vstack(nodes), frozenset({abs(group)} - {0}))
        for (number, group), nodes in rows.items()
    ]


def _nodes_4(layout: _Layout, section: _Section) -> tuple[Ints, Floats]:
    new = layout.version == "4.1"
    blocks = _row(section, "ssss" if new else "ss")[0]
    tags, points = [np.zeros(0, dtype=np.int64)], [np.zeros((0, 3))]
    for _ in range(blocks):
        one, other, parametric, rows = _row(section, "iiis")
        width = 3 + ((one if new else other) if parametric else 0)
        if not 3 <= width <= 6:
            _refuse("section $Nodes is damaged")
        if new:
            tags.append(section.table(rows, ("s", 1))[0][:, 0])
            points.append(section.table(rows, ("d", width))[0][:, :3])
        else:
            numbers, places = section.table(rows, ("i", 1), ("d", width))
            tags.append(numbers[:, 0])
            points.append(places[:, :3])
    return np.concatenate(tags), np.vstack(points)


def _elements_4(
    layout: _Layout,
    section: _Section,
    groups: dict[tuple[int, int], frozenset[int]],
    surfaces: set[int],
) -> list[_Block]:
    """Return the blocks of a file; all given partitioned surfaces must have cells."""
    new = layout.version == "4.1"
    found, filled = [], set()
    for _ in range(_row(section, "ssss" if new else "ss")[0]):
        one, other, number, rows = _row(section, "iiis")
        entity = (one, other) if new else (other, one)
        kind = _type(number)
        nodes = section.table(rows, ("s" if new else "i", 1 + kind.nodes))[0][:, 1:]
        found.append((kind, nodes, groups.get(entity, frozenset())))
        filled.add(entity[1] if entity[0] == SURFACE and rows else 0)
    _refuse_part(surfaces, filled)
    return found


def _entities(
    layout: _Layout, sections: dict[str, bytes]
) -> tuple[dict[tuple[int, int], frozenset[int]], set[int]]:
    """Return the group numbers of each entity, and the surfaces of a partitioned mesh.

    Entities are identified by dimension and number.
    """
    found: dict[tuple[int, int], frozenset[int]] = {}
    if "Entities" in sections:
        section = layout.open("Entities", sections["Entities"])
        for dim, count in enumerate(_row(section, "ssss")):
            for _ in range(count):
                (tag,) = _row(section, "i")
                section.table(1, ("d", 3 if dim == 0 and layout.version == "4.1" else 6))
                found[dim, tag] = frozenset(map(abs, _list(section, "s", "i")))
                if dim:
                    _list(section, "s", "i")
    plain = set(found)
    if "PartitionedEntities" in sections:
        if layout.version != "4.1":
            _refuse("it is partitioned, in version 4.0", "save it as version 4.1 or unpartitioned")
        _partitioned(layout.open("PartitionedEntities", sections["PartitionedEntities"]), found)
    return found, {tag for dim, tag in found.keys() - plain if dim == SURFACE}


def _partitioned(section: _Section, found: dict[tuple[int, int], frozenset[int]]) -> None:
    """Add the entities of a partitioned mesh."""
    _, ghosts = _row(section, "ss")
    section.table(ghosts, ("i", 2))
    for dim, count in enumerate(_row(section, "ssss")):
        for _ in range(count):
            tag, _, _ = _row(section, "iii")
            _list(section, "s", "i")
            section.table(1, ("d", 3 if dim == 0 else 6))
            found[dim, tag] = frozenset(map(abs, _list(section, "s", "i")))
            if dim:
                _list(section, "s", "i")


def _refuse_part(partitioned: set[int], filled: set[int]) -> None:
    """Raise an error for a file that names all partitions and contains the cells of some only."""
    missing = partitioned - filled
    if missing:
        problem = f"it has no cells for {len(missing)} of the {len(partitioned)} surfaces of a "
        remedy = "save the whole mesh in one file, with Mesh.PartitionSplitMeshFiles = 0"
        _refuse(problem + "partitioned mesh", remedy)


def _contents(
    tags: Ints, points: Floats, blocks: list[_Block], names: dict[tuple[int, int], str]
) -> Contents:
    order = np.argsort(tags, kind="stable")
    ranked = tags[order]
    twice = np.flatnonzero(ranked[1:] == ranked[:-1])
    if twice.size:
        _refuse(f"node {ranked[twice[0]]} is given twice")
    taken = set(names.values())
    unnamed: dict[tuple[int, int], str] = {}
    cells = []
    for kind, nodes, groups in blocks:
        place = np.minimum(np.searchsorted(ranked, nodes), len(ranked) - 1)
        if nodes.size and (not len(ranked) or np.any(ranked[place] != nodes)):
            lost = nodes[ranked[place] != nodes][0] if len(ranked) else nodes.ravel()[0]
            _refuse(f"a cell has node {lost}, which is not in the file")
        called = set()
        for group in groups:
            key = kind.dim, group
            if key in names:
                called.add(names[key])
            else:
                text = str(group) if str(group) not in taken else f"group {group}"
                called.add(unnamed.setdefault(key, text))
        index = order[place] if nodes.size else nodes
        cells.append(CellBlock(kind.dim, kind.corners, kind.order, index, frozenset(called)))
    filled = {name for block in cells if len(block.nodes) for name in block.groups}
    empty = sorted(set(names.values()) - filled)
    if empty and not filled:
        problem = f"none of its cells is in a physical group, although it names {', '.join(empty)}"
        remedy = "save it as version 4.1, or without 'save all', which empties them in version 2.2"
        _refuse(problem, remedy)
    notes = [f"Physical groups without cells or edges: {', '.join(empty)}."] if empty else []
    for dim, what in ((1, "edges"), (2, "cells")):
        called_so = sorted(text for (found, _), text in unnamed.items() if found == dim)
        if called_so:
            notes.append(
                f"Physical groups of {what} without a name are called by their numbers: "
                + ", ".join(called_so) + "."
            )  # fmt: skip
    return Contents(points, tags, tuple(cells), tuple(notes))
