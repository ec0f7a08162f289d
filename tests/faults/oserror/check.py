"""A full disk and a read-only folder: one line with path and reason, exit 3."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import ROOT

GEL = str(ROOT / "cases" / "gel" / "case.toml")


def test_below_a_file_nothing_is_simulated(folder, run):
    Path("file").write_text("")
    status, out, err = run("run", GEL, "--out", "file/o")
    assert (status, out) == (3, "")
    last = "needlefem: can't write 'file/o': a part of the path is a file, not a folder\n"
    assert err.endswith(last)


def _mounted(options, code):
    """Run code beside a small file system of its own; skip where that is not permitted."""
    Path("disk").mkdir(exist_ok=True)
    script = f'mount -t tmpfs -o {options} tmpfs disk && exec "$0" -c "$1"'
    command = ["unshare", "-rm", "sh", "-c", script, sys.executable, code]
    try:
        found = subprocess.run(command, capture_output=True, text=True, check=False,
                               env=os.environ | {"PYTHONPATH": str(ROOT)})  # fmt: skip
    except FileNotFoundError:
        pytest.skip("no unshare")
    if "Operation not permitted" in found.stderr or "mount:" in found.stderr:
        pytest.skip("no file system may be mounted here")
    return found


RUN = "from needlefem.cli.main import main; print('exit', main(['run', {case!r}, '--out', {out!r}]))"


def test_a_read_only_disk(folder, run):
    found = _mounted("ro,size=64k", RUN.format(case=GEL, out="disk/o"))
    assert found.stdout == "exit 3\n"
    assert found.stderr.endswith("needlefem: can't write 'disk/o': the file system is read-only\n")


def test_a_disk_that_gets_full(folder, run):
    code = RUN.format(case=GEL, out="disk/o") + "; import os; print(*sorted(os.listdir('disk/o')))"
    found = _mounted("size=16k", code)
    assert found.stdout.startswith("exit 3\n")
    assert "can't write 'disk/o/" in found.stderr
    assert found.stderr.endswith(": no space is left there\n")
    assert ".part" not in found.stdout
