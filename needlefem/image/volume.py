"""A volume of voxels in the geometry of its file, and checks for all formats."""

import bz2
import dataclasses
import math
import os
import re
import sys
import tempfile
import warnings
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Protocol

import numpy as np

from needlefem._arrays import Floats
from needlefem._inputfile import read_bytes, require_file
from needlefem.errors import CaseError, short

KEY = "--labelmap"
FORMATS = "give a .nrrd, .seg.nrrd, .nii.gz or .mha"
CONVERT = "save it as .nrrd, .nii.gz or .mha (3D Slicer does)"
MOST_VOXELS = 500_000_000
"""Largest number of voxels times layers; several copies fit into the memory of a computer."""
SPACINGS = (1e-7, 0.1)
"""Plausible distances of voxels, m."""
FARTHEST = 100.0
"""Largest plausible coordinate of the scanner's space, m."""
SHEAR = 0.1
"""Largest displacement of a voxel by the orthogonalisation of axes, in its shortest side."""
UNITS = {
    "m": 1.0, "meter": 1.0, "metre": 1.0, "meters": 1.0, "metres": 1.0,
    "cm": 1e-2, "centimeter": 1e-2, "centimetre": 1e-2,
    "mm": 1e-3, "millimeter": 1e-3, "millimetre": 1e-3, "millimeters": 1e-3, "millimetres": 1e-3,
    "um": 1e-6, "µm": 1e-6, "μm": 1e-6, "micron": 1e-6, "microns": 1e-6,
    "micrometer": 1e-6, "micrometre": 1e-6, "micrometers": 1e-6, "micrometres": 1e-6,
    "nm": 1e-9,
}  # fmt: skip
"""Lengths (m) of the units that headers name."""
LPS = {"L": (0, 1.0), "R": (0, -1.0), "P": (1, 1.0), "A": (1, -1.0), "S": (2, 1.0), "I": (2, -1.0)}
"""Axis and sign in the space LPS of every letter of an anatomical space."""
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_WHOLE = re.compile(r"[+-]?\d{1,18}", re.ASCII)


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Volume:
    """Voxels in the space LPS.

    Parameters
    ----------
    values : array, shape (nlayers, nk, nj, ni)
        In the type of the file.
    origin : array, shape (3,), m
        Centre of the first voxel.
    steps : array, shape (3, 3), m
        Rows: from a voxel to the next along i, j and k.
    fields : mapping
        Other information of the header, by key.
    remarks : tuple of str
        Sentences about information that the header does not contain.
    """

    values: np.ndarray
    origin: Floats
    steps: Floats
    fields: Mapping[str, str]
    remarks: tuple[str, ...] = ()

    @property
    def size(self) -> tuple[int, ...]:
        """Numbers of voxels along i, j and k."""
        return self.values.shape[:0:-1]


def refusal(path: Path, problem: str, remedy: str = CONVERT) -> CaseError:
    """Return the error of a file that can't be used."""
    return CaseError(KEY, f"'{path.name}': {problem}", remedy)


def number(text: str, key: str, path: Path) -> float:
    """Return a finite number of a header's key."""
    value = float(text) if _NUMBER.fullmatch(text) else math.nan
    if not math.isfinite(value):
        raise refusal(path, f"{key}: {short(text)} is not a finite number", "correct the header")
    return value


def whole(text: str, key: str, path: Path, low: int | None = None) -> int:
    """Return an integer of a header's key, of at least `low`."""
    if not _WHOLE.fullmatch(text) or (low is not None and int(text) < low):
        least = "" if low is None else f" of at least {low}"
        problem = f"{key}: {short(text)} is not an integer{least}"
        raise refusal(path, problem, "correct the header")
    return int(text)


def unit_of(text: str, key: str, path: Path) -> float:
    """Return the length (m) of a unit of a header's key."""
    known = UNITS.get(text.strip().lower())
    if known is None:
        problem = f"{key}: {short(text)} is not a known unit of length"
        raise refusal(path, problem, "save it in mm")
    return known


def voxel_count(sizes: Sequence[int], path: Path) -> int:
    """Return the product of sizes; too many voxels raise an error."""
    count = math.prod(sizes)
    if count > MOST_VOXELS:
        problem = f"{count:.3g} voxels, of which {MOST_VOXELS:.1g} are the most that is read"
        raise refusal(path, problem, "crop it to the surroundings of the needle")
    return count


def file_bytes(path: Path, most: int = -1) -> bytes:
    """Return the bytes of a regular file, at most `most`."""
    if most < 0:
        return read_bytes(path, KEY, remedy=FORMATS)
    with require_file(path, KEY, remedy=FORMATS).open("rb") as file:
        return file.read(most)


class _Decompressor(Protocol):
    """A decompressor of the standard library."""

    @property
    def eof(self) -> bool: ...

    @property
    def unused_data(self) -> bytes: ...

    def decompress(self, data: bytes, /, max_length: int) -> bytes: ...


def inflated(data: bytes, compression: str, most: int, path: Path, *, whole: bool = True) -> bytes:
    """Return decompressed data, at most `most` bytes and one more.

    Parameters
    ----------
    data : bytes
    compression : str
        ``gzip``, ``zlib`` or ``bzip2``.
    most : int
    path : Path
        Path in error messages.
    whole : bool
        Whether incomplete data are an error.

    Raises
    ------
    CaseError
        The data are damaged or incomplete.
    """
    make: Mapping[str, Callable[[], _Decompressor]] = {
        "gzip": lambda: zlib.decompressobj(31),
        "zlib": zlib.decompressobj,
        "bzip2": bz2.BZ2Decompressor,
    }
    found, left = b"", data
    while left and len(found) <= most:
        stream = make[compression]()
        try:
            found += stream.decompress(left, most + 1 - len(found))
        except (zlib.error, OSError, ValueError, EOFError):
            raise refusal(path, f"its {compression} data are damaged", "save it anew") from None
        if not stream.eof and len(found) <= most and whole:
            problem = f"its {compression} data end early: the file is cut off or damaged"
            raise refusal(path, problem, "copy or save it anew")
        left = stream.unused_data.lstrip(b"\0")
    return found


def array_of(data: bytes, dtype: np.dtype, shape: Sequence[int], path: Path) -> np.ndarray:
    """Return binary data as an array; their number must agree with the header."""
    wanted = voxel_count(shape, path) * dtype.itemsize
    if len(data) != wanted:
        found = f"more than {wanted:,}" if len(data) > wanted else f"{len(data):,}"
        problem = f"it has {found} bytes of voxels, by its header there are {wanted:,}"
        raise refusal(path, problem, "it is cut off or its header is wrong: save it anew")
    return np.frombuffer(data, dtype).reshape(shape)


def array_of_text(data: bytes, dtype: np.dtype, shape: Sequence[int], path: Path) -> np.ndarray:
    """Return numbers in a text as an array; see `array_of`."""
    wanted = voxel_count(shape, path)
    if not re.fullmatch(rb"[\d\s+\-.eE,]*", data):
        raise refusal(path, "its voxels are not numbers", "save it anew")
    words = data.replace(b",", b" ").split()
    if len(words) != wanted:
        problem = f"it has {len(words):,} voxels, by its header there are {wanted:,}"
        raise refusal(path, problem, "it is cut off or its header is wrong: save it anew")
    try:
        values = np.array(words, dtype=float)
        with np.errstate(all="ignore"):
            found = values.astype(dtype)
    except ValueError:
        raise refusal(path, "its voxels are not numbers", "save it anew") from None
    if not np.array_equal(found, values):
        raise refusal(
            path, f"voxels that are not of type {dtype.name}", "correct the header's type"
        )
    return found.reshape(shape)


def check_geometry(volume: Volume, path: Path, key: str) -> tuple[Floats, Floats]:
    """Return the voxels' axes (rows, orthonormal) and their spacing, shapes (3, 3) and (3,), m.

    Raises
    ------
    CaseError
        Spacing or origin are not plausible, or the axes are not perpendicular.
    """
    steps, origin = volume.steps, volume.origin
    with np.errstate(all="ignore"):
        spacing = np.linalg.norm(steps, axis=1)
    low, high = SPACINGS
    if not np.all((spacing >= low) & (spacing <= high)):
        sides = " x ".join(f"{1e3 * x:.3g}" for x in spacing)
        problem = f"{key}: voxels of {sides} mm"
        raise refusal(path, problem, "correct the header (or its unit)")
    if not np.all(np.abs(origin) <= FARTHEST):
        place = ", ".join(f"{1e3 * x:.3g}" for x in origin)
        problem = f"its first voxel is at ({place}) mm"
        raise refusal(path, problem, "correct the header (or its unit)")
    axes = steps / spacing[:, None]
    left, sizes, right = np.linalg.svd(axes)
    straight = left @ right
    reach = np.array(volume.size) * spacing
    moved = float(np.linalg.norm((axes - straight) * reach[:, None], axis=1).sum())
    if sizes[-1] < 1e-3 or moved > SHEAR * spacing.min():
        angles = axes @ axes.T
        worst = math.degrees(math.asin(min(1.0, float(np.abs(angles - np.eye(3)).max()))))
        problem = f"{key}: the voxels' axes are not at right angles (by {worst:.2g} degrees)"
        raise refusal(path, problem, "resample it onto a straight grid")
    return straight, spacing


# Volumes in other formats, read by SimpleITK.


OWN = "give a .nrrd, .seg.nrrd, .nii.gz or .mha (3D Slicer saves these)"
MILLIMETRE = 1e-3
"""Unit of SimpleITK's coordinates, m."""


def read_other(path: Path) -> Volume:
    """Read a volume in another format with SimpleITK.

    Raises
    ------
    CaseError
        SimpleITK is not installed, or does not read it; DICOM, which needs a conversion.
    """
    content = file_bytes(path)
    if content[128:132] == b"DICM":
        problem = "a DICOM file: frames of a DICOM segmentation are not supported as a volume"
        raise refusal(path, problem, "load it in 3D Slicer (or dcmqi) and save it as .seg.nrrd")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # of its wrapper, not of use here
            sitk = import_module("SimpleITK")
    except ModuleNotFoundError:
        problem = f"'{path.name}' is of a format that only SimpleITK may read"
        raise CaseError(KEY, problem, f"pip install 'needlefem[image]', or {OWN}") from None
    with _silent():
        try:
            reader = sitk.ImageFileReader()
            reader.SetFileName(str(path))
            reader.ReadImageInformation()
            voxel_count([int(n) for n in reader.GetSize()], path)
            image = reader.Execute()
        except CaseError:
            raise
        except Exception:  # whatever a foreign reader raises on a damaged file
            raise refusal(path, "can't be read as an image", OWN) from None
    return _volume(sitk, image, path)


class _Image(Protocol):
    """A `SimpleITK.Image`."""

    def GetDimension(self) -> int: ...  # noqa: N802  (SimpleITK's names)

    def GetDirection(self) -> tuple[float, ...]: ...  # noqa: N802

    def GetSpacing(self) -> tuple[float, ...]: ...  # noqa: N802

    def GetOrigin(self) -> tuple[float, ...]: ...  # noqa: N802

    def GetMetaDataKeys(self) -> tuple[str, ...]: ...  # noqa: N802

    def GetMetaData(self, key: str) -> str: ...  # noqa: N802


def _volume(sitk: ModuleType, image: _Image, path: Path) -> Volume:
    if image.GetDimension() != 3:
        problem = f"'{path.name}' has {image.GetDimension()} dimensions"
        raise refusal(path, problem, "save it as a volume (of one slice if need be)")
    values = sitk.GetArrayFromImage(image)
    if values.ndim != 3 or values.dtype.kind not in "iuf":
        raise refusal(path, "it holds colours or vectors", "save one volume of labels")
    axes = np.reshape(image.GetDirection(), (3, 3)).T
    numbers = [*axes.ravel(), *image.GetSpacing(), *image.GetOrigin()]
    if not np.all(np.isfinite(numbers)):
        raise refusal(path, "its geometry is not finite", OWN)
    return Volume(
        values=values[None],
        origin=MILLIMETRE * np.array(image.GetOrigin()),
        steps=MILLIMETRE * np.array(image.GetSpacing())[:, None] * axes,
        fields={key: image.GetMetaData(key) for key in image.GetMetaDataKeys()},
        remarks=(
            f"{path.name} was read by SimpleITK: that its lengths are millimetres and its axes "
            "left, posterior, superior is an assumption.",
        ),
    )


@contextmanager
def _silent() -> Iterator[None]:
    """Keep what a library writes on standard error (beneath Python's own) from the user."""
    sys.stderr.flush()
    kept = os.dup(2)
    try:
        with tempfile.TemporaryFile() as sink:
            os.dup2(sink.fileno(), 2)
            try:
                yield
            finally:
                os.dup2(kept, 2)
    finally:
        os.close(kept)
