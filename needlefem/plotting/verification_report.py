"""The report as one HTML page without links, and as JSON."""

import dataclasses
import datetime as dt
from collections.abc import Mapping, Sequence
from html import escape
from importlib.metadata import version
from pathlib import Path
from typing import Any

from needlefem.checks.reference_problem import Curve, Report, Verdict
from needlefem.errors import NoRendererError
from needlefem.io.result_folder import whole_file, write_json
from needlefem.plotting.shape_pictures import picture
from needlefem.plotting.svg_charts import ChartLine, loglog

PACKAGES = ("needlefem", "scikit-fem", "numpy", "scipy")
STYLE = """
:root { color-scheme: light dark; --ink: #1d1d1f; --paper: #ffffff; --faint: #d8d8dc;
  --good: #00704f; --bad: #b3261e; --chart: #ffffff; }
@media (prefers-color-scheme: dark) { :root { --ink: #ececf0; --paper: #17181b; --faint: #3a3b40;
  --good: #4cc38a; --bad: #ff8a80; } }
body { font: 15px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--paper);
  max-width: 1180px; margin: 2rem auto; padding: 0 1rem; }
h2 { border-top: 1px solid var(--faint); padding-top: 1.2rem; margin-top: 2.2rem; }
table { border-collapse: collapse; font-size: 13px; width: 100%; }
th, td { text-align: left; padding: 2px 10px 2px 0; border-bottom: 1px solid var(--faint);
  vertical-align: top; }
td.number, th.number { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
.good { color: var(--good); } .bad { color: var(--bad); font-weight: 600; }
.charts { display: flex; flex-wrap: wrap; gap: 12px; margin: 1rem 0; }
.charts svg { width: 560px; max-width: 100%; background: var(--chart); border: 1px solid #d8d8dc; }
svg text { font: 11px system-ui, sans-serif; fill: #202020; }
svg .title { font-weight: 600; font-size: 12px; } svg .small { font-size: 10px; }
svg .grid { stroke: #e4e4e8; stroke-width: 1; } svg .slope { fill: none; stroke: #555; }
figure { margin: 0; max-width: 560px; } figure img { width: 100%; border: 1px solid #d8d8dc; }
dl { display: grid; grid-template-columns: 8rem 1fr; gap: 2px 12px; } dd { margin: 0; }
dt { font-weight: 600; } details summary { cursor: pointer; }
"""


def write_report(folder: Path, reports: Sequence[Report], *, quick: bool) -> Path:
    """Write ``verification.html`` and ``verification.json`` into a folder; return the page."""
    page = folder / "verification.html"
    with whole_file(page) as part:
        part.write_text(html(reports, quick=quick), encoding="utf-8")
    write_json(folder / "verification.json", record(reports, quick=quick))
    return page


def record(reports: Sequence[Report], *, quick: bool) -> dict[str, Any]:
    """Return everything that the page says, for tools."""
    return {
        "packages": {name: version(name) for name in PACKAGES},
        "quick": quick,
        "passed": all(_passed(report) for report in reports),
        "problems": [
            {
                "name": report.problem.name,
                "requirement": report.problem.requirement,
                "reference": report.problem.reference,
                "why": report.problem.tolerance_rationale,
                "seconds": report.seconds,
                "answers": [_answer(verdict) for verdict in report.verdicts],
                "curves": [
                    {**dataclasses.asdict(curve), "observed": curve.observed}
                    for curve in report.findings.curves
                    if min(curve.errors) > 0.0 and len(curve.errors) > 1
                ],
            }
            for report in reports
        ],
    }


def _answer(verdict: Verdict) -> dict[str, Any]:
    return {
        **dataclasses.asdict(verdict.answer),
        "distance": verdict.answer.distance,
        "reference_met": verdict.answer.passed,
        "record_met": verdict.record,
    }


def _passed(report: Report) -> bool:
    return all(verdict.passed for verdict in report.verdicts)


def html(reports: Sequence[Report], *, quick: bool) -> str:
    """Return the page."""
    body = "".join([_summary(reports, quick), _overview(reports), *map(_problem, reports)])
    return _document("verification", body)


def chart_page(title: str, charts: Mapping[str, str]) -> str:
    """Return a page of charts."""
    shown = "".join(charts.values())
    return _document(title, f'<h1>{escape(title)}</h1><div class="charts">{shown}</div>')


def _document(title: str, body: str) -> str:
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>needlefem: {escape(title)}</title><style>{STYLE}</style></head>"
        f"<body>{body}</body></html>\n"
    )


def _summary(reports: Sequence[Report], quick: bool) -> str:
    verdicts = [verdict for report in reports for verdict in report.verdicts]
    failed = sum(not verdict.passed for verdict in verdicts)
    seconds = sum(report.seconds for report in reports)
    packages = ", ".join(f"{name} {version(name)}" for name in PACKAGES)
    today = dt.datetime.now(dt.UTC).date().isoformat()
    word = f'<span class="bad">{failed} failed</span>' if failed else (
        '<span class="good">all met</span>')  # fmt: skip
    kind = "Quick run" if quick else "Whole run"
    return (
        f"<h1>Verification</h1><p>{kind} of {len(reports)} problems: {len(verdicts)} answers, "
        f"{word}, {seconds:.0f} s. {today}; {escape(packages)}.</p>"
        "<p>Every answer gets two verdicts: against the reference, within a tolerance that is "
        "explained, and against the own record, to 1e-8, so that a change which stays within the "
        "tolerance is seen as well.</p>"
    )


def _overview(reports: Sequence[Report]) -> str:
    rows = []
    for report in sorted(reports, key=_passed):
        failed = sum(not verdict.passed for verdict in report.verdicts)
        word = f'<td class="bad">{failed} failed</td>' if failed else '<td class="good">met</td>'
        problem, link = report.problem, _anchor(report)
        rows.append(
            f'<tr><td>{escape(problem.requirement)}</td><td><a href="#{link}">'
            f"{escape(problem.name)}</a></td><td>{escape(problem.reference)}</td>"
            f'<td class="number">{len(report.verdicts)}</td>{word}</tr>'
        )
    head = (
        "<tr><th>requirement</th><th>problem</th><th>reference</th>"
        '<th class="number">answers</th><th></th>'
    )
    return f"<table>{head}</tr>{''.join(rows)}</table>"


def _anchor(report: Report) -> str:
    return "".join(c if c.isalnum() else "-" for c in report.problem.name)


def _problem(report: Report) -> str:
    problem = report.problem
    facts = {
        "requirement": problem.requirement,
        "reference": problem.reference,
        "tolerance": problem.tolerance_rationale,
        "time": f"{report.seconds:.1f} s",
    }
    listed = "".join(f"<dt>{key}</dt><dd>{escape(text)}</dd>" for key, text in facts.items())
    rows = "".join(map(_row, report.verdicts))
    head = (
        '<tr><th>answer</th><th class="number">value</th><th class="number">reference</th>'
        '<th class="number">off</th><th class="number">may be</th><th>reference</th>'
        "<th>record</th></tr>"
    )
    return (
        f'<h2 id="{_anchor(report)}">{escape(problem.name)}</h2><dl>{listed}</dl>'
        f'<div class="charts">{_charts(report.findings.curves)}{_shapes(report)}</div>'
        f"<details open><summary>{len(report.verdicts)} answers</summary>"
        f"<table>{head}{rows}</table></details>"
    )


def _row(verdict: Verdict) -> str:
    answer = verdict.answer
    words = {True: "same", False: "CHANGED", None: ""}
    sign = "at least " if answer.at_least else ""
    numbers = [
        f"{answer.value:.8g}",
        f"{sign}{answer.reference:.8g}",
        f"{answer.distance:.1e}",
        "" if answer.at_least else f"{answer.tolerance:.0e}",
    ]
    cells = "".join(f'<td class="number">{number}</td>' for number in numbers)
    met = '<td class="good">met</td>' if answer.passed else '<td class="bad">MISSED</td>'
    kind = "bad" if verdict.record is False else "good"
    return (
        f"<tr><td>{escape(answer.label)}</td>{cells}{met}"
        f'<td class="{kind}">{words[verdict.record]}</td></tr>'
    )


def _charts(curves: Sequence[Curve]) -> str:
    parts = []
    for quantity in dict.fromkeys(curve.quantity for curve in curves):
        some = [curve for curve in curves if curve.quantity == quantity and len(curve.errors) > 1]
        for group in [some[i : i + 8] for i in range(0, len(some), 8)]:
            slopes = [-0.5 * curve.order for curve in group if curve.order is not None]
            by_dofs = [ChartLine(c.element, c.dofs, c.errors) for c in group]
            by_time = [ChartLine(c.element, c.seconds, c.errors) for c in group]
            name = f"relative error, {quantity}"
            parts.append(loglog("Error over unknowns", "unknowns", name, by_dofs, slopes))
            parts.append(loglog("Error over time", "seconds", name, by_time))
    return "".join(parts)


def _shapes(report: Report) -> str:
    parts = []
    for shape in report.findings.shapes:
        title = (
            f"{shape.title}: displacement x {shape.magnified:g}, its size by colour; "
            "the outline is that before the load"
        )
        try:
            image = f'<img alt="{escape(title, quote=True)}" src="{picture(shape)}">'
        except NoRendererError as error:
            image = f"<p>No picture: {escape(str(error))}</p>"
        parts.append(f"<figure>{image}<figcaption>{escape(title)}</figcaption></figure>")
    return "".join(parts)
