"""Damaged mesh files end in one sentence: no traceback, nothing printed, no hang."""

import shutil
import time
import warnings
from pathlib import Path

import numpy as np
import pytest

from needlefem.errors import CaseError
from needlefem.mesh import read_plane_mesh
from needlefem.stress.damage import damage

GMSH = Path(__file__).parent / "gmsh"
FILES = [
    "text22", "text40", "text41", "binary22", "binary41", "partitioned", "curved-quads", "mixed22",
    "overlapping41", "unnamed22",
]  # fmt: skip


@pytest.mark.parametrize("name", FILES)
def test_damage_ends_in_one_sentence(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], name: str
) -> None:
    refused: list[CaseError] = []
    for seed in range(25):
        folder = tmp_path / str(seed)
        folder.mkdir()
        shutil.copy(GMSH / f"{name}.msh", folder)
        damage(np.random.default_rng(seed), folder, f"{name}.msh")
        began = time.process_time()
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                read_plane_mesh(folder / f"{name}.msh", 1e-3)
        except CaseError as error:
            refused.append(error)
        assert time.process_time() - began < 5.0
    assert len(refused) > 5
    assert {error.key for error in refused} == {"mesh.file"}
    assert not any("\n" in str(error) for error in refused)
    assert capfd.readouterr() == ("", "")
