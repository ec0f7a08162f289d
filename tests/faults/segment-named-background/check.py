"""A segment called background is another tissue than what lies outside all segments."""

import tomllib
from collections.abc import Callable
from pathlib import Path


def test_two_materials(folder: Path, run: Callable[..., object]) -> None:
    case = tomllib.loads((folder / "mine" / "case.toml").read_text(encoding="utf-8"))
    assert case["tissue"]["default_material"] == "background"
    assert case["regions"]["background 2"]["material"] == "background 2"
    assert {"background", "background 2"} < set(case["materials"])
