"""Label maps from files, with their orientation and the names of their segments."""

import dataclasses
import re
from collections.abc import Mapping
from itertools import count
from pathlib import Path

import numpy as np

from needlefem._arrays import Bools, Floats, Ints
from needlefem._progress import doing
from needlefem.errors import short
from needlefem.geometry.image_frame import Voxels
from needlefem.image.metaimage import read_metaimage
from needlefem.image.nifti import GZIP, read_nifti
from needlefem.image.nrrd import MAGIC, read_nrrd
from needlefem.image.volume import (
    Volume,
    check_geometry,
    file_bytes,
    read_other,
    refusal,
    whole,
)

MOST_LABELS = 256
"""Largest number of different values of a label map; a file with more is a grey image."""
LARGEST_LABEL = 2**31
FLIPPED = {"LPS": np.array([1.0, 1.0, 1.0]), "RAS": np.array([-1.0, -1.0, 1.0])}
"""Signs for the conversion of LPS coordinates to a space."""
SEGMENTATION = "give the segmentation, not the image"
NAMED = re.compile(r"Segment(\d{1,6})_(ID|Name|LabelValue|Layer)", re.ASCII)


@dataclasses.dataclass(frozen=True)
class Segment:
    """A named structure: the voxels with a value, in one of the layers of the file."""

    name: str
    value: int
    layer: int = 0


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class LabelMap:
    """Labels on a grid of voxels.

    Parameters
    ----------
    labels : array of integers, shape (nlayers, nk, nj, ni)
        0 is background. Several layers contain overlapping segments.
    voxels : Voxels
        Positions of the voxels.
    space : str
        Axes of the scanner's space, ``LPS`` or ``RAS``.
    segments : tuple of Segment
        In the order of the file, with unique names; unnamed ones are ``label-1`` etc.
    remarks : tuple of str
        Sentences about information that the header does not contain.
    """

    labels: Ints
    voxels: Voxels
    space: str
    segments: tuple[Segment, ...]
    remarks: tuple[str, ...] = ()

    def mask(self, segment: Segment) -> Bools:
        """Return whether voxels belong to a segment, shape (nk, nj, ni)."""
        found: Bools = self.labels[segment.layer] == segment.value
        return found

    def centre(self, segment: Segment) -> Floats:
        """Return the mean of a segment's voxels in the scanner's space, shape (3,), m."""
        numbers = np.argwhere(self.mask(segment)).mean(axis=0)[::-1]
        centre: Floats = self.voxels.points(numbers[None])[0]
        return centre


def read_labelmap(path: str | Path, space: str = "LPS") -> LabelMap:
    """Read a label map: NRRD, NIfTI, MetaImage, or another format of SimpleITK.

    Parameters
    ----------
    path : str or Path
    space : str
        Axes of scanner coordinates: ``LPS`` (DICOM) or ``RAS`` (3D Slicer).

    Raises
    ------
    CaseError
        The file can't be read, contradicts itself, is no volume, or contains no labels.
    """
    path = Path(path)
    doing("reading the label map")
    volume, key = _volume(path)
    axes, spacing = check_geometry(volume, path, key)
    layers = _labels(volume, path)
    segments, remarks = _segments(volume, layers, path)
    sign = FLIPPED[space]
    voxels = Voxels(
        file=path.name,
        origin=_floats(sign * volume.origin),
        axes=tuple(_floats(sign * axis) for axis in axes),
        spacing=_floats(spacing),
        size=volume.size,
    )
    return LabelMap(
        labels=layers,
        voxels=voxels,
        space=space,
        segments=segments,
        remarks=(*volume.remarks, *remarks),
    )


def _floats(values: Floats) -> tuple[float, ...]:
    return tuple(float(value) + 0.0 for value in values)


def _volume(path: Path) -> tuple[Volume, str]:
    """Return a file's volume and the header's name of its geometry, by the content of the file.

    The suffix of the file may be that of another format.
    """
    begin = file_bytes(path, 4096)
    name = path.name.lower()
    if begin.startswith(MAGIC):
        return read_nrrd(path), "space directions"
    sizes = (b"\x5c\1\0\0", b"\0\0\1\x5c", b"\x1c\2\0\0", b"\0\0\2\x1c")
    if begin.startswith((GZIP, *sizes)) or name.endswith((".nii", ".nii.gz", ".hdr")):
        return read_nifti(path), "sform or qform"
    lines = {line.partition(b"=")[0].strip() for line in begin.splitlines()}
    if name.endswith((".mha", ".mhd")) or {b"NDims", b"DimSize"} <= lines:
        return read_metaimage(path), "TransformMatrix"
    if name.endswith((".nrrd", ".nhdr")):
        raise refusal(path, "it does not begin as NRRD does", "copy or save it anew")
    return read_other(path), "directions"


def _labels(volume: Volume, path: Path) -> Ints:
    """Return the labels by layer, shape (nlayers, nk, nj, ni)."""
    layers = volume.values
    if layers.dtype.kind == "f":
        rounded = np.rint(layers)
        with np.errstate(invalid="ignore"):
            odd = layers[~(layers == rounded) | ~(np.abs(layers) < LARGEST_LABEL)]
        if odd.size:
            raise refusal(path, f"it holds {odd[0]:g}, which is not a label", SEGMENTATION)
        layers = rounded.astype(np.int64)
    found = np.unique(np.concatenate([np.unique(part) for layer in layers for part in layer]))
    if len(found) > MOST_LABELS:
        raise refusal(path, f"it holds {len(found)} different values", SEGMENTATION)
    if found[0] < -LARGEST_LABEL or found[-1] >= LARGEST_LABEL:
        worst = found[0] if found[0] < -LARGEST_LABEL else found[-1]
        raise refusal(path, f"it holds {worst}, which is not a label", SEGMENTATION)
    if not np.any(found):
        raise refusal(path, "it contains no label other than 0", "give one with segments")
    labels: Ints = layers
    return labels


def _segments(
    volume: Volume, layers: Ints, path: Path
) -> tuple[tuple[Segment, ...], tuple[str, ...]]:
    """Return the segments with voxels, named ones first, and remarks.

    3D Slicer names them ``SegmentN_Name``; the name of an unnamed value contains its number.
    """
    present = [
        (layer, int(value))
        for layer, labels in enumerate(layers)
        for value in np.unique(labels)
        if value != 0
    ]
    named = _named(volume.fields, len(layers), path)
    remarks = [
        f"Segment {short(name)} holds no voxel." for at, name in named.items() if at not in present
    ]
    if named:
        remarks += [
            f"Value {value} of {path.name} has no name there: it is called label-{value}."
            for layer, value in present
            if (layer, value) not in named
        ]
    several = len(layers) > 1
    plain = {at: f"label-{at[0]}-{at[1]}" if several else f"label-{at[1]}" for at in present}
    order = [at for at in named if at in present] + [at for at in present if at not in named]
    found: dict[str, Segment] = {}
    for layer, value in order:
        own = named.get((layer, value), plain[layer, value])
        others = (f"{own} {number}" for number in count(2))
        name = own if own not in found else next(other for other in others if other not in found)
        found[name] = Segment(name, value, layer)
    return tuple(found.values()), tuple(remarks)


def _named(fields: Mapping[str, str], layers: int, path: Path) -> dict[tuple[int, int], str]:
    """Return the names in a header by layer and value, in the order of their numbers."""
    said: dict[int, dict[str, str]] = {}
    for key, text in fields.items():
        match = NAMED.fullmatch(key)
        if match:
            said.setdefault(int(match[1]), {})[match[2]] = text.strip()
    found: dict[tuple[int, int], str] = {}
    for number, own in sorted(said.items()):
        first = number if layers > 1 and not any("Layer" in other for other in said.values()) else 0
        key = f"Segment{number}_Layer"
        layer = whole(own.get("Layer", str(first)), key, path, 0)
        if layer >= layers:
            problem = f"{key}: {layer}, but there are {layers} layers"
            raise refusal(path, problem, "correct the header")
        key = f"Segment{number}_LabelValue"
        value = whole(own.get("LabelValue", "1"), key, path)
        if (layer, value) in found:
            problem = f"{key}: {value} is already another segment's"
            raise refusal(path, problem, "correct the header")
        found[layer, value] = own.get("Name") or own.get("ID") or f"label-{value}"
    return found
