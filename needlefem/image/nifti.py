"""NIfTI-1 and NIfTI-2 files, one or two, gzipped or not (https://nifti.nimh.nih.gov)."""

import math
import struct
from pathlib import Path

import numpy as np

from needlefem._arrays import Floats
from needlefem.image.volume import (
    Volume,
    array_of,
    file_bytes,
    inflated,
    refusal,
    voxel_count,
)

GZIP = b"\x1f\x8b"
HEADERS = {348: "NIfTI-1", 540: "NIfTI-2"}
"""Formats by the first number of a header, its own size in bytes."""
MAGIC = {b"n+1\0": False, b"ni1\0": True, b"n+2\0\r\n\x1a\n": False, b"ni2\0\r\n\x1a\n": True}
"""Whether the voxels are in a separate file (.img)."""
LAYOUT = {
    348: {
        "dim": (40, "8h"), "datatype": (70, "h"), "bitpix": (72, "h"), "pixdim": (76, "8f"),
        "vox_offset": (108, "f"), "scl_slope": (112, "f"), "scl_inter": (116, "f"),
        "xyzt_units": (123, "B"), "qform_code": (252, "h"), "sform_code": (254, "h"),
        "quatern": (256, "3f"), "qoffset": (268, "3f"), "srow": (280, "12f"),
    },
    540: {
        "datatype": (12, "h"), "bitpix": (14, "h"), "dim": (16, "8q"), "pixdim": (104, "8d"),
        "vox_offset": (168, "q"), "scl_slope": (176, "d"), "scl_inter": (184, "d"),
        "qform_code": (344, "i"), "sform_code": (348, "i"), "quatern": (352, "3d"),
        "qoffset": (376, "3d"), "srow": (400, "12d"), "xyzt_units": (500, "i"),
    },
}  # fmt: skip
"""Offsets and formats of the fields, by the size of the header."""
TYPES = {
    2: "u1", 4: "i2", 8: "i4", 16: "f4", 64: "f8", 256: "i1", 512: "u2", 768: "u4", 1024: "i8",
    1280: "u8",
}  # fmt: skip
COLOURS = {128, 2304}
LENGTHS = {0: 1e-3, 1: 1.0, 2: 1e-3, 3: 1e-6}
"""Lengths (m) of the units in space; 0 is undefined and by custom millimetres."""
CODES = range(6)
TO_LPS = np.array([-1.0, -1.0, 1.0])
"""NIfTI's axes are right, anterior and superior."""
APART = 0.5
"""Largest difference of two statements about a voxel, in the shortest side of a voxel."""
RATIO = 1e-3
"""Largest relative difference of pixdim from the steps of the sform."""


class _Fields:
    """The fields of a header; all are finite except for the scaling."""

    def __init__(self, head: bytes, path: Path) -> None:
        self._path, self._head = path, head
        self.order, self.length = "", 0
        for order in "<>":
            (size,) = struct.unpack(f"{order}i", head[:4]) if len(head) >= 4 else (0,)
            if size in HEADERS and len(head) >= size:
                self.order, self.length = order, size
        if not self.length:
            raise refusal(path, "it does not begin with a header of NIfTI, or ends in it")
        start, stop = (344, 348) if self.length == 348 else (4, 12)
        self.magic = head[start:stop]
        if self.magic not in MAGIC:
            problem = "its header is Analyze's or damaged (no 'magic' of NIfTI): no orientation"
            raise refusal(path, problem)

    def __getitem__(self, name: str) -> tuple[float, ...]:
        start, kind = LAYOUT[self.length][name]
        found = struct.unpack_from(self.order + kind, self._head, start)
        if not name.startswith("scl_") and not all(math.isfinite(x) for x in found):
            raise refusal(self._path, f"{name}: {found} is not finite", "correct the header")
        return found

    def whole(self, name: str) -> int:
        """Return a field that is one integer."""
        value = self[name][0]
        if value != int(value):
            raise refusal(self._path, f"{name}: {value} is not an integer", "correct the header")
        return int(value)


def read_nifti(path: Path) -> Volume:
    """Read a NIfTI file.

    Raises
    ------
    CaseError
        The file is damaged, contradicts itself, is incomplete, or is no volume of labels.
    """
    packed = file_bytes(path)
    content = inflated(packed, "gzip", 540, path, whole=False) if _zipped(packed) else packed
    fields = _Fields(content, path)
    sizes, dtype = _sizes(fields, path), _dtype(fields, path)
    start = fields.whole("vox_offset")
    own = MAGIC[fields.magic]
    if start < (0 if own else fields.length):
        raise refusal(path, f"vox_offset: {start} lies in the header", "correct the header")
    most = start + voxel_count(sizes, path) * dtype.itemsize
    stored = path if not own else _beside(path)
    packed = file_bytes(stored) if own else packed
    data = inflated(packed, "gzip", most, stored) if _zipped(packed) else packed
    values = array_of(data[start:], dtype, tuple(reversed(sizes)), stored)
    steps, origin, remarks = _geometry(fields, sizes, path)
    return Volume(
        values=_scaled(fields, values, path)[None],
        origin=origin * TO_LPS,
        steps=steps * TO_LPS,
        fields={},
        remarks=remarks,
    )


def _zipped(content: bytes) -> bool:
    return content.startswith(GZIP)


def _beside(path: Path) -> Path:
    """Return the file with the voxels, if the header is in a separate file."""
    plain = path.with_suffix("") if path.suffix == ".gz" else path
    names = [plain.with_suffix(".img"), plain.with_suffix(".img.gz")]
    return next((name for name in names if name.is_file()), names[0])


def _sizes(fields: _Fields, path: Path) -> list[int]:
    count, *sizes = (int(n) for n in fields["dim"])
    if not 1 <= count <= 7 or min(sizes[:count]) < 1:
        raise refusal(path, f"dim: {[count, *sizes]} are not valid sizes", "correct the header")
    used = sizes[:count]
    if count < 3:
        problem = f"'{path.name}' has {count} dimensions"
        raise refusal(path, problem, "save it as a volume (of one slice if need be)")
    if any(n > 1 for n in used[3:]):
        problem = f"dim: {' x '.join(str(n) for n in used)}: several volumes (time, vectors)"
        raise refusal(path, problem, "save one volume of labels")
    return used[:3]


def _dtype(fields: _Fields, path: Path) -> np.dtype:
    code, bits = fields.whole("datatype"), fields.whole("bitpix")
    if code not in TYPES:
        what = "colours" if code in COLOURS else "no labels"
        raise refusal(path, f"datatype: {code} holds {what}", "save whole numbers")
    dtype = np.dtype(fields.order + TYPES[code])
    if bits != 8 * dtype.itemsize:
        problem = f"bitpix says {bits}, datatype {code} has {8 * dtype.itemsize}"
        raise refusal(path, problem, "correct the header")
    return dtype


def _scaled(fields: _Fields, values: np.ndarray, path: Path) -> np.ndarray:
    """Return values with the header's scaling; a slope of 0 or NaN means no scaling."""
    slope, intercept = fields["scl_slope"][0], fields["scl_inter"][0]
    if slope == 0.0 or math.isnan(slope) or (slope == 1.0 and intercept == 0.0):
        return values
    if not math.isfinite(slope) or not math.isfinite(intercept):
        problem = f"scl_slope, scl_inter: {slope}, {intercept} are not finite"
        raise refusal(path, problem, "correct the header")
    return slope * values.astype(float) + intercept


def _geometry(
    fields: _Fields, sizes: list[int], path: Path
) -> tuple[Floats, Floats, tuple[str, ...]]:
    """Return steps and origin in RAS, m, and remarks on missing information."""
    code = fields.whole("xyzt_units") & 7
    if code not in LENGTHS:
        raise refusal(path, f"xyzt_units: {code} is not a unit of length", "correct the header")
    unit = LENGTHS[code]
    codes = {name: fields.whole(name) for name in ("qform_code", "sform_code")}
    for name, value in codes.items():
        if value not in CODES:
            raise refusal(path, f"{name}: {value} is not known", "correct the header")
    sides = np.array(fields["pixdim"][1:4])
    if not np.all(sides > 0.0):
        problem = f"pixdim: {sides.tolist()} are not valid voxel sizes"
        raise refusal(path, problem, "correct the header")
    said: dict[str, tuple[Floats, Floats]] = {}
    if codes["sform_code"]:
        said["sform"] = _sform(fields, sides, path)
    if codes["qform_code"]:
        said["qform"] = _qform(fields, sides, path)
    if not said:
        remark = (
            f"The header of {path.name} does not state the orientation (qform_code and sform_code "
            "are 0): that i, j, k go right, anterior, superior from (0, 0, 0) is an assumption."
        )
        return unit * np.diag(sides), np.zeros(3), (remark,)
    if len(said) == 2:
        _check_same(said, sizes, sides, path)
    steps, origin = next(iter(said.values()))
    return unit * steps, unit * origin, ()


def _sform(fields: _Fields, sides: Floats, path: Path) -> tuple[Floats, Floats]:
    rows = np.reshape(fields["srow"], (3, 4))
    steps, origin = rows[:, :3].T, rows[:, 3]
    with np.errstate(all="ignore"):
        lengths = np.linalg.norm(steps, axis=1)
    if not np.allclose(lengths, sides, rtol=RATIO, atol=0.0):
        problem = f"sform has voxels of {_sides(lengths)}, pixdim of {_sides(sides)}"
        raise refusal(path, problem, "correct the header, or save it anew")
    return steps, origin


def _qform(fields: _Fields, sides: Floats, path: Path) -> tuple[Floats, Floats]:
    b, c, d = fields["quatern"]
    rest = 1.0 - (b * b + c * c + d * d)
    if not rest > -1e-4:
        problem = f"quatern_b, c, d: {b:g}, {c:g}, {d:g} are not a rotation"
        raise refusal(path, problem, "correct the header")
    a = math.sqrt(max(rest, 0.0))
    turn = np.array([
        [a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (b * d + a * c)],
        [2 * (b * c + a * d), a * a + c * c - b * b - d * d, 2 * (c * d - a * b)],
        [2 * (b * d - a * c), 2 * (c * d + a * b), a * a + d * d - b * b - c * c],
    ])  # fmt: skip
    factor = fields["pixdim"][0]
    if factor not in (-1.0, 0.0, 1.0):
        raise refusal(path, f"pixdim[0]: {factor:g} is neither 1 nor -1", "correct the header")
    turn = turn @ np.diag([1.0, 1.0, -1.0 if factor < 0.0 else 1.0])
    return turn.T * sides[:, None], np.array(fields["qoffset"])


def _check_same(
    said: dict[str, tuple[Floats, Floats]], sizes: list[int], sides: Floats, path: Path
) -> None:
    """Raise an error for an sform and a qform with different corners of the grid."""
    ends = np.array(np.meshgrid(*[(0.0, n - 1.0) for n in sizes])).reshape(3, -1).T
    one, other = (ends @ steps + origin for steps, origin in said.values())
    apart = float(np.linalg.norm(one - other, axis=1).max())
    if not apart <= APART * sides.min():
        problem = f"sform and qform put voxels {apart:.3g} apart (in the header's unit)"
        raise refusal(path, problem, "set the code of the one that is wrong to 0")


def _sides(values: Floats) -> str:
    return " x ".join(f"{x:.4g}" for x in values)
