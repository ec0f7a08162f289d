"""``needlefem verify``."""

import argparse
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
from needlefem.cli.common import named, say, say_json
from needlefem.cli.ignored import refuse_unused_options
from needlefem.errors import CaseError
from needlefem.io.result_folder import result_folder, write_json
from needlefem.plotting.verification_report import record, write_report


def main(options: argparse.Namespace) -> int:
    """Run reference problems and print both verdicts on each quantity; 1 if one fails."""
    if options.stress:
        from needlefem.cli import stress  # noqa: PLC0415  (only needed for this option)

        return stress.main(options)
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
