"""Plans are the same under other kernels of the linear algebra, which round differently.

Each kernel runs in a process of its own: it is chosen when the library is loaded.
"""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.conftest import ROOT

KERNELS = {"Prescott": "pni", "Nehalem": "sse4_2", "Haswell": "avx2", "SkylakeX": "avx512f"}
"""Kernels of OpenBLAS, and the instructions that the processor must have for them."""
SAME = 1e-6
"""Distance of the same points under two kernels, at most, m."""


def _supported() -> list[str]:
    info = Path("/proc/cpuinfo")
    flags = info.read_text(encoding="utf-8").split() if info.exists() else []
    found = [kernel for kernel, flag in KERNELS.items() if flag in flags]
    return found[:-1]  # the last is the native one


@pytest.fixture(scope="module")
def answers() -> dict[str, dict[str, Any]]:
    """Return the answers of `kernel_answers.py` by kernel."""
    found = {}
    for kernel in ["", *_supported()]:
        environment = {
            **os.environ, "PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1",
            "OPENBLAS_CORETYPE": kernel,
        }  # fmt: skip
        if not kernel:
            del environment["OPENBLAS_CORETYPE"]
        script = Path(__file__).parent / "kernel_answers.py"
        done = subprocess.run(
            [sys.executable, str(script)],
            capture_output=True, env=environment, check=True, timeout=600,
        )  # fmt: skip
        found[kernel or "native"] = json.loads(done.stdout)
    return found


@pytest.mark.skipif(not _supported(), reason="no other kernels for this processor")
def test_kernels_round_differently(answers: dict[str, dict[str, Any]]) -> None:
    """Otherwise the other test says nothing."""
    assert len({one["bits"] for one in answers.values()}) > 1


@pytest.mark.skipif(not _supported(), reason="no other kernels for this processor")
@pytest.mark.parametrize(
    "name", ["root", "golden", "grid", "stepped", "sticking", "paper", "spread", "fine nodes"]
)
def test_plans_do_not_depend_on_the_kernel(answers: dict[str, dict[str, Any]], name: str) -> None:
    native = np.array(answers["native"]["points"][name])
    assert np.all(np.isfinite(native))
    for kernel, found in answers.items():
        apart = np.abs(np.array(found["points"][name]) - native).max()
        assert apart <= SAME, f"{kernel}: {apart:.2g} m from the native one"
