"""Every input that failed once ends as its folder says; see README.md."""

import importlib.util
import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from needlefem.cli.main import main
from tests.conftest import ROOT

HERE = Path(__file__).parent
FOLDERS = sorted(path.parent for path in HERE.glob("*/README.md"))
REFUSED = 2
"""Exit status of a usage or case error."""


class Ended(NamedTuple):
    """How a command ended."""

    status: int
    out: str
    err: str


def _inside(arguments: list[str], capfd: pytest.CaptureFixture[str]) -> Ended:
    capfd.readouterr()
    try:
        status = main(arguments)
    except SystemExit as stop:
        status = int(stop.code or 0)
    return Ended(status, *capfd.readouterr())


def _outside(arguments: list[str], env: dict[str, str], at_most: float) -> Ended:
    command = [sys.executable, "-m", "needlefem", *arguments]
    environment = os.environ | {"PYTHONPATH": str(ROOT)} | env
    found = subprocess.run(
        command, capture_output=True, env=environment, timeout=10 * at_most, check=False
    )
    texts = [text.decode("utf-8", "replace") for text in (found.stdout, found.stderr)]
    return Ended(found.returncode, *texts)


def _commands(folder: Path) -> list[dict[str, Any]]:
    expected = folder / "expected.toml"
    if not expected.exists():
        return []
    return tomllib.loads(expected.read_text(encoding="utf-8"))["command"]


def _checks(folder: Path) -> list[Callable[..., None]]:
    if not (folder / "check.py").exists():
        return []
    name = f"tests.faults.check_{folder.name.replace('-', '_')}"
    spec = importlib.util.spec_from_file_location(name, folder / "check.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return [vars(module)[found] for found in vars(module) if found.startswith("test_")]


def _one(given: dict[str, Any], capfd: pytest.CaptureFixture[str]) -> None:
    arguments = [str(part).replace("CASES", str(ROOT / "cases")) for part in given["run"]]
    if given.get("process"):
        ended = _outside(arguments, given.get("env", {}), given.get("at_most", 60.0))
    else:
        ended = _inside(arguments, capfd)
    shown = f"{arguments}: exit {ended.status}\n{ended.out}\n{ended.err}"
    assert "Traceback" not in ended.out + ended.err, shown
    assert ended.status == given.get("exit", 0), shown
    if ended.status == REFUSED:
        assert len(ended.err.strip().splitlines()) <= 2, shown
    for stream in ("out", "err"):
        for pattern in given.get(f"std{stream}", ()):
            assert re.search(pattern, getattr(ended, stream)), f"no {pattern!r} in {shown}"
    for name in given.get("absent", ()):
        assert not Path(name).exists(), f"{name} is there: {shown}"
    for name in given.get("present", ()):
        assert Path(name).exists(), f"{name} is missing: {shown}"


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda path: path.name)
def test_fault(
    folder: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    copy = tmp_path / folder.name
    shutil.copytree(folder, copy)
    monkeypatch.chdir(copy)
    commands, checks = _commands(folder), _checks(folder)
    assert commands or checks, "neither expected.toml nor check.py: nothing is tested"
    for given in commands:
        _one(given, capfd)
    for check in checks:
        check(copy, lambda *arguments: _inside([str(a) for a in arguments], capfd))
