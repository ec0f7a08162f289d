"""Defects of files: in bytes, lines and numbers, in the values of a tree, in paths."""

import json
import os
import re
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from needlefem.stress.drawncase import toml_lines

Random = np.random.Generator

CODE = "needlefem_stress_canary:Law"
"""Name of code in a module that must never be imported."""
PATHS = (
    "../escaped.csv", "../../../../../../etc/passwd", "/etc/hostname", "", ".", "..", "/dev/zero",
    "/dev/null", "fifo", "loop", "folder", "~", "~root/x", "none.csv", "x" * 300, "a\x00b",
    "organ.csv/", "./organ.csv", "//organ.csv", "file://organ.csv", "link.csv", "case.toml",
    "Organ.CSV", "organ.csv ", "Köln/ü.csv", "\U0001f489.csv", "con\nsole.csv", CODE,
    "http://localhost/x.csv",
)  # fmt: skip
"""Replacements of file names; some of these files exist."""
TEXTS = (
    "", " ", "?", "nan", "inf", "-inf", "1e400 cm", "-1 cm", "0 cm", "nan cm", "inf cm", "1 kPa",
    "1 cm", "1 parsec", "1,5 cm", "1cm", "one cm", "1 cm 2", "1e-300 m", "1e300 m", "1 um",
    "0x10 mm", "1_000 mm", "\u0661 cm", "1\u00a0cm", "1 \u00b5m", "\x00", "\x1b[31mred", "a\nb\nc",
    "\u202egnp.x", "\U0001f489", "e\u0301", "../../x", "/tmp/x", "x" * 100_000, "'", '"', "%s%n",
    "{0.__class__}", "$(touch escaped)", "; touch escaped", "background", "y_min", "__class__",
    CODE,
)  # fmt: skip
NUMBERS = (
    0, -1, 1, 2, 3, 10**6, 10**12, 10**30, -(10**30), 2**31, 2**63, 0.0, -0.0, 1e-300, 1e300,
    -1e300, 0.5, 1e-6, float("nan"), float("inf"), float("-inf"), True, False,
)  # fmt: skip
SHAPES: tuple[object, ...] = (
    [], {}, [[]], [{}], [1, 2], ["1 cm", "2 cm"], ["1 cm"], ["a", 1, True], [[1, 2], [3, 4]],
    {"x": 1}, [0.0, 0.0], [float("nan"), 1.0], ["1 cm", "2 cm", "3 cm"], [5000, 5000],
    ["y_min"] * 9, [1] * 1000, {"file": "mesh.msh", "unit": "1 mm"},
    {"contour": "organ.csv", "material": "fat"},
)  # fmt: skip
NAMES = (
    "", " ", "a b", "a/b", "../x", "a.b", '"', "ü", "\U0001f489", "background", "x" * 300, "a\nb",
    "A", "y_min", "None", "0", "\x7f", "con", "..", "tip", "__init__",
)  # fmt: skip


def damage(random: Random, folder: Path, name: str) -> str:
    """Apply one to three defects to a file in a folder; return their descriptions."""
    done = []
    count = int(random.choice([1, 2, 3], p=[0.7, 0.2, 0.1]))
    for _ in range(count):
        file = folder / name
        if not file.is_file() or file.is_symlink():
            break
        done.append(_damage_once(random, file))
    return "; ".join(done)


def _damage_once(random: Random, file: Path) -> str:
    kinds: list[tuple[Callable[[Random, Path], str], float]] = [
        (_bytes, 2.0), (_lines, 2.0), (_numbers, 2.5), (_whole, 1.0), (_encoding, 0.7),
    ]  # fmt: skip
    if file.suffix in (".toml", ".json"):
        kinds.append((_tree, 14.0))
    if file.suffix == ".csv":
        kinds.append((_table, 4.0))
    weights = np.array([weight for _, weight in kinds])
    chosen = int(random.choice(len(kinds), p=weights / weights.sum()))
    return kinds[chosen][0](random, file)


def _bytes(random: Random, file: Path) -> str:
    """Change, remove, insert or repeat bytes."""
    content = bytearray(file.read_bytes())
    if not content:
        return "left empty"
    kind = str(random.choice(["flip", "truncate", "insert", "repeat", "zero"]))
    at = int(random.integers(len(content)))
    if kind == "flip":
        for where in random.integers(len(content), size=int(random.integers(1, 9))):
            content[where] ^= 1 << int(random.integers(8))
    elif kind == "truncate":
        del content[at:]
    elif kind == "insert":
        content[at:at] = random.bytes(int(random.integers(1, 64)))
    elif kind == "repeat":
        end = min(len(content), at + int(random.integers(1, 400)))
        content[at:at] = content[at:end] * int(random.integers(1, 4))
    else:
        end = min(len(content), at + int(random.integers(1, 64)))
        content[at:end] = bytes(end - at)
    file.write_bytes(bytes(content))
    return f"bytes: {kind} at {at}"


def _lines(random: Random, file: Path) -> str:
    """Delete, repeat, exchange or move lines."""
    lines = file.read_bytes().split(b"\n")
    kind = str(random.choice(["delete", "repeat", "swap", "blank", "shuffle", "comment"]))
    first, second = random.integers(len(lines), size=2).tolist()
    if kind == "delete":
        del lines[first : first + int(random.integers(1, 6))]
    elif kind == "repeat":
        lines[second:second] = [lines[first]] * int(random.integers(1, 5))
    elif kind == "swap":
        lines[first], lines[second] = lines[second], lines[first]
    elif kind == "blank":
        lines[first:first] = [b""] * int(random.integers(1, 4))
    elif kind == "shuffle":
        order = random.permutation(len(lines)).tolist()
        lines = [lines[number] for number in order]
    else:
        lines[first] = b"# " + lines[first]
    file.write_bytes(b"\n".join(lines))
    return f"lines: {kind} {first}"


def _numbers(random: Random, file: Path) -> str:
    """Replace a number in the text."""
    content = file.read_bytes()
    found = list(re.finditer(rb"[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?", content))
    if not found:
        return _bytes(random, file)
    match = found[int(random.integers(len(found)))]
    other = str(random.choice([
        "0", "-1", "1", "2", "7", "99999999", "999999999999999999999", "-999999999", "1e308",
        "1e-308", "nan", "inf", "-inf", "0.5", "1,5", "x", "", "0x1F", "1e999",
        "4294967296", "\u0663",
    ]))  # fmt: skip
    file.write_bytes(content[: match.start()] + other.encode() + content[match.end() :])
    return f"number {match.group().decode()} at {match.start()} -> {other!r}"


def _whole(random: Random, file: Path) -> str:
    """Replace the file by an empty one, a folder, a link, a pipe or another file."""
    kind = str(random.choice([
        "missing", "empty", "folder", "fifo", "loop", "dangling", "zeros", "noise", "other",
        "device",
    ]))  # fmt: skip
    others = [path for path in sorted(file.parent.iterdir()) if path.is_file() and path != file]
    content = b"" if not others else others[int(random.integers(len(others)))].read_bytes()
    file.unlink()
    if kind == "empty":
        file.write_bytes(b"")
    elif kind == "folder":
        file.mkdir()
    elif kind == "fifo":
        os.mkfifo(file)
    elif kind == "loop":
        file.symlink_to(file.name)
    elif kind == "dangling":
        file.symlink_to("nowhere")
    elif kind == "zeros":
        file.write_bytes(bytes(2000))
    elif kind == "noise":
        file.write_bytes(random.bytes(2000))
    elif kind == "other":
        file.write_bytes(content)
    elif kind == "device":
        file.symlink_to("/dev/zero")
    return f"file: {kind}"


def _encoding(random: Random, file: Path) -> str:
    """Write the text with another encoding, other line ends, or a byte-order mark."""
    kind = str(random.choice(["utf-16", "utf-8-sig", "crlf", "cr", "latin-1", "no end"]))
    content = file.read_bytes()
    if kind in ("utf-16", "utf-8-sig"):
        content = content.decode("latin-1").encode(kind)
    elif kind == "crlf":
        content = content.replace(b"\n", b"\r\n")
    elif kind == "cr":
        content = content.replace(b"\n", b"\r")
    elif kind == "latin-1":
        content = content.replace(b"e", b"\xe9", 1)
    else:
        content = content.rstrip(b"\n")
    file.write_bytes(content)
    return f"encoding: {kind}"


def _table(random: Random, file: Path) -> str:
    """Apply a typical mistake of a user to a CSV file."""
    lines = file.read_text(encoding="utf-8", errors="replace").splitlines()
    if len(lines) < 3:
        return _lines(random, file)
    head, rows = lines[0], lines[1:]
    kind = str(random.choice([
        "semicolons", "decimal commas", "no header", "no units", "other units", "three columns",
        "one column", "repeated corners", "crossed", "one corner", "two corners", "many corners",
        "long field", "quotes", "tabs", "reversed", "far", "tiny", "on a line", "axes swapped",
    ]))  # fmt: skip
    head, rows = _other_text(kind, head, rows)
    rows = _other_corners(random, kind, rows)
    file.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    return f"table: {kind}"


def _other_text(kind: str, head: str, rows: list[str]) -> tuple[str, list[str]]:
    """Return header and rows in another notation."""
    heads = {"no units": "y, z", "other units": "y [mm], z [furlong]",
             "axes swapped": "z [cm], y [cm]", "three columns": head + ", x [cm]",
             "semicolons": head.replace(",", ";")}  # fmt: skip
    ways: dict[str, Callable[[str], str]] = {
        "semicolons": lambda row: row.replace(",", ";"),
        "decimal commas": lambda row: row.replace(",", ";").replace(".", ","),
        "three columns": lambda row: row + ", 0",
        "one column": lambda row: row.split(",")[0],
        "tabs": lambda row: row.replace(",", "\t"),
    }
    if kind == "no header":
        return rows[0], rows[1:]
    way = ways.get(kind, str)
    return heads.get(kind, head), [way(row) for row in rows]


def _other_corners(random: Random, kind: str, rows: list[str]) -> list[str]:
    """Return rows with changed vertices."""
    at, other = random.integers(len(rows), size=2).tolist()
    factors = {"far": 1e6, "tiny": 1e-9, "on a line": 0.0}
    if kind in factors:
        return [f"{factors[kind]} , {row.split(',')[-1]}" for row in rows]
    if kind in ("one corner", "two corners"):
        return rows[: 1 if kind == "one corner" else 2]
    if kind == "many corners":
        return [f"{x!r}, {y!r}" for x, y in _wavy(random).tolist()]
    if kind == "repeated corners":
        return [*rows[:at], *[rows[at]] * 3, *rows[at:]]
    if kind == "crossed":
        rows[at], rows[other] = rows[other], rows[at]
    elif kind == "long field":
        rows[at] = "1" * 100_000 + ", 0"
    elif kind == "quotes":
        rows[at] = '"' + rows[at]
    return rows[::-1] if kind == "reversed" else rows


def _wavy(random: Random) -> np.ndarray:
    count = int(random.choice([2000, 20_000]))
    turn = 2.0 * np.pi * np.arange(count) / count
    radius = 0.9 + 0.1 * np.cos(int(random.integers(3, 60)) * turn)
    return np.stack([0.02 + 0.01 * radius * np.cos(turn), 0.018 + 0.01 * radius * np.sin(turn)], 1)


def _tree(random: Random, file: Path) -> str:
    """Change a value, a name or a table of a TOML or JSON file."""
    text = file.read_text(encoding="utf-8", errors="replace")
    try:
        tree = tomllib.loads(text) if file.suffix == ".toml" else json.loads(text)
    except ValueError:
        return _lines(random, file)
    if not isinstance(tree, dict):
        return _lines(random, file)
    places = list(_places(tree))
    if not places:
        return _lines(random, file)
    parent, key, path = places[int(random.integers(len(places)))]
    kind = str(random.choice(
        ["value", "delete", "rename", "swap", "copy", "add"], p=[0.68, 0.1, 0.08, 0.05, 0.04, 0.05]
    ))  # fmt: skip
    said = f"{kind} {path}"
    if kind == "delete":
        del parent[key]
    elif kind == "rename" and isinstance(parent, dict):
        name = str(random.choice(NAMES))
        parent[name] = parent.pop(key)
        said += f" -> {name!r}"
    elif kind == "swap":
        other, name, there = places[int(random.integers(len(places)))]
        parent[key], other[name] = json_copy(other[name]), json_copy(parent[key])
        said += f" with {there}"
    elif kind == "copy":
        other, name, there = places[int(random.integers(len(places)))]
        parent[key] = json_copy(other[name])
        said += f" from {there}"
    elif kind == "add" and isinstance(parent, dict):
        name = str(random.choice(NAMES))
        parent[name] = _value(random, path)
        said += f" {name!r}"
    else:
        parent[key] = _value(random, path)
        said = f"value {path} -> {_short(parent[key])}"
    written = json.dumps(tree) if file.suffix == ".json" else "\n".join(toml_lines(tree))
    file.write_text(written + "\n", encoding="utf-8", errors="surrogatepass")
    return said


def json_copy(value: object) -> object:
    """Return a copy of a tree."""
    if isinstance(value, dict):
        return {key: json_copy(item) for key, item in value.items()}
    return [json_copy(item) for item in value] if isinstance(value, list) else value


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) < 60 else f"{text[:50]}... ({len(text)} characters)"


def _places(node: object, path: str = "") -> Iterator[tuple[Any, Any, str]]:
    """Yield (parent, key, dotted path) of the values in a tree; of long lists only a part."""
    items: Iterable[tuple[object, object]] = ()
    if isinstance(node, Mapping):
        items = node.items()
    elif isinstance(node, list):
        items = list(enumerate(node))[:6]
    for key, value in items:
        own = f"{path}.{key}" if path else str(key)
        yield node, key, own
        yield from _places(value, own)


def _value(random: Random, path: str) -> object:
    """Return a value of a wrong type, or a wrong value of the correct type."""
    names_file = path.rpartition(".")[2] in ("contour", "file", "source", "folder")
    kind = str(random.choice(["text", "number", "shape", "path"], p=[0.4, 0.3, 0.2, 0.1]))
    if kind == "path" or (names_file and random.random() < 0.7):
        return str(random.choice(PATHS))
    if kind == "text":
        return TEXTS[int(random.integers(len(TEXTS)))]
    if kind == "number":
        return NUMBERS[int(random.integers(len(NUMBERS)))]
    return json_copy(SHAPES[int(random.integers(len(SHAPES)))])
