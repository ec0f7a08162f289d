"""Run many inputs with defects, and report the responses."""

import tempfile
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from needlefem._table import Table
from needlefem.stress.inputfiles import CommandLine, has_label_maps, make_results
from needlefem.stress.inputruns import InputRun, check_input, draw_input, run_input
from needlefem.stress.pool import Lost, WorkerLimits, work_through
from needlefem.stress.scenes import Fault

COUNT = 5000
"""Default number of inputs."""
LIMITS = WorkerLimits(seconds=20.0, clock=300.0, memory=4e9, seconds_a_step=0.02)
"""Time limit of a command."""
TELL = 30.0
"""Seconds between progress messages."""


def run_inputs(
    command_line: CommandLine,
    seed: int,
    numbers: Sequence[int],
    processes: int,
    tell: Callable[[str], None],
) -> list[InputRun]:
    """Run the inputs with given numbers; `tell` is called with progress messages.

    Fewer are returned where Ctrl-C or a signal stops the run.
    """
    if not has_label_maps():
        tell("without label maps: they need SimpleITK (pip install 'needlefem[image]')")
    runs: list[InputRun] = []
    told = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="needlefem-stress-") as results:
        make_results(Path(results), command_line)
        work = partial(run_input, command_line, results, seed)
        try:
            for number, answer in work_through(work, numbers, processes=processes, limits=LIMITS):
                if isinstance(answer, Lost):
                    runs.append(_lost(seed, number, answer, Path(results)))
                else:
                    runs.append(answer)
                if time.monotonic() - told > TELL:
                    told = time.monotonic()
                    faulty = sum(bool(run.faults) for run in runs)
                    tell(f"{len(runs)} of {len(numbers)} inputs, {faulty} with a fault")
        except KeyboardInterrupt as stop:  # the results so far are reported
            tell(str(stop) or "interrupted")
    return sorted(runs, key=lambda run: run.number)


def _lost(seed: int, number: int, lost: Lost, results: Path) -> InputRun:
    with tempfile.TemporaryDirectory(prefix="needlefem-stress-") as folder:
        drawn = draw_input(seed, number, Path(folder), results)
    hangs = Fault(requirement="no hang", detail=lost.reason)
    return InputRun(
        number=number,
        kinds={"input": drawn.kind, "command": drawn.arguments[0]},
        damage=drawn.damage,
        command=" ".join(("needlefem", *drawn.arguments)),
        status="lost",
        message=lost.reason,
        faults=(hangs,),
    )


def keep_input(command_line: CommandLine, seed: int, number: int, folder: Path) -> InputRun:
    """Run one input in a folder, which then contains its input, its output and its messages."""
    with tempfile.TemporaryDirectory(prefix="needlefem-stress-") as results:
        make_results(Path(results), command_line)
        return check_input(command_line, Path(results), seed, number, folder.resolve())


def passed(runs: Sequence[InputRun], asked: int) -> bool:
    """Return whether all requested inputs were run and satisfy all requirements."""
    return len(runs) == asked and not any(run.faults for run in runs)


def summary(runs: Sequence[InputRun], asked: int) -> Table:
    """Return the table of statuses, inputs, commands and faults."""
    aspects: dict[str, Callable[[InputRun], str]] = {
        "exit status": lambda run: run.status,
        "input": lambda run: run.kinds["input"],
        "command": lambda run: run.kinds["command"],
        "fault": lambda run: run.faults[0].requirement if run.faults else "none",
    }
    rows = []
    for aspect, label in aspects.items():
        for name in sorted({label(run) for run in runs}):
            having = [run for run in runs if label(run) == name]
            faulty = sum(bool(run.faults) for run in having)
            rows.append([aspect, name, str(len(having)), str(faulty)])
    faulty = sum(bool(run.faults) for run in runs)
    seconds = sum(run.seconds for run in runs)
    return Table(
        title="damaged inputs",
        columns=("aspect", "kind", "inputs", "faults"),
        rows=rows,
        passed=passed(runs, asked),
        note=(
            f"{len(runs)} of {asked} inputs run, {faulty} with a fault, "
            f"{seconds:.0f} s of processor time"
        ),
    )


def command(seed: int, number: int) -> str:
    """Return the command that runs one input alone and keeps its files."""
    return f"needlefem verify --stress inputs --seed {seed} --only {number} --out DIR"


def listing(seed: int, runs: Sequence[InputRun]) -> list[str]:
    """Return lines about each input with a fault."""
    lines = []
    for run in runs:
        if not run.faults:
            continue
        lines.append(f"input {run.number} [{run.kinds['input']}; {run.damage}] {run.command}")
        lines.append(f"    {'; '.join(map(str, run.faults))}")
        lines.append(f"    {command(seed, run.number)}")
    return lines


def record(seed: int, runs: Sequence[InputRun], asked: int) -> dict[str, object]:
    """Return all results for JSON."""
    return {
        "seed": seed,
        "asked": asked,
        "run": len(runs),
        "passed": passed(runs, asked),
        "inputs": [vars(run) | {"faults": [vars(fault) for fault in run.faults]} for run in runs],
    }
