"""Damaged label maps are read or refused in one line: nothing else is raised, and none hangs."""

import gzip
import re
import time
from pathlib import Path

import numpy as np
import pytest

from needlefem.errors import CaseError
from needlefem.image import read_labelmap
from tests.image.test_headers import LABELS, meta, nifti, nrrd

WORDS = [b"nan", b"inf", b"1e300", b"-1", b"0", b"", b"\0", b"1_000", b"99999999999999999999", b"x"]
"""What numbers in a text header are replaced by."""
LONGEST = 5.0
"""Seconds that a file of a few hundred bytes may take."""


def sound(folder: Path, kind: str) -> bytes:
    """Return the bytes of a small label map."""
    path = folder / f"sound.{kind}"
    if kind == "nii.gz":
        return gzip.compress(nifti(path).read_bytes(), mtime=0)
    if kind == "gz.nrrd":
        return nrrd(path, gzip.compress(LABELS.tobytes(), mtime=0), encoding="gzip").read_bytes()
    make = {"nrrd": nrrd, "nii": nifti, "mha": meta}[kind]
    keys = {"keys": "Segment0_Name:=a\nSegment0_LabelValue:=1"} if kind == "nrrd" else {}
    return make(path, **keys).read_bytes()


def damaged(content: bytes, draw: np.random.Generator) -> bytes:
    """Return a file with one to three things wrong."""
    for _ in range(draw.integers(1, 4)):
        at, end = np.sort(draw.integers(0, len(content) + 1, 2))
        match draw.integers(0, 6):
            case 0:
                content = content[:at]
            case 1:
                content = content[:at] + draw.bytes(int(draw.integers(1, 9))) + content[at:]
            case 2:
                content = content[:at] + content[end:]
            case 3 if at < len(content):
                content = content[:at] + draw.bytes(1) + content[at + 1 :]
            case 4:
                content = content[:end] + content[at:end] + content[end:]
            case _:
                found = list(re.finditer(rb"\d+\.?\d*", content[:600]))
                if found:
                    one = found[draw.integers(len(found))]
                    word = WORDS[draw.integers(len(WORDS))]
                    content = content[: one.start()] + word + content[one.end() :]
    return content


@pytest.mark.parametrize("kind", ["nrrd", "gz.nrrd", "nii", "nii.gz", "mha"])
def test_damaged_files(tmp_path: Path, kind: str, capfd: pytest.CaptureFixture[str]) -> None:
    whole, draw = sound(tmp_path, kind), np.random.default_rng(2026)
    path, refused, slowest, said = tmp_path / f"map.{kind}", 0, 0.0, set[str]()
    for _ in range(400):
        path.write_bytes(damaged(whole, draw))
        start = time.process_time()
        try:
            found = read_labelmap(path)
        except CaseError as error:
            refused += 1
            said.add(str(error))
        else:
            numbers = [*found.voxels.origin, *found.voxels.spacing, *np.ravel(found.voxels.axes)]
            assert np.all(np.isfinite(numbers))
        slowest = max(slowest, time.process_time() - start)
    assert refused > 200  # most damage is seen
    assert not any("\n" in message for message in said)
    assert slowest < LONGEST
    assert capfd.readouterr() == ("", "")
