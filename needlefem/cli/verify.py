"""``needlefem verify``."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from needlefem._table import Table
from needlefem.checks.reference_problem import (
    Report,
    Verdict,
    judged,
    load_problems,
    read_records,
    records_of,
    run_problem,
)
from needlefem.cli.common import named, refuse_unused_options, say, say_json
from needlefem.errors import CaseError
from needlefem.io.result_folder import result_folder, write_json
from needlefem.plotting.verification_report import record, write_report
from needlefem.stress import inputs, scenes


def main(options: argparse.Namespace) -> int:
    """Run reference problems and print both verdicts on each quantity; 1 if one fails."""
    if options.stress:
        return stress_tests(options)
    _refuse_unused(options)
    if options.element or options.material or options.integrator:
        from needlefem.cli import qualify  # noqa: PLC0415  (only needed for this option)

        return qualify.main(options)
    if options.report is not None:
        with result_folder(named(options.report, "--report"), "verify", "--report"):
            pass  # found before anything is solved
    folder = Path(options.problems)
    records = read_records(folder)
    problems = load_problems(folder, options.names)
    reports = [run_problem(problem, records, quick=options.quick) for problem in problems]
    if options.update_baseline:
        records |= records_of([verdict for report in reports for verdict in report.verdicts])
        write_json(folder / "records.json", records)
        reports = [judged(r.problem, r.findings, records, r.seconds) for r in reports]
    table = _table(reports, [verdict for report in reports for verdict in report.verdicts])
    page = _report(options, reports) if options.report else None
    if options.json:
        say_json(record(reports, quick=options.quick))
    else:
        say(table.text())
        if page is not None:
            say(f"report: {page}")
    return 0 if table.passed else 1


def _refuse_unused(options: argparse.Namespace) -> None:
    """Refuse options of checks if problems are run, and options of problems for checks."""
    if options.integrator:
        why = "an integrator is checked without an element and a law"
        refuse_unused_options(options, [("element", why), ("material", why)])
    if options.element or options.material or options.integrator:
        if options.names:
            raise CaseError(options.names[0], "would be ignored: no problem is run", "leave it out")
        why = "no problem is run together with checks"
        refuse_unused_options(
            options, [(name, why) for name in ("quick", "update_baseline", "report")]
        )
        return
    if options.settings:
        problem = "would be ignored: problems have no constants to set"
        raise CaseError(f"--set {options.settings[0]}", problem, "give --material or --integrator")
    if options.plane != "strain":
        problem = "would be ignored: each problem defines its own plane state"
        raise CaseError("--plane", problem, "give --element or --material, or leave it out")


def _report(options: argparse.Namespace, reports: Sequence[Report]) -> Path:
    with result_folder(options.report, "verify", "--report") as result:
        result.begin()
        return write_report(result.path, reports, quick=options.quick)


def _table(reports: Sequence[Report], verdicts: Sequence[Verdict]) -> Table:
    words = {True: "same", False: "CHANGED", None: "-"}
    rows = [
        [
            v.problem,
            v.answer.label,
            f"{v.answer.value:.8g}",
            f"{v.answer.reference:.8g}",
            f"{v.answer.distance:.1e}",
            f"{v.answer.tolerance:.0e}",
            "passed" if v.answer.passed else "FAILED",
            words[v.record],
        ]
        for v in verdicts
    ]
    failed = sum(not v.passed for v in verdicts)
    seconds = sum(report.seconds for report in reports)
    return Table(
        title="reference problems",
        columns=(
            "problem",
            "quantity",
            "value",
            "reference",
            "error",
            "tolerance",
            "verdict",
            "record",
        ),
        rows=rows,
        passed=not failed,
        note=f"{len(verdicts)} quantities, {failed} failed, {seconds:.1f} s",
    )


# ``needlefem verify --stress``.


def stress_tests(options: argparse.Namespace) -> int:
    """Run random scenes or damaged inputs and report; 1 if a requirement is not met."""
    return _scenes(options) if options.stress == "scenes" else _inputs(options)


def _scenes(options: argparse.Namespace) -> int:
    numbers = _numbers(options, scenes.COUNT)
    runs = scenes.run_scenes(options.seed, numbers, options.processes, _print_progress)
    asked = len(numbers)
    _stress_report(options, scenes.record(options.seed, runs, asked), scenes.summary(runs, asked),
            scenes.listing(options.seed, runs))  # fmt: skip
    if options.out and options.only is not None:
        path = scenes.write_scene(options.seed, options.only, Path(options.out))
        if not options.json:
            say(f"written: {path}")
    return 0 if scenes.passed(runs, asked) else 1


def _inputs(options: argparse.Namespace) -> int:
    from needlefem.cli.main import main as command_line  # noqa: PLC0415  (it imports this module)

    numbers = _numbers(options, inputs.COUNT)
    if options.out and options.only is not None:
        runs = [inputs.keep_input(command_line, options.seed, options.only, Path(options.out))]
    else:
        runs = inputs.run_inputs(
            command_line, options.seed, numbers, options.processes, _print_progress
        )
    asked = len(numbers)
    _stress_report(options, inputs.record(options.seed, runs, asked), inputs.summary(runs, asked),
            inputs.listing(options.seed, runs))  # fmt: skip
    return 0 if inputs.passed(runs, asked) else 1


def _stress_report(
    options: argparse.Namespace, record: dict[str, object], table: Table, lines: list[str]
) -> None:
    if options.json:
        say_json(record)
        return
    say(table.text())
    for line in lines:
        say(line)


def _numbers(options: argparse.Namespace, most: int) -> list[int]:
    if options.only is not None:
        return [options.only]
    count = most if options.count is None else options.count
    least = {"--count": (count, 1), "--processes": (options.processes, 1),
             "--start": (options.start, 0), "--seed": (options.seed, 0)}  # fmt: skip
    for key, (value, bound) in least.items():
        if value < bound:
            raise CaseError(key, f"{value}", f"give {bound} at least")
    return list(range(options.start, options.start + count))


def _print_progress(text: str) -> None:
    sys.stderr.write(text + "\n")
    sys.stderr.flush()
