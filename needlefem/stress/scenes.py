"""Many random scenes at once, and a report of what became of them."""

import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from needlefem._table import Table
from needlefem.stress.draw import draw_case
from needlefem.stress.drawnfiles import write_drawn_case
from needlefem.stress.pool import Lost, WorkerLimits, work_through
from needlefem.stress.sceneruns import Fault, SceneRun, run_scene

COUNT = 2000
"""Scenes when no number is given."""
LIMITS = WorkerLimits(seconds=60.0, clock=300.0, memory=4e9)
"""Of a scene."""
COMPLETE = 0.95
"""Least share of scenes in which the needle does what it was told."""
TELL = 30.0
"""Seconds between lines of progress."""


def run_scenes(
    seed: int, numbers: Sequence[int], processes: int, tell: Callable[[str], None]
) -> list[SceneRun]:
    """Carry out the scenes of some numbers; `tell` is called with lines of progress.

    Fewer are returned where Ctrl-C or a signal stops the run.
    """
    work = partial(run_scene, seed)
    runs: list[SceneRun] = []
    told = time.monotonic()
    try:
        for number, answer in work_through(work, numbers, processes=processes, limits=LIMITS):
            runs.append(_lost(seed, number, answer) if isinstance(answer, Lost) else answer)
            if time.monotonic() - told > TELL:
                told = time.monotonic()
                faulty = sum(bool(run.faults) for run in runs)
                tell(f"{len(runs)} of {len(numbers)} scenes, {faulty} with a fault")
    except KeyboardInterrupt as stop:  # what ran until then is reported
        tell(str(stop) or "interrupted")
    return sorted(runs, key=lambda run: run.number)


def _lost(seed: int, number: int, lost: Lost) -> SceneRun:
    fault = Fault(requirement="an answer", detail=lost.reason)
    kinds = dict(draw_case(seed, number).kinds)
    return SceneRun(
        number=number, kinds=kinds, status="lost", sentence=lost.reason, faults=(fault,)
    )


def write_scene(seed: int, number: int, folder: Path) -> Path:
    """Write a scene as a case file for a closer look."""
    case = draw_case(seed, number)
    return write_drawn_case(
        case, folder, f"scene {number} of seed {seed}: needlefem {case.command}"
    )


def command(kind: str, seed: int, number: int) -> str:
    """Return the command that runs one scene (or input) alone."""
    return f"needlefem verify --stress {kind} --seed {seed} --only {number}"


def passed(runs: Sequence[SceneRun], asked: int) -> bool:
    """Say whether all scenes that were asked for were run, without faults, enough complete."""
    complete = sum(run.complete for run in runs)
    faulty = any(run.faults for run in runs)
    return len(runs) == asked and complete >= COMPLETE * asked and not faulty


def summary(runs: Sequence[SceneRun], asked: int) -> Table:
    """Return the table of statuses, then of what was drawn, each with its faults."""
    rows = [*_rows("status", runs, lambda run: run.status)]
    rows += _rows("symmetry checked", [run for run in runs if run.symmetry], _symmetry)
    aspects = sorted({aspect for run in runs for aspect in run.kinds})
    for aspect in aspects:
        having = [run for run in runs if aspect in run.kinds]
        rows += _rows(aspect, having, partial(_kind, aspect))
    complete = sum(run.complete for run in runs)
    seconds = sum(run.seconds for run in runs)
    faulty = sum(bool(run.faults) for run in runs)
    note = (
        f"{len(runs)} of {asked} scenes run, {complete} complete "
        f"({100.0 * complete / max(len(runs), 1):.1f} %), {faulty} with a fault, "
        f"{seconds:.0f} s of processor time"
    )
    return Table(
        title="random scenes",
        columns=("aspect", "kind", "scenes", "complete", "faults"),
        rows=rows,
        passed=passed(runs, asked),
        note=note,
    )


def _kind(aspect: str, run: SceneRun) -> str:
    return run.kinds[aspect]


def _symmetry(run: SceneRun) -> str:
    return f"{run.kinds['symmetry']}: {run.symmetry}"


def _rows(
    aspect: str, runs: Iterable[SceneRun], label: Callable[[SceneRun], str]
) -> list[list[str]]:
    runs = list(runs)
    counts = Counter(label(run) for run in runs)
    rows = []
    for name, count in sorted(counts.items(), key=lambda item: (-item[1], item[0])):
        of_name = [run for run in runs if label(run) == name]
        complete = sum(run.complete for run in of_name)
        faulty = sum(bool(run.faults) for run in of_name)
        rows.append([aspect, name, str(count), str(complete), str(faulty)])
    return rows


def listing(seed: int, runs: Sequence[SceneRun]) -> list[str]:
    """Return lines on every scene that has a fault or is not complete."""
    lines = []
    for run in runs:
        if run.complete and not run.faults:
            continue
        what = "; ".join(map(str, run.faults))
        said = run.sentence.splitlines()[0] if run.sentence else ""
        lines.append(f"scene {run.number} [{run.status}] {what or said}")
        lines.append(f"    {command('scenes', seed, run.number)}")
    return lines


def record(seed: int, runs: Sequence[SceneRun], asked: int) -> dict[str, Any]:
    """Return all runs for JSON."""
    return {
        "seed": seed,
        "asked": asked,
        "run": len(runs),
        "passed": passed(runs, asked),
        "scenes": [
            {
                "number": run.number,
                "status": run.status,
                "sentence": run.sentence,
                "faults": [vars(fault) for fault in run.faults],
                "symmetry": run.symmetry,
                "kinds": run.kinds,
                "seconds": run.seconds,
                "command": command("scenes", seed, run.number),
            }
            for run in runs
        ],
    }
