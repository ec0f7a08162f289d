"""The whole plan command from a cold start, and what it imports, against importing scikit-fem."""

import os
import subprocess
import sys

from needlefem.bench import children_seconds, median, spread_bars
from needlefem.errors import SimulationError
from needlefem.studies import Table

ROUNDS = 15
MOST = 1.5
"""Largest ratio of the medians of the plan command and of the import."""
HEAVY = (
    "scipy.optimize", "scipy.stats", "scipy.spatial", "meshio", "pyvista", "matplotlib", "rich",
)  # fmt: skip
"""Modules that a plan does not need."""


def run(case: str) -> Table:
    """Time separate processes in turn."""
    codes = {
        "import needlefem": "import needlefem",
        "import numpy": "import numpy",
        "import scipy.sparse.linalg": "import scipy.sparse.linalg",
        "import skfem": "import skfem",
        "import of the plan command": "import needlefem.cli.plan",
    }
    tasks = {name: ["-c", code] for name, code in codes.items()}
    tasks["needlefem plan CASE --json"] = ["-m", "needlefem", "plan", case, "--json"]
    seconds: dict[str, list[float]] = {name: [] for name in tasks}
    for number in range(ROUNDS + 1):
        for name, arguments in tasks.items():
            spent = children_seconds(lambda run=arguments: _process(run), 1)  # type: ignore[misc]
            if number:
                seconds[name] += spent
    unit = median(seconds["import skfem"])
    modules = {name: _modules(code) for name, code in codes.items()}
    modules["needlefem plan CASE --json"] = _modules(_planning(case))
    rows: list[list[object]] = []
    for name, spent in seconds.items():
        loaded, middle = modules[name], median(spent)
        heavy = ", ".join(module for module in HEAVY if module in loaded) or "none"
        rows.append([name, middle, min(spent), max(spent), middle / unit, len(loaded), heavy])
    ratio = median(seconds["needlefem plan CASE --json"]) / unit
    return Table(
        title=f"whole processes, {ROUNDS} runs in turn, processor time",
        columns=("process", "median (s)", "least (s)", "most (s)", "ratio", "modules",
                 "not needed"),
        rows=rows,
        passed=ratio <= MOST,
        charts={case: spread_bars("whole processes", "seconds", seconds, 1.0)},
        note=f"the ratio of the plan command may be {MOST:g}; not needed: imported all the same",
        summary={"ratio": ratio},
    )  # fmt: skip


def _planning(case: str) -> str:
    return (
        "import io, sys; kept, sys.stdout = sys.stdout, io.StringIO(); "
        f"from needlefem.cli.main import main; main(['plan', {case!r}, '--json']); "
        "sys.stdout = kept"
    )


def _modules(code: str) -> set[str]:
    """Return the names of all modules that are loaded after some code."""
    return set(_process(["-c", f"{code}\nimport sys\nprint(*sys.modules)"]).split())


def _process(arguments: list[str]) -> str:
    """Run Python with compiled modules kept, as they are where a package is installed."""
    kept = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
    command = [sys.executable, *arguments]
    found = subprocess.run(command, capture_output=True, text=True, check=False, env=kept)
    if found.returncode != 0:
        raise SimulationError(f"'{' '.join(arguments[:3])}' failed: {found.stderr.strip()[-200:]}")
    return found.stdout
