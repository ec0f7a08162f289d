"""NRRD files, attached and detached (http://teem.sourceforge.net/nrrd/format.html)."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from needlefem._arrays import Floats
from needlefem.errors import nearest, short
from needlefem.image.volume import (
    LPS,
    Volume,
    array_of,
    array_of_text,
    file_bytes,
    inflated,
    number,
    refusal,
    unit_of,
    voxel_count,
    whole,
)

MAGIC = b"NRRD"
TYPES = {
    "int8": "signed char, int8, int8_t",
    "uint8": "uchar, unsigned char, uint8, uint8_t",
    "int16": "short, short int, signed short, signed short int, int16, int16_t",
    "uint16": "ushort, unsigned short, unsigned short int, uint16, uint16_t",
    "int32": "int, signed int, int32, int32_t",
    "uint32": "uint, unsigned int, uint32, uint32_t",
    "int64": "longlong, long long, long long int, signed long long, signed long long int, int64, "
    "int64_t",
    "uint64": "ulonglong, unsigned long long, unsigned long long int, uint64, uint64_t",
    "float32": "float",
    "float64": "double",
}
"""Names of the field `type`, by the type of the array."""
ENCODINGS = {
    "raw": "raw", "gzip": "gzip", "gz": "gzip", "bzip2": "bzip2", "bz2": "bzip2",
    "txt": "text", "text": "text", "ascii": "text", "hex": "hex",
}  # fmt: skip
SYNONYMS = {
    "centers": "centerings", "axismins": "axis mins", "axismaxs": "axis maxs",
    "datafile": "data file", "lineskip": "line skip", "byteskip": "byte skip",
    "blocksize": "block size", "oldmin": "old min", "oldmax": "old max",
    "sampleunits": "sample units",
}  # fmt: skip
FIELDS = {
    "type", "dimension", "space", "space dimension", "sizes", "spacings", "space directions",
    "space origin", "space units", "kinds", "axis mins", "axis maxs", "centerings", "labels",
    "units", "endian", "encoding", "data file", "line skip", "byte skip", "measurement frame",
    "content", "min", "max", "old min", "old max", "sample units", "thicknesses", "number",
    "block size",
}  # fmt: skip
SPACES = {
    "left-posterior-superior": "LPS", "lps": "LPS", "right-anterior-superior": "RAS",
    "ras": "RAS", "left-anterior-superior": "LAS", "las": "LAS",
}  # fmt: skip
NAMELESS = {"3d-right-handed", "3d-left-handed", "scanner-xyz"}
"""Spaces of three axes that are not anatomical directions."""
LAYERS = {"list", "vector", "none", "???", "stub"}
"""Kinds of an axis along which there are layers of one volume."""
PLACES = {"domain", "space", "none", "???"}
"""Kinds of an axis along which there are voxels."""


def read_nrrd(path: Path) -> Volume:
    """Read a NRRD file.

    Raises
    ------
    CaseError
        The file is damaged, contradicts itself, is incomplete, or is no volume.
    """
    content = file_bytes(path)
    fields, keys, start = _header(content, path)
    sizes = [whole(text, "sizes", path, 1) for text in _words(fields, "sizes", path)]
    if len(sizes) != whole(_said(fields, "dimension", path), "dimension", path, 1):
        problem = f"dimension says {fields['dimension']}, sizes has {len(sizes)} numbers"
        raise refusal(path, problem, "correct the header")
    layer = _layer_axis(fields, len(sizes), path)
    values = _values(fields, content[start:], sizes, path)
    values = values[None] if layer is None else np.moveaxis(values, len(sizes) - 1 - layer, 0)
    places = [axis for axis in range(len(sizes)) if axis != layer]
    steps, origin, remarks = _geometry(fields, [sizes[axis] for axis in places], places, path)
    return Volume(values=values, origin=origin, steps=steps, fields=keys, remarks=remarks)


def _header(content: bytes, path: Path) -> tuple[dict[str, str], dict[str, str], int]:
    """Return the fields, the user's keys, and the end of the header."""
    end = re.search(rb"\r?\n\r?\n", content)
    head = content if end is None else content[: end.start()]
    if b"\0" in head:
        raise refusal(path, "its header has no end", "save it anew")
    first, *lines = re.split(r"\r?\n", _text(head))
    if not re.fullmatch(r"NRRD000[1-5]", first.strip()):
        raise refusal(path, f"{short(first)} is not a known version of NRRD")
    fields: dict[str, str] = {}
    keys: dict[str, str] = {}
    for line in lines:
        if line.startswith("#") or not line.strip():
            continue
        place, colon, text = line.partition(":")
        own, text = text.startswith("="), text.removeprefix("=").strip()
        name = place if own else SYNONYMS.get(place.strip().lower(), place.strip().lower())
        if not colon or (not own and name not in FIELDS):
            problem = f"{short(place)} is not a field of a header"
            raise refusal(path, problem, nearest(name[:40], FIELDS) if colon else "save it anew")
        into = keys if own else fields
        if own:
            text = re.sub(r"\\(n|\\)", lambda found: "\n" if found[1] == "n" else "\\", text)
        if into.setdefault(name, text) != text:
            raise refusal(path, f"{short(name)} is given twice", "correct the header")
    detached = "data file" in fields
    if end is None and not detached:
        raise refusal(path, "its header has no end", "the file is cut off: save it anew")
    return fields, keys, len(content) if end is None else end.end()


def _text(head: bytes) -> str:
    try:
        return head.decode("utf-8")
    except UnicodeDecodeError:
        return head.decode("latin-1")


def _said(fields: Mapping[str, str], name: str, path: Path) -> str:
    if not fields.get(name):
        raise refusal(path, f"its header has no '{name}'", "correct the header, or save it anew")
    return fields[name]


def _words(fields: Mapping[str, str], name: str, path: Path) -> list[str]:
    return _said(fields, name, path).split()


def _listed(fields: Mapping[str, str], name: str, count: int, path: Path) -> list[str] | None:
    """Return the entries of a field with one entry per axis; None if it is missing."""
    if not fields.get(name):
        return None
    text = fields[name]
    pattern = {"space directions": r"none|\([^()]*\)"}.get(name, r'"[^"]*"|[^\s"]+')
    found = re.findall(pattern, text)
    if len(found) != count or re.sub(pattern, "", text).strip():
        problem = f"{name}: {short(text)} has not {count} entries"
        raise refusal(path, problem, "correct the header")
    return [entry.strip('"') for entry in found]


def _layer_axis(fields: Mapping[str, str], count: int, path: Path) -> int | None:
    """Return the number of the axis of layers, or None."""
    kinds = _listed(fields, "kinds", count, path) or ["???"] * count
    kinds = [kind.lower() for kind in kinds]
    directions = _listed(fields, "space directions", count, path)
    if directions is None:
        flat = [kind in PLACES for kind in kinds]
        if count == 4 and all(flat) and "???" in (kinds[0], kinds[-1]):
            flat[0 if kinds[0] == "???" else -1] = False
    else:
        flat = [entry != "none" for entry in directions]
    others = [axis for axis in range(count) if not flat[axis]]
    odd = [kinds[axis] for axis in range(count) if kinds[axis] not in PLACES | LAYERS]
    if odd:
        problem = (
            f"kinds: an axis of kind {short(odd[0])}: no segmentation (colours, vectors, time)"
        )
        raise refusal(path, problem, "give the segmentation, not the image")
    if count - len(others) != 3 or len(others) > 1:
        problem = f"'{path.name}' has {count} dimensions, {count - len(others)} of them in space"
        raise refusal(path, problem, "save it as a volume (of one slice if need be)")
    return others[0] if others else None


def _values(fields: Mapping[str, str], rest: bytes, sizes: Sequence[int], path: Path) -> np.ndarray:
    """Return the samples; the last axis of the file is the first one."""
    said = _said(fields, "type", path).lower()
    kinds = {word: name for name, words in TYPES.items() for word in words.split(", ")}
    if said not in kinds:
        raise refusal(path, f"type: {short(said)} holds no labels", "save whole numbers")
    encoding = ENCODINGS.get(_said(fields, "encoding", path).lower())
    if encoding is None:
        raise refusal(path, f"encoding: {short(fields['encoding'])} is not known")
    dtype = np.dtype(kinds[said])
    if dtype.itemsize > 1 and encoding != "text":
        endian = _said(fields, "endian", path).lower()
        if endian not in ("little", "big"):
            problem = f"endian: {short(endian)} is not known"
            raise refusal(path, problem, "write little or big")
        dtype = dtype.newbyteorder("<" if endian == "little" else ">")
    shape = tuple(reversed(sizes))
    count = voxel_count(shape, path) * dtype.itemsize
    data = _skipped(fields, _stored(fields, rest, path), encoding, count, path)
    if encoding == "text":
        return array_of_text(data, dtype, shape, path)
    if encoding == "hex":
        try:
            data = bytes.fromhex(data.decode("ascii"))
        except ValueError:
            raise refusal(path, "its hex data are damaged", "save it anew") from None
    return array_of(data, dtype, shape, path)


def _stored(fields: Mapping[str, str], rest: bytes, path: Path) -> bytes:
    name = fields.get("data file")
    if name is None:
        return rest
    if name.upper().startswith("LIST") or "%" in name:
        raise refusal(path, "its data are in several files", "save it in one")
    return file_bytes(path.parent / name)


def _skipped(
    fields: Mapping[str, str], data: bytes, encoding: str, count: int, path: Path
) -> bytes:
    """Return the decompressed data after the lines and bytes to be skipped."""
    lines = whole(fields.get("line skip", "0"), "line skip", path, 0)
    skip = whole(fields.get("byte skip", "0"), "byte skip", path, -1)
    parts = data.split(b"\n", lines)
    if len(parts) <= lines:
        raise refusal(path, f"line skip: {lines}, more than there are", "correct the header")
    data = parts[lines]
    if encoding in ("gzip", "bzip2"):
        data = inflated(data, encoding, count + max(skip, 0), path)
    if skip < 0:
        return data[len(data) - count :] if encoding == "raw" and len(data) >= count else data
    return data[skip:]


def _geometry(
    fields: Mapping[str, str], sizes: Sequence[int], places: Sequence[int], path: Path
) -> tuple[Floats, Floats, tuple[str, ...]]:
    """Return steps and origin in LPS, m, and remarks on missing information.

    `places` are the numbers of the axes in space, `sizes` their numbers of voxels.
    """
    count = len(places) + (len(fields["sizes"].split()) > len(places))
    remarks = []
    turned = np.eye(3)
    space = fields.get("space", "").lower()
    if space in SPACES:
        for row, letter in enumerate(SPACES[space]):
            axis, sign = LPS[letter]
            turned[row] = sign * np.eye(3)[axis]
    elif space and space not in NAMELESS:
        problem = f"space: {short(space)} is not a known space with three axes"
        raise refusal(path, problem, "write left-posterior-superior or right-anterior-superior")
    else:
        named = f"only '{space}'" if space else "no 'space'"
        remarks.append(
            f"The header of {path.name} names {named}: that its axes are left, posterior and "
            "superior is an assumption; check the orientation."
        )
    directions = _listed(fields, "space directions", count, path)
    if directions is None:
        steps, origin, more = _spacings(fields, sizes, places, count, path)
        return steps @ turned, origin @ turned, (*remarks, *more)
    factors = _world_units(fields, path)
    steps = np.array([_vector(directions[axis], "space directions", path) for axis in places])
    _check_spacings(fields, steps, places, count, path)
    if "space origin" in fields:
        origin = _vector(fields["space origin"], "space origin", path)
    else:
        origin = np.zeros(3)
        remarks.append(f"The header of {path.name} has no 'space origin': (0, 0, 0) is assumed.")
    return (steps * factors) @ turned, (origin * factors) @ turned, tuple(remarks)


def _vector(text: str, key: str, path: Path) -> Floats:
    inside = re.fullmatch(r"\(([^()]*)\)", text.strip())
    words = [] if inside is None else inside[1].split(",")
    if len(words) != 3:
        raise refusal(path, f"{key}: {short(text)} is not a vector (a,b,c)", "correct the header")
    return np.array([number(word.strip(), key, path) for word in words])


def _world_units(fields: Mapping[str, str], path: Path) -> Floats:
    """Return the lengths (m) of one unit along the axes of the space; mm by default."""
    named = _listed(fields, "space units", 3, path) or ["mm"] * 3
    lengths = [unit_of(text, "space units", path) for text in named]
    for word in re.findall(r'"([^"]+)"', fields.get("units", "")):
        if unit_of(word, "units", path) not in lengths:
            problem = f"units {short(fields['units'])} and space units {' '.join(named)} differ"
            raise refusal(path, problem, "correct the header")
    return np.array(lengths)


def _check_spacings(
    fields: Mapping[str, str], steps: Floats, places: Sequence[int], count: int, path: Path
) -> None:
    """Raise an error for spacings that differ from the lengths of directions; 'nan' is ignored."""
    words = _listed(fields, "spacings", count, path)
    for axis, step in zip(places, steps, strict=True):
        if words is None or words[axis].lower() == "nan":
            continue
        spacing, length = number(words[axis], "spacings", path), float(np.linalg.norm(step))
        if abs(spacing - length) > 1e-3 * length:
            problem = f"spacings says {spacing:g}, space directions {length:g}"
            raise refusal(path, problem, "correct the header")


def _spacings(
    fields: Mapping[str, str], sizes: Sequence[int], places: Sequence[int], count: int, path: Path
) -> tuple[Floats, Floats, list[str]]:
    """Return steps and origin, m, of a file without directions, and remarks."""
    words = _listed(fields, "spacings", count, path)
    if words is None:
        problem = "its header has neither 'space directions' nor 'spacings': voxels of no size"
        raise refusal(path, problem, "save it with its geometry")
    spacing = np.array([number(words[axis], "spacings", path) for axis in places])
    if not np.all(spacing > 0.0):
        problem = f"spacings: {short(fields['spacings'])} are not positive"
        raise refusal(path, problem, "write 'space directions' for an axis that is turned")
    units = _listed(fields, "units", count, path) or ["mm"] * count
    factors = np.array([unit_of(units[axis] or "mm", "units", path) for axis in places])
    origin = np.zeros(3)
    remarks: list[str] = []
    lows = _listed(fields, "axis mins", count, path)
    if "space origin" in fields:
        factors_of_space = _world_units(fields, path)
        return (
            np.diag(spacing * factors),
            _vector(fields["space origin"], "space origin", path) * factors_of_space,
            remarks,
        )
    if lows is None:
        remarks.append(f"The header of {path.name} has no origin: (0, 0, 0) is assumed.")
    else:
        cells = _listed(fields, "centerings", count, path) or ["cell"] * count
        shift = np.array([0.0 if cells[axis] == "node" else 0.5 for axis in places])
        origin = np.array([number(lows[axis], "axis mins", path) for axis in places])
        highs = _listed(fields, "axis maxs", count, path)
        if highs is not None:
            ends = np.array([number(highs[axis], "axis maxs", path) for axis in places])
            spans = (np.array(sizes) - 1.0 + 2.0 * shift) * spacing
            if not np.allclose(ends - origin, spans, rtol=1e-3, atol=0.0):
                problem = "axis mins, axis maxs and spacings differ"
                raise refusal(path, problem, "correct the header")
        origin = origin + shift * spacing
    return np.diag(spacing * factors), origin * factors, remarks
