"""A benchmark in this checkout and in another one, in turn: ratios of what its tasks cost.

Two versions of a program are compared on one machine only if both meet the same load: each task
runs in one checkout and then in the other, round by round, and the ratio is taken within a round.
"""

import json
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import needlefem
from needlefem.bench import children_seconds, median, spread_bars
from needlefem.errors import CaseError, SimulationError
from needlefem.studies import Table

ROUNDS = 15
MOST = 1.05
"""Largest ratio of a task's cost to that in the other checkout."""
LEAST_SECONDS = 0.1
"""Shorter tasks are repeated up to this time within a timing."""
WORKER = Path(__file__).with_name("worker.py")
HERE = Path(needlefem.__file__).parents[1]
SERVED = ("insertion", "plan", "stepping")
"""Benchmarks whose tasks run within one process."""
Timed = Callable[[str, int], float]
"""Takes a task's name and a number of repetitions; returns seconds of processor time."""


def run(name: str, case: str, other: Path) -> Table:
    """Time the tasks of a benchmark in this checkout and in another one, in turn.

    Parameters
    ----------
    name : str
        Of the benchmark.
    case : str
        Path of a case; a relative one is that of each checkout.
    other : Path
        Folder that contains the other checkout's package.

    Returns
    -------
    Table
        It passes if no task costs more than `MOST` times as much here.

    Raises
    ------
    CaseError
        The benchmark cannot be compared, or the folder contains no checkout.
    SimulationError
        A benchmark fails in a checkout.
    """
    other = other.resolve()
    if not (other / "needlefem" / "bench" / "timing.py").is_file():
        raise CaseError("--against", f"'{other}' contains no checkout", "give its folder")
    if name == "imports":
        tasks = _commands(case)
        return _table(name, list(tasks), _of_processes(tasks, HERE), _of_processes(tasks, other))
    if name not in SERVED:
        remedy = f"take one of imports, {', '.join(SERVED)}"
        raise CaseError("--against", f"'{name}' is not made for comparing", remedy)
    with _worker(name, case, HERE) as (ours, here), _worker(name, case, other) as (theirs, there):
        return _table(name, [task for task in ours if task in theirs], here, there)


def _table(name: str, tasks: list[str], here: Timed, there: Timed) -> Table:
    """Time tasks in turn; every second round begins with the other checkout."""
    seconds: dict[str, tuple[list[float], list[float]]] = {task: ([], []) for task in tasks}
    for task in tasks:
        there(task, 1)
        count = max(1, math.ceil(LEAST_SECONDS / max(here(task, 1), 1e-6)))
        count = 1 if name == "imports" else count
        for number in range(ROUNDS):
            places = ((0, here), (1, there))
            for side, timed in places if number % 2 else places[::-1]:
                seconds[task][side].append(timed(task, count) / count)
    rows: list[list[object]] = []
    ratios: dict[str, float] = {}
    for task, (new, old) in seconds.items():
        ratios[task] = median([a / b for a, b in zip(new, old, strict=True)])
        rows.append(
            [
                task,
                1e3 * median(new),
                1e3 * median(old),
                median(new) / median(old),
                min(new) / min(old),
                ratios[task],
            ]
        )
    worst = max(ratios.values())
    return Table(
        title=f"bench {name} here and in the other checkout, {ROUNDS} rounds in turn, "
        "processor time",
        columns=("task", "here (ms)", "other (ms)", "of medians", "of the least", "ratio"),
        rows=rows,
        passed=worst <= MOST,
        charts={name: spread_bars(
            "here and in the other checkout", "milliseconds", _both(seconds), 1e-3)},
        note=f"ratio: the median of the rounds' ratios, at most {MOST:g}",
        summary={"worst": worst, "ratios": ratios},
    )  # fmt: skip


def _both(seconds: Mapping[str, tuple[list[float], list[float]]]) -> dict[str, list[float]]:
    return {
        f"{task}, {place}": pair[side]
        for task, pair in seconds.items()
        for side, place in enumerate(("here", "other"))
    }


def _commands(case: str) -> dict[str, list[str]]:
    """Return the arguments of Python of the processes that are compared."""
    return {
        "import needlefem": ["-c", "import needlefem"],
        "import of the plan command": ["-c", "import needlefem.cli.plan"],
        "needlefem plan CASE --json": ["-m", "needlefem", "plan", case, "--json"],
    }


def _of_processes(tasks: Mapping[str, list[str]], checkout: Path) -> Timed:
    """Return what times whole processes in a checkout."""

    def timed(task: str, count: int) -> float:
        return sum(children_seconds(lambda: _process(tasks[task], checkout), count))

    return timed


def _process(arguments: list[str], checkout: Path) -> None:
    done = subprocess.run(
        [sys.executable, *arguments], cwd=checkout, env=_environment(checkout),
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    if done.returncode:
        raise SimulationError(_failure(arguments, checkout, done.stderr))


def _environment(checkout: Path) -> dict[str, str]:
    """Return an environment in which Python finds a checkout's package, compiled once."""
    kept = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
    return kept | {"PYTHONPATH": str(checkout)}


def _failure(arguments: list[str], checkout: Path, said: str) -> str:
    last = said.strip().splitlines()[-1:] or ["no message"]
    return f"'{' '.join(arguments[:3])}' failed in '{checkout}': {last[0][:200]}"


@contextmanager
def _worker(name: str, case: str, checkout: Path) -> Iterator[tuple[list[str], Timed]]:
    """Start a benchmark in a checkout; give its tasks' names, and what times them."""
    code = f"import runpy; runpy.run_path({str(WORKER)!r}, run_name='__main__')"
    arguments = ["-c", code, name, case]
    with tempfile.TemporaryFile("w+") as said, subprocess.Popen(
        [sys.executable, *arguments], cwd=checkout, env=_environment(checkout), text=True,
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=said,
    ) as process:  # fmt: skip
        asked, answers = process.stdin, process.stdout
        assert asked is not None
        assert answers is not None

        def answer() -> Any:
            line = answers.readline()
            if not line:
                said.seek(0)
                raise SimulationError(_failure(["bench", name, case], checkout, said.read()))
            return json.loads(line)

        def timed(task: str, count: int) -> float:
            asked.write(f"{count} {task}\n")
            asked.flush()
            return float(answer())

        if not Path(answer()).is_relative_to(checkout):
            raise SimulationError(f"Python did not take the package in '{checkout}'")
        try:
            yield answer(), timed
        finally:
            asked.close()
