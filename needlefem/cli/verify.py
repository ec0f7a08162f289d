"""``needlefem verify``."""

import argparse
import dataclasses
from collections.abc import Sequence
from pathlib import Path

from needlefem.checks.problem import (
    Verdict,
    load_problems,
    read_records,
    records_of,
    run_problem,
)
from needlefem.cli.common import say, say_json
from needlefem.output.files import write_json
from needlefem.table import Table


def main(options: argparse.Namespace) -> int:
    """Run reference problems and print both verdicts on every answer; 1 if one fails."""
    if options.element or options.material:
        from needlefem.cli import qualify  # noqa: PLC0415  (another job, with other imports)

        return qualify.main(options)
    folder = Path(options.problems)
    records = read_records(folder)
    verdicts: list[Verdict] = []
    for problem in load_problems(folder, options.names):
        verdicts += run_problem(problem, records, quick=options.quick).verdicts
    if options.record:
        write_json(folder / "records.json", records | records_of(verdicts))
    table = _table(verdicts)
    if options.json:
        say_json([_record(verdict) for verdict in verdicts])
    else:
        say(table.text())
    return 0 if table.passed else 1


def _record(verdict: Verdict) -> dict[str, object]:
    return {
        "problem": verdict.problem,
        **dataclasses.asdict(verdict.answer),
        "reference_met": verdict.answer.passed,
        "record_met": verdict.record,
        "seconds": verdict.seconds,
    }


def _table(verdicts: Sequence[Verdict]) -> Table:
    words = {True: "same", False: "CHANGED", None: "-"}
    rows = [
        [
            v.problem,
            v.answer.label,
            f"{v.answer.value:.8g}",
            f"{v.answer.reference:.8g}",
            f"{v.answer.distance:.1e}",
            f"{v.answer.tolerance:.0e}",
            "met" if v.answer.passed else "MISSED",
            words[v.record],
        ]
        for v in verdicts
    ]
    seconds = sum({v.problem: v.seconds for v in verdicts}.values())
    return Table(
        title="reference problems",
        columns=("problem", "answer", "value", "reference", "off", "may be", "reference", "record"),
        rows=rows,
        passed=all(v.passed for v in verdicts),
        note=f"{len(verdicts)} answers, {seconds:.1f} s",
    )
