"""Workers return plans."""

import os
import subprocess
import sys

from tests.conftest import ROOT


def test_workers_return_plans(folder, run):
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    found = subprocess.run([sys.executable, "send.py"], capture_output=True, text=True,
                           env=environment, timeout=240, check=False)  # fmt: skip
    assert found.returncode == 0, found.stderr
    assert found.stdout.count("array") == 2
