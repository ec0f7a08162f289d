"""MetaImage files, `.mha` and `.mhd` (https://itk.org/Wiki/ITK/MetaIO/Documentation)."""

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from needlefem.errors import short
from needlefem.image.volume import (
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

TYPES = {
    "MET_CHAR": "i1", "MET_UCHAR": "u1", "MET_SHORT": "i2", "MET_USHORT": "u2", "MET_INT": "i4",
    "MET_UINT": "u4", "MET_LONG_LONG": "i8", "MET_ULONG_LONG": "u8", "MET_FLOAT": "f4",
    "MET_DOUBLE": "f8",
}  # fmt: skip
SAME = {
    "Offset": ("Offset", "Position", "Origin"),
    "TransformMatrix": ("TransformMatrix", "Rotation", "Orientation"),
    "BinaryDataByteOrderMSB": ("BinaryDataByteOrderMSB", "ElementByteOrderMSB"),
}
"""Other names of the same field."""
SQUARE = 1e-3
"""Tolerance for the lengths of directions."""


def read_metaimage(path: Path) -> Volume:
    """Read a MetaImage file.

    Raises
    ------
    CaseError
        The file is damaged, contradicts itself, is incomplete, or is no volume of labels.
    """
    content = file_bytes(path)
    fields, start = _header(content, path)
    if fields.get("ObjectType", "Image") != "Image":
        raise refusal(path, f"ObjectType: {short(fields['ObjectType'])} is not an image")
    count = whole(_said(fields, "NDims", path), "NDims", path, 1)
    sizes = [whole(text, "DimSize", path, 1) for text in _said(fields, "DimSize", path).split()]
    if len(sizes) != count:
        problem = f"NDims says {count}, DimSize has {len(sizes)} numbers"
        raise refusal(path, problem, "correct the header")
    if count != 3:
        problem = f"'{path.name}' has {count} dimensions"
        raise refusal(path, problem, "save it as a volume (of one slice if need be)")
    if whole(fields.get("ElementNumberOfChannels", "1"), "ElementNumberOfChannels", path, 1) > 1:
        problem = f"ElementNumberOfChannels: {fields['ElementNumberOfChannels']}: no labels"
        raise refusal(path, problem, "save one volume of labels, or layers as .seg.nrrd")
    values = _values(fields, content[start:], sizes, path)
    return _placed(fields, values, path)


def _header(content: bytes, path: Path) -> tuple[dict[str, str], int]:
    """Return the fields up to the one that states the place of the voxels, and its end."""
    fields: dict[str, str] = {}
    at = 0
    while "ElementDataFile" not in fields:
        end = content.find(b"\n", at)
        line = content[at : len(content) if end < 0 else end].decode("utf-8", "replace").strip()
        name, equals, value = (part.strip() for part in line.partition("="))
        if line and (not equals or not re.fullmatch(r"[^\0]{1,200}", name)):
            raise refusal(path, f"{short(line)} in its header has no value", "save it anew")
        if line and fields.setdefault(name, value) != value:
            raise refusal(path, f"{short(name)} is given twice", "correct the header")
        if end < 0 and "ElementDataFile" not in fields:
            raise refusal(path, "its header has no 'ElementDataFile'", "save it anew")
        at = len(content) if end < 0 else end + 1
    for name, others in SAME.items():
        said = {fields[other] for other in others if other in fields}
        if len(said) > 1:
            raise refusal(path, f"{name} is given twice", "correct the header")
        if said:
            fields[name] = said.pop()
    return fields, at


def _said(fields: Mapping[str, str], name: str, path: Path) -> str:
    if not fields.get(name):
        raise refusal(path, f"its header has no '{name}'", "correct the header, or save it anew")
    return fields[name]


def _true(fields: Mapping[str, str], name: str, path: Path) -> bool:
    said = fields.get(name, "False").lower()
    if said not in ("true", "false"):
        raise refusal(path, f"{name}: {short(said)} is neither True nor False", "correct it")
    return said == "true"


def _values(fields: Mapping[str, str], rest: bytes, sizes: list[int], path: Path) -> np.ndarray:
    kind = _said(fields, "ElementType", path)
    if kind not in TYPES:
        raise refusal(path, f"ElementType: {short(kind)} holds no labels", "save whole numbers")
    order = ">" if _true(fields, "BinaryDataByteOrderMSB", path) else "<"
    dtype, shape = np.dtype(order + TYPES[kind]), tuple(reversed(sizes))
    most = voxel_count(sizes, path) * dtype.itemsize
    name = _said(fields, "ElementDataFile", path)
    if name.upper().startswith("LIST") or "%" in name:
        raise refusal(path, "its voxels are in several files", "save it in one")
    data = rest if name.upper() == "LOCAL" else file_bytes(path.parent / name)
    skip = whole(fields.get("HeaderSize", "0"), "HeaderSize", path, -1)
    if skip < 0:
        data = data[max(len(data) - most, 0) :]
    data = data[max(skip, 0) :]
    if _true(fields, "CompressedData", path):
        data = inflated(data, "zlib", most, path)
    if not _true(fields, "BinaryData", path) and "BinaryData" in fields:
        return array_of_text(data, dtype, shape, path)
    return array_of(data, dtype, shape, path)


def _placed(fields: Mapping[str, str], values: np.ndarray, path: Path) -> Volume:
    """Return the voxels with the geometry of the header; the space is LPS."""
    words = _said(fields, "ElementSpacing" if "ElementSpacing" in fields else "ElementSize", path)
    spacing = _numbers(words, "ElementSpacing", 3, path)
    if not np.all(spacing > 0.0):
        problem = f"ElementSpacing: {short(words)} are not positive"
        raise refusal(path, problem, "turn an axis by TransformMatrix")
    unit = unit_of(fields.get("DistanceUnits", "mm"), "DistanceUnits", path)
    remarks, axes, origin = [], np.eye(3), np.zeros(3)
    if "TransformMatrix" in fields:
        axes = _numbers(fields["TransformMatrix"], "TransformMatrix", 9, path).reshape(3, 3)
    if "Offset" in fields:
        origin = _numbers(fields["Offset"], "Offset", 3, path)
    missing = [name for name in ("TransformMatrix", "Offset") if name not in fields]
    if missing:
        remarks.append(
            f"The header of {path.name} has no {' and no '.join(missing)}: that axes are left, "
            "posterior, superior and the first voxel at (0, 0, 0) is an assumption."
        )
    with np.errstate(all="ignore"):
        lengths = np.linalg.norm(axes, axis=1)
    if not np.allclose(lengths, 1.0, rtol=0.0, atol=SQUARE):
        problem = f"TransformMatrix: {short(fields['TransformMatrix'])}: no unit vectors"
        raise refusal(path, problem, "correct the header")
    return Volume(
        values=values[None],
        origin=unit * origin,
        steps=unit * spacing[:, None] * axes,
        fields=fields,
        remarks=tuple(remarks),
    )


def _numbers(text: str, key: str, count: int, path: Path) -> np.ndarray:
    words = text.split()
    if len(words) != count:
        raise refusal(path, f"{key}: {short(text)} has not {count} numbers", "correct the header")
    return np.array([number(word, key, path) for word in words])
