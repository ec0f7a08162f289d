"""A file without groups is a tissue of the background alone; one with a single group likewise."""

import tomllib
from pathlib import Path


def test_a_case_begins(folder: Path, run) -> None:
    ended = run("new", "c", "--mesh", "b.msh", "--unit", "1 m")
    assert ended.status == 0, ended.err
    assert "AttributeError" not in ended.err
    assert tomllib.loads((folder / "c" / "case.toml").read_text(encoding="utf-8"))["mesh"]
