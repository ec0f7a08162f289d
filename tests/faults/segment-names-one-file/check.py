"""Names that differ in capitals alone have files that differ in more."""

import tomllib
from collections.abc import Callable
from pathlib import Path


def test_two_regions_have_two_files(folder: Path, run: Callable[..., object]) -> None:
    case = tomllib.loads((folder / "mine" / "case.toml").read_text(encoding="utf-8"))
    files = {name: region["contour"] for name, region in case["regions"].items()}
    assert files == {"Node": "node.csv", "node": "node-2.csv"}
    texts = {(folder / "mine" / file).read_text(encoding="utf-8") for file in files.values()}
    assert len(texts) == 2
