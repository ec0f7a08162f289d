"""Long work says what it does, on standard error, from two seconds on."""

import json
import subprocess
import sys
import time

import pytest

from needlefem import _progress
from tests.conftest import PAPER_CASE

QUICK = """
import sys
from needlefem import _progress
_progress.FIRST = _progress.NEXT = 0.02
from needlefem.cli.main import process
sys.argv[1:] = ["plan", sys.argv[1], "--json"]
process()
"""


def test_short_work_is_silent(capfd: pytest.CaptureFixture[str]) -> None:
    with _progress.telling("needlefem plan"):
        _progress.doing("something quick")
    assert capfd.readouterr() == ("", "")


def test_long_work_is_told(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_progress, "FIRST", 0.05)
    with _progress.telling("needlefem plan"):
        _progress.doing("factorising 1,234 unknowns")
        time.sleep(0.5)
    told = capfd.readouterr().err.splitlines()
    assert told == ["needlefem plan: 0 s, factorising 1,234 unknowns"]  # the next is due in 10 s
    assert _progress.activity() == "factorising 1,234 unknowns"


def test_the_number_of_time_steps_is_announced() -> None:
    _progress.doing("insertion 1")
    _progress.expect_steps(2812.4)
    assert _progress.activity() == "insertion 1, of about 2,812 time steps"
    _progress.expect_steps(0)
    assert _progress.activity() == "insertion 1"


def test_json_stays_alone_on_standard_output() -> None:
    found = subprocess.run(
        [sys.executable, "-c", QUICK, str(PAPER_CASE)], capture_output=True, text=True, check=True
    )
    assert json.loads(found.stdout)["status"] == "planned"
    told = found.stderr.splitlines()
    assert told
    assert all(line.startswith("needlefem plan: ") for line in told)
    words = ("importing", "insertion", "factorising", "mesh")  # which one depends on the machine
    assert any(word in line for word in words for line in told)
