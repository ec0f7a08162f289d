"""Output that can't be written ends in one sentence with path and reason, before the work."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import needlefem
from needlefem.errors import OutputError
from needlefem.insertion import Simulation

COMMANDS = {
    "run": ["run", "case.toml", "--no-pictures", "--out"],
    "plan": ["plan", "case.toml", "--no-pictures", "--out"],
    "modes": ["modes", "case.toml", "--no-pictures", "--out"],
    "bench": ["bench", "plan", "case.toml", "--out"],
    "figures": ["figures", "case.toml", "--out"],
    "verify": ["verify", "patch_test", "--report"],
}


def refused(ended, name, reason):
    status, out, err = ended
    assert (status, out) == (3, "")
    last = err.splitlines()[-1]  # above it there may be progress
    assert last.startswith(f"needlefem: can't write '{name}")
    assert reason in last


def test_a_file_or_below_a_file(folder, run):
    def never(*_, **__):
        raise AssertionError("the output is looked at before the work")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Simulation, "__init__", never)
        _refused_before_the_work(run)


def _refused_before_the_work(run):
    for command in COMMANDS.values():
        refused(run(*command, "ok.csv"), "ok.csv", "a file of that name is there")
        refused(run(*command, "ok.csv/o"), "ok.csv/o", "is a file, not a folder")
    render = ["render", "case.toml", "--out"]
    refused(run(*render, "ok.csv/p.png"), "ok.csv/p.png", "is there, not a folder")
    Path("d.png").mkdir()
    refused(run(*render, "d.png"), "d.png", "it is a folder")
    os.mkfifo("f.png")
    refused(run(*render, "f.png"), "f.png", "it is not a regular file")
    long = "x" * 300
    refused(run(*COMMANDS["run"], long), long[:50], "the name is too long")
    Path("loop").symlink_to("loop")
    refused(run(*COMMANDS["run"], "loop/o"), "loop/o", "symbolic links")
    status, _, err = run(*COMMANDS["run"], "")
    assert status == 2
    assert "--out: '' is not a valid name" in err
    refused(run("new", "ok.csv/o", "--contour", "ok.csv"), "ok.csv/o/ok.csv", "not a folder")


def test_from_python(folder, run):
    insertion = needlefem.simulate(needlefem.load_case("case.toml"))
    with pytest.raises(OutputError, match="can't write 'ok.csv/p.png': a "):
        needlefem.render(insertion, "ok.csv/p.png")


def test_standard_output_that_is_full_or_closed(folder, run):
    command = [sys.executable, "-m", "needlefem", "run", "case.toml", "--json", "--out", "o",
               "--no-pictures"]  # fmt: skip
    with open("/dev/full", "w") as full:
        found = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert found.returncode == 3
    last = found.stderr.splitlines()[-1]  # above it there may be progress
    assert last == "needlefem: can't write to standard output: no space left on device"
    assert needlefem.load_result("o")["status"] == "completed"
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as piped:
        piped.stdout.close()  # whoever read has read enough: the results are written all the same
        assert b"rror" not in piped.stderr.read()
        assert piped.wait() == 0
    closed = subprocess.run(["sh", "-c", '"$@" >&- 2>&-', "sh", *command], check=False)
    assert closed.returncode == 0
