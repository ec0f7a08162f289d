"""The verification report: an HTML page with tables and charts, and the same as JSON."""

import base64
import dataclasses
import datetime as dt
import tempfile
from collections.abc import Mapping, Sequence
from html import escape
from importlib.metadata import version
from pathlib import Path

import numpy as np

from needlefem._arrays import Ints, Points
from needlefem.checks.reference_problem import Curve, Report, Shape, Verdict
from needlefem.errors import NoRendererError
from needlefem.io.result_folder import whole_file, write_json
from needlefem.plotting.canvas import THINNEST, SurfaceMesh
from needlefem.plotting.charts import ChartLine, loglog
from needlefem.plotting.images import Plotter, renderer

PACKAGES = ("needlefem", "scikit-fem", "numpy", "scipy")
STYLE = """
:root { color-scheme: light dark; --ink: #1d1d1f; --paper: #ffffff; --line: #eeebee;
  --head: #f8f9fb; --link: #2757dd; --good: #00704f; --bad: #b3261e; --chart: #ffffff; }
@media (prefers-color-scheme: dark) { :root { --ink: #ececf0; --paper: #131416; --line: #303335;
  --head: #1a1c1e; --link: #5ca5ff; --good: #4cc38a; --bad: #ff8a80; } }
body { font: 16px/1.5 Arial, "Liberation Sans", Helvetica, sans-serif; color: var(--ink);
  background: var(--paper); max-width: 56em; margin: 1.5rem auto; padding: 0 1.25rem; }
h1 { font-size: 2rem; margin: 0.5rem 0 1rem; }
h2 { font-size: 1.4rem; margin: 2.2rem 0 0.8rem; padding-top: 0.6rem;
  border-top: 1px solid var(--line); }
a { color: var(--link); }
.scroll { overflow-x: auto; margin: 0.6rem 0 1.2rem; }
table { border-collapse: collapse; font-size: 0.9rem; width: 100%;
  border: 1px solid var(--line); }
th, td { text-align: left; padding: 0.35rem 0.6rem; border-bottom: 1px solid var(--line);
  vertical-align: top; }
th { background: var(--head); }
td.number, th.number { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
.good { color: var(--good); } .bad { color: var(--bad); font-weight: 600; }
.charts { display: flex; flex-wrap: wrap; gap: 12px; margin: 1rem 0; }
.charts svg { width: 560px; max-width: 100%; height: auto; background: var(--chart);
  border: 1px solid var(--line); }
figure { margin: 0; max-width: 560px; }
figure img { width: 100%; border: 1px solid var(--line); }
dl { display: grid; grid-template-columns: 8rem 1fr; gap: 0.25rem 0.8rem; } dd { margin: 0; }
dt { font-weight: 600; } details summary { cursor: pointer; }
"""


def write_report(folder: Path, reports: Sequence[Report], *, quick: bool) -> Path:
    """Write ``verification.html`` and ``verification.json`` into a folder; return the page."""
    page = folder / "verification.html"
    with whole_file(page) as part:
        part.write_text(html(reports, quick=quick), encoding="utf-8")
    write_json(folder / "verification.json", record(reports, quick=quick))
    return page


def record(reports: Sequence[Report], *, quick: bool) -> dict[str, object]:
    """Return the content of the page as a JSON object."""
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


def _answer(verdict: Verdict) -> dict[str, object]:
    return {
        **dataclasses.asdict(verdict.answer),
        "distance": verdict.answer.distance,
        "reference_met": verdict.answer.passed,
        "record_met": verdict.record,
    }


def _passed(report: Report) -> bool:
    return all(verdict.passed for verdict in report.verdicts)


def html(reports: Sequence[Report], *, quick: bool) -> str:
    """Return the page of the report."""
    body = "".join([_summary(reports, quick), _overview(reports), *map(_problem, reports)])
    return _document("verification", body)


def chart_page(title: str, charts: Mapping[str, str]) -> str:
    """Return a page that shows charts."""
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
        '<span class="good">all within tolerance</span>')  # fmt: skip
    kind = "Quick run" if quick else "Complete run"
    return (
        f"<h1>Verification</h1><p>{kind} of {len(reports)} problems: {len(verdicts)} quantities, "
        f"{word}, {seconds:.0f} s. {today}; {escape(packages)}.</p>"
        "<p>Each quantity is compared twice. The comparison with the reference uses a tolerance "
        "whose reason is given. The comparison with the record of an earlier run uses the "
        "tolerance 1e-8, so that a change within the first tolerance is detected, too.</p>"
    )


def _overview(reports: Sequence[Report]) -> str:
    rows = []
    for report in sorted(reports, key=_passed):
        failed = sum(not verdict.passed for verdict in report.verdicts)
        word = (
            f'<td class="bad">{failed} failed</td>'
            if failed
            else '<td class="good">within tolerance</td>'
        )
        problem, link = report.problem, _anchor(report)
        rows.append(
            f'<tr><td><a href="#{link}">{escape(problem.name)}</a></td>'
            f"<td>{escape(problem.requirement)}</td><td>{escape(problem.reference)}</td>"
            f'<td class="number">{len(report.verdicts)}</td>{word}</tr>'
        )
    head = (
        "<tr><th>problem</th><th>requirement</th><th>reference</th>"
        '<th class="number">quantities</th><th>verdict</th>'
    )
    return f'<div class="scroll"><table>{head}</tr>{"".join(rows)}</table></div>'


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
        '<tr><th>quantity</th><th class="number">value</th><th class="number">reference</th>'
        '<th class="number">error</th><th class="number">tolerance</th><th>verdict</th>'
        "<th>record</th></tr>"
    )
    return (
        f'<h2 id="{_anchor(report)}">{escape(problem.name)}</h2><dl>{listed}</dl>'
        f'<div class="charts">{_charts(report.findings.curves)}{_shapes(report)}</div>'
        f"<details open><summary>{len(report.verdicts)} quantities</summary>"
        f'<div class="scroll"><table>{head}{rows}</table></div></details>'
    )


def _row(verdict: Verdict) -> str:
    answer = verdict.answer
    words = {True: "unchanged", False: "CHANGED", None: ""}
    sign = "at least " if answer.at_least else ""
    numbers = [
        f"{answer.value:.8g}",
        f"{sign}{answer.reference:.8g}",
        f"{answer.distance:.1e}",
        "" if answer.at_least else f"{answer.tolerance:.0e}",
    ]
    cells = "".join(f'<td class="number">{number}</td>' for number in numbers)
    word = "within tolerance" if answer.passed else "NOT WITHIN TOLERANCE"
    met = f'<td class="{"good" if answer.passed else "bad"}">{word}</td>'
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
            parts.append(loglog("Error against unknowns", "unknowns", name, by_dofs, slopes))
            parts.append(loglog("Error against time", "seconds", name, by_time))
    return "".join(parts)


def _shapes(report: Report) -> str:
    parts = []
    for shape in report.findings.shapes:
        title = (
            f"{shape.title}: displacement x {shape.magnified:g}, its magnitude as colour; "
            "outline: undeformed"
        )
        try:
            image = f'<img alt="{escape(title, quote=True)}" src="{picture(shape)}">'
        except NoRendererError as error:
            image = f"<p>No picture: {escape(str(error))}</p>"
        parts.append(f"<figure>{image}<figcaption>{escape(title)}</figcaption></figure>")
    return "".join(parts)


# Pictures of deformed meshes, as PNG inside the page.


PICTURE_SIZE = (900, 640)
"""Width and height of a picture of a mesh, pixels."""
MOST_EDGES = 5000
"""Largest number of cells with visible edges."""


def picture(shape: Shape) -> str:
    """Return a deformed mesh over its undeformed outline as a data URL.

    Raises
    ------
    NoRendererError
        No renderer is available.
    """
    pv = renderer()
    seen = SurfaceMesh(shape.solution.space)
    moved = seen.displaced(shape.solution.u)
    at = _flat(seen.rest + shape.magnified * moved)
    plotter = pv.Plotter(off_screen=True, window_size=list(PICTURE_SIZE), border=False)
    plotter.set_background("white")
    surface = pv.PolyData(at, faces=_counted(seen.polygons))
    surface["displacement"] = np.linalg.norm(moved, axis=1)
    plotter.add_mesh(
        surface,
        scalars="displacement",
        cmap="viridis",
        lighting=False,
        scalar_bar_args={
            "title": "displacement (m)\n", "title_font_size": 20, "n_labels": 3,
            "fmt": "%.3g", "color": "#202020", "label_font_size": 22,
            "vertical": True, "position_x": 0.85, "position_y": 0.2, "height": 0.6, "width": 0.06,
        },
    )  # fmt: skip
    if shape.solution.space.mesh.nelements <= MOST_EDGES:
        edges = pv.PolyData(at, lines=_counted(seen.edges))
        plotter.add_mesh(edges, color="#303030", line_width=THINNEST, lighting=False)
    outline = pv.PolyData(_flat(seen.rest), lines=_counted(seen.outline))
    plotter.add_mesh(outline, color="#D55E00", line_width=2.5, lighting=False)
    plotter.view_xy()
    plotter.enable_parallel_projection()
    plotter.camera.zoom(1.1)
    return _png(plotter)


def _flat(points: Points) -> Points:
    return np.column_stack([points, np.zeros(len(points))])


def _counted(numbers: Ints) -> Ints:
    """Return polygons or lines, shape (n, k), as VTK lists them."""
    return np.column_stack([np.full(len(numbers), numbers.shape[1]), numbers]).ravel()


def _png(plotter: Plotter) -> str:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "shape.png"
        plotter.screenshot(path)
        plotter.close()
        return "data:image/png;base64," + base64.b64encode(path.read_bytes()).decode("ascii")
