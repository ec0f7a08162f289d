"""The how-to pages do what they say: their files are written, their commands run."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from needlefem import foreign
from needlefem.cli.main import main

PAGES = sorted((Path(__file__).parents[1] / "docs" / "how-to").glob("*.md"))
BLOCK = re.compile(r"^```(python|toml|console)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_page_works(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(foreign, "_allowed", False)
    commands = 0
    for kind, text in BLOCK.findall(page.read_text(encoding="utf-8")):
        if kind == "console":
            for line in text.splitlines():
                run(line.removeprefix("$ "))
                commands += 1
        else:
            name = text.splitlines()[0].removeprefix("# ")
            (tmp_path / name).write_text(text, encoding="utf-8")
    assert commands >= 2


def run(line: str) -> None:
    program, *arguments = shlex.split(line)
    if program == "python":
        subprocess.run([sys.executable, *arguments], check=True)
    else:
        assert program == "needlefem"
        assert main(arguments) == 0


def test_code_of_a_case_is_not_run_unasked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    page = next(p for p in PAGES if p.stem == "own-material")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(foreign, "_allowed", False)
    blocks = [text for kind, text in BLOCK.findall(page.read_text()) if kind == "toml"]
    (tmp_path / "case.toml").write_text(blocks[0])
    (tmp_path / "my_tissue.py").write_text("raise SystemExit('it ran')\n")
    assert main(["plan", "case.toml"]) == 2
    error = capsys.readouterr().err
    assert "materials.gel.law: 'my_tissue:FibrousGel' is code, which is not run unasked" in error
    assert error.count("\n") == 1
