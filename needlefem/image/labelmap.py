"""Label maps from files, with their orientation and the names of their segments."""

import dataclasses
import warnings
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from needlefem.arrays import Bools, Floats, Ints
from needlefem.errors import CaseError
from needlefem.frame import Voxels
from needlefem.inputfile import require_file

KEY = "--labelmap"
MOST_LABELS = 256
"""More different values than that are grey values of an image."""
MILLIMETRE = 1e-3
"""Unit of the files' coordinates (NRRD and NIfTI as SimpleITK gives them), m."""
FLIPPED = {"LPS": np.array([1.0, 1.0, 1.0]), "RAS": np.array([-1.0, -1.0, 1.0])}
"""Signs that take SimpleITK's coordinates, which are LPS, to a space."""


@dataclasses.dataclass(frozen=True)
class Segment:
    """A named structure: the voxels of a value, in one of the layers of the file."""

    name: str
    value: int
    layer: int = 0


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class LabelMap:
    """Labels on a grid of voxels.

    Parameters
    ----------
    labels : array of integers, shape (nlayers, nk, nj, ni)
        0 is background. Layers hold segments that overlap.
    voxels : Voxels
        Where they are.
    space : str
        Axes of the scanner's space, ``LPS`` or ``RAS``.
    segments : tuple of Segment
        In the file's order; without names in the file they are called ``label-1`` and so on.
    """

    labels: Ints
    voxels: Voxels
    space: str
    segments: tuple[Segment, ...]

    def mask(self, segment: Segment) -> Bools:
        """Return which voxels belong to a segment, shape (nk, nj, ni)."""
        found: Bools = self.labels[segment.layer] == segment.value
        return found

    def centre(self, segment: Segment) -> Floats:
        """Return the mean of a segment's voxels in the scanner's space, shape (3,), m."""
        numbers = np.argwhere(self.mask(segment)).mean(axis=0)[::-1]
        centre: Floats = self.voxels.points(numbers[None])[0]
        return centre


def read_labelmap(path: str | Path, space: str = "LPS") -> LabelMap:
    """Read a label map: ``.nrrd``, ``.seg.nrrd``, ``.nii.gz``, or what else SimpleITK reads.

    Parameters
    ----------
    path : str or Path
    space : str
        Axes in which places of the scanner are given: ``LPS`` (DICOM) or ``RAS`` (3D Slicer).

    Raises
    ------
    CaseError
        SimpleITK is not installed, or the file can't be read, is no volume, holds no labels.
    """
    path = Path(path)
    image = _image(path)
    layers = _labels(image, path)
    segments = tuple(s for s in _segments(image, layers) if np.any(layers[s.layer] == s.value))
    if not segments:
        raise CaseError(KEY, f"'{path.name}' holds no label but 0", "give one with segments")
    sign = FLIPPED[space]
    voxels = Voxels(
        file=path.name,
        origin=_floats(MILLIMETRE * sign * np.array(image.GetOrigin())),
        axes=tuple(
            _floats(axis) for axis in (sign[:, None] * np.reshape(image.GetDirection(), (3, 3))).T
        ),
        spacing=_floats(MILLIMETRE * np.array(image.GetSpacing())),
        size=tuple(int(n) for n in image.GetSize()),
    )
    return LabelMap(labels=layers, voxels=voxels, space=space, segments=segments)


def _floats(values: Floats) -> tuple[float, ...]:
    return tuple(float(value) + 0.0 for value in values)


def _image(path: Path) -> Any:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # of its wrapper, not of use here
            sitk = import_module("SimpleITK")
    except ModuleNotFoundError:
        remedy = "pip install 'needlefem[image]'"
        raise CaseError(KEY, f"reading '{path.name}' needs SimpleITK", remedy) from None
    require_file(path, KEY, remedy="give a .nrrd, .seg.nrrd or .nii.gz")
    try:
        image = sitk.ReadImage(str(path))
    except RuntimeError:
        problem = f"'{path.name}' can't be read as an image"
        raise CaseError(KEY, problem, "give a .nrrd, .seg.nrrd or .nii.gz") from None
    if image.GetDimension() != 3:
        problem = f"'{path.name}' has {image.GetDimension()} dimensions"
        raise CaseError(KEY, problem, "save it as a volume (of one slice if need be)")
    return image


def _labels(image: Any, path: Path) -> Ints:
    """Return the labels by layer, shape (nlayers, nk, nj, ni)."""
    values = import_module("SimpleITK").GetArrayViewFromImage(image)
    layers = np.moveaxis(values, -1, 0) if values.ndim == 4 else values[None]
    rounded = np.rint(layers)
    odd = layers[layers != rounded]
    if odd.size:
        problem = f"'{path.name}' holds {odd[0]:g}, which is no label"
        raise CaseError(KEY, problem, "give the segmentation, not the image")
    labels: Ints = rounded.astype(np.intp)
    count = len(np.unique(labels))
    if count > MOST_LABELS:
        problem = f"'{path.name}' holds {count} different values"
        raise CaseError(KEY, problem, "give the segmentation, not the image")
    return labels


def _segments(image: Any, layers: Ints) -> list[Segment]:
    """Return the segments that the file names (as 3D Slicer does), or one for every value."""
    said = {key: image.GetMetaData(key).strip() for key in image.GetMetaDataKeys()}
    found: list[Segment] = []
    number = 0
    while (name := said.get(f"Segment{number}_Name")) is not None:
        own = number if len(layers) > 1 and f"Segment{number}_Layer" not in said else 0
        layer = int(said.get(f"Segment{number}_Layer", own))
        value = int(said.get(f"Segment{number}_LabelValue", 1))
        taken = {segment.name for segment in found}
        found.append(Segment(name if name not in taken else f"{name} {number}", value, layer))
        number += 1
    if found:
        return found
    several = len(layers) > 1
    return [
        Segment(f"label-{layer}-{value}" if several else f"label-{value}", int(value), layer)
        for layer, labels in enumerate(layers)
        for value in np.unique(labels)
        if value != 0
    ]
