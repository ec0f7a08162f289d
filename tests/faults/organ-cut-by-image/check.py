"""That the image cuts an organ stands in the case as well."""

from collections.abc import Callable
from pathlib import Path


def test_the_case_says_so(folder: Path, run: Callable[..., object]) -> None:
    text = (folder / "mine" / "case.toml").read_text(encoding="utf-8")
    assert "# The image cuts Prostate at its right side (i = 0)" in text
    assert text.count("The image cuts") == 1
