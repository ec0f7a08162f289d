"""Tutorials and how-to pages do what they say: files are written, commands run, outputs agree."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from needlefem import _plugin
from needlefem.cli.main import main
from tests.pages import ROOT, WHOLE, site

pages = site("pages")


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Callable[[list[str], bool], str]:
    """Return what runs a command of a page: needlefem here, scripts in a process of their own."""

    def here(command: list[str], fails: bool) -> str:
        program, *arguments = command
        if program == "python":
            found = subprocess.run(
                [sys.executable, *arguments], check=True, capture_output=True, text=True
            )
            return found.stdout
        assert program == "needlefem"
        capsys.readouterr()
        assert (main(arguments) != 0) == fails
        printed = capsys.readouterr()
        return printed.out + (printed.err if fails else "")

    return here


@pytest.mark.parametrize("page", WHOLE, ids=lambda page: f"{page.parent.name}/{page.stem}")
def test_page_works(
    page: Path,
    run: Callable[[list[str], bool], str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    (tmp_path / "cases").symlink_to(ROOT / "cases")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(_plugin, "_allowed", False)
    assert pages.run_page(page, run) >= 2


@pytest.mark.parametrize("page", WHOLE, ids=lambda page: f"{page.parent.name}/{page.stem}")
def test_code_of_a_page_is_used(page: Path) -> None:
    """A Python block is a file, and the page runs it or names it to a command."""
    used = " ".join(line for step in pages.steps(page) for line in step.commands)
    files = pages.files(page)
    used += "".join(text for name, text in files.items() if name.endswith(".toml"))
    blocks = page.read_text(encoding="utf-8").count("```python")
    scripts = [name for name in files if name.endswith(".py")]
    assert len(scripts) == blocks
    for name in scripts:
        assert name in used or f"{Path(name).stem}:" in used or Path(name).stem in used


def test_a_page_that_says_otherwise_is_found(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("```console\n$ count\n```\n\n```text\none\n...\nthree\n```\n")
    with pytest.raises(AssertionError, match="this is printed"):
        pages.run_page(page, lambda *_: "one\ntwo\nfour\n")
    assert pages.run_page(page, lambda *_: "one\ntwo\nthree\n") == 1


def test_code_of_a_case_is_not_run_unasked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    page = next(p for p in WHOLE if p.stem == "own-material")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(_plugin, "_allowed", False)
    (tmp_path / "case.toml").write_text(pages.files(page)["case.toml"])
    (tmp_path / "my_tissue.py").write_text("raise SystemExit('it ran')\n")
    assert main(["plan", "case.toml"]) == 2
    error = capsys.readouterr().err
    assert "materials.gel.law: 'my_tissue:FibrousGel' is code, which is not run unasked" in error
    assert error.count("\n") == 1
