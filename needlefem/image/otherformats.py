"""Volumes in formats that SimpleITK reads, one guard around it."""

import os
import sys
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from needlefem.errors import CaseError
from needlefem.image.volume import KEY, Volume, file_bytes, refusal, voxel_count

OWN = "give a .nrrd, .seg.nrrd, .nii.gz or .mha (3D Slicer saves these)"
MILLIMETRE = 1e-3
"""What SimpleITK's coordinates are in, m."""


def read_other(path: Path) -> Volume:
    """Read a volume of a format that is none of ours by SimpleITK.

    Raises
    ------
    CaseError
        SimpleITK is not installed, or does not read it; DICOM, which needs a conversion.
    """
    content = file_bytes(path)
    if content[128:132] == b"DICM":
        problem = "a DICOM file: frames of a DICOM segmentation are no volume yet"
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


def _volume(sitk: Any, image: Any, path: Path) -> Volume:
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
