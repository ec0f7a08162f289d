"""Interrupted runs end with 3 and a sentence, and leave whole files and what says so."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import needlefem
from needlefem.errors import CaseError
from tests.conftest import ROOT

COMMAND = ["run", "case.toml", "--snapshots", "400", "--out", "o"]


def _stopped(number):
    """Return exit status and standard error of a run that gets a signal while it writes."""
    shutil.rmtree("o", ignore_errors=True)
    code = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
    code += "from needlefem.cli.main import process; process()"
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    process = subprocess.Popen(
        [sys.executable, "-c", code, *COMMAND], stderr=subprocess.PIPE, env=environment,
        stdout=subprocess.DEVNULL,
    )  # fmt: skip
    for _ in range(1200):
        if len(list(Path("o/insertion").glob("*.vtu"))) > 3:
            break
        time.sleep(0.05)
    process.send_signal(number)
    _, err = process.communicate(timeout=60)
    return process.returncode, err.decode().splitlines()


def _parts():
    return list(Path("o").rglob(".part-*"))


def test_signals_leave_whole_files(folder, run):
    for number, sentence in (
        (signal.SIGINT, "needlefem: interrupted"),
        (signal.SIGTERM, "needlefem: stopped by SIGTERM"),
    ):
        status, lines = _stopped(number)
        assert (status, lines[-1]) == (3, sentence)
        assert not _parts()
        assert not Path("o/.needlefem.lock").exists()
        assert json.loads(Path("o/.needlefem.json").read_text())["status"] == "stopped"
        for path in Path("o/insertion").glob("*.vtu"):
            assert path.read_text(errors="replace").rstrip().endswith("</VTKFile>")
        with pytest.raises(CaseError, match="was stopped"):
            needlefem.load_result("o")


def test_what_a_killed_run_leaves_is_removed_by_the_next(folder, run):
    status, _ = _stopped(signal.SIGKILL)
    assert status == -signal.SIGKILL
    Path("o/.part-abcd1234.csv").write_text("half")  # there is not always one
    with pytest.raises(CaseError, match="was stopped"):
        needlefem.load_result("o")
    assert run("run", "case.toml", "--no-pictures", "--out", "o")[0] == 0
    assert not _parts()
    assert not Path("o/insertion").exists()
    assert needlefem.load_result("o")["status"] == "completed"
