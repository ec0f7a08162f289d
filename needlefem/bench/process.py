"""The whole plan command, from a cold start, against importing scikit-fem."""

import subprocess
import sys

from needlefem.bench.timing import in_turn, median
from needlefem.errors import SimulationError
from needlefem.table import Table

ROUNDS = 7
MOST = 5.0
"""Largest ratio of the medians."""


def run(case: str) -> Table:
    """Time both as processes of their own, in turn."""
    plan = [sys.executable, "-m", "needlefem", "plan", case, "--json"]
    baseline = [sys.executable, "-c", "import skfem"]
    seconds = in_turn(
        {"plan": lambda: _process(plan), "import": lambda: _process(baseline)}, ROUNDS
    )
    middle = {name: median(values) for name, values in seconds.items()}
    rows = [
        [name, middle[key], min(seconds[key]), max(seconds[key]), middle[key] / middle["import"]]
        for name, key in (("needlefem plan CASE --json", "plan"), ("import skfem", "import"))
    ]
    return Table(
        title=f"whole processes, {ROUNDS} runs in turn",
        columns=("process", "median (s)", "least (s)", "most (s)", "ratio"),
        rows=rows,
        passed=middle["plan"] <= MOST * middle["import"],
        note=f"the ratio may be {MOST:g}",
    )


def _process(command: list[str]) -> None:
    found = subprocess.run(command, capture_output=True, text=True, check=False)
    if found.returncode != 0:
        raise SimulationError(f"'{' '.join(command[1:4])}' failed: {found.stderr.strip()[-200:]}")
