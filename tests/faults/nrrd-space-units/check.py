"""Micrometres in the header are micrometres in the case."""

import tomllib
from collections.abc import Callable
from pathlib import Path

import pytest


def test_the_box_has_the_size_of_a_prostate(folder: Path, run: Callable[..., object]) -> None:
    case = tomllib.loads((folder / "mine" / "case.toml").read_text(encoding="utf-8"))
    assert [float(x.split()[0]) for x in case["frame"]["voxels"]["spacing"]] == pytest.approx(
        [1.0, 1.0, 2.5]
    )
    assert all(float(x.split()[0]) < 120.0 for x in case["mesh"]["size"])
