"""The verification report: an HTML page with tables and SVG charts, and the same as JSON."""

import base64
import dataclasses
import datetime as dt
import math
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
from needlefem.plotting.canvas import THINNEST
from needlefem.plotting.images import Plotter, renderer
from needlefem.plotting.view import SurfaceMesh

COLOURS = (
    "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#7F7F7F",
)  # fmt: skip
"""Colours for colour-blind readers (Okabe and Ito)."""
DASHES = ("", "7 4", "2 3", "9 3 2 3")
WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 560.0, 340.0, 64.0, 172.0, 30.0, 44.0
ROW, BAR, LONGEST, LETTER = 19.0, 12.0, 290.0, 6.6
"""Bar charts: height of a row and of its bar, largest length, width of a letter, in pixels."""


@dataclasses.dataclass(frozen=True)
class ChartLine:
    """A named line of positive numbers; `ringed` are the indices of highlighted points."""

    name: str
    x: Sequence[float]
    y: Sequence[float]
    ringed: Sequence[int] = ()


@dataclasses.dataclass(frozen=True)
class Bar:
    """A named positive number of a series, with the smallest and the largest measured value."""

    name: str
    value: float
    least: float | None = None
    most: float | None = None
    series: int = 0


class _Axis:
    """A logarithmic axis over whole powers of ten, from `begin` to `end` in pixels."""

    def __init__(self, values: Sequence[float], begin: float, end: float) -> None:
        low, high = math.log10(min(values)), math.log10(max(values))
        self.low, self.high = math.floor(low - 0.02), math.ceil(high + 0.02)
        self._begin, self._scale = begin, (end - begin) / (self.high - self.low)

    def at(self, value: float) -> float:
        return self._begin + (math.log10(value) - self.low) * self._scale

    @property
    def ticks(self) -> list[int]:
        step = 1 if self.high - self.low <= 7 else 2
        return list(range(self.low, self.high + 1, step))


def loglog(
    title: str, x_label: str, y_label: str, lines: Sequence[ChartLine], slopes: Sequence[float] = ()
) -> str:
    """Return a chart as SVG; `slopes` of the theory are drawn as triangles.

    Lines with a number that is not positive (an error of zero) are omitted.
    """
    shown = [line for line in lines if min(*line.x, *line.y) > 0.0]
    if not shown:
        return ""
    across = _Axis([x for line in shown for x in line.x], LEFT, WIDTH - RIGHT)
    up = _Axis([y for line in shown for y in line.y], HEIGHT - BOTTOM, TOP)
    parts = [*_frame(title, x_label, y_label, across, up)]
    for number, line in enumerate(shown):
        parts += _line(number, line, across, up)
    for number, slope in enumerate(sorted(set(slopes))):
        parts.append(_triangle(slope, number, across, up))
    size = f'viewBox="0 0 {WIDTH:g} {HEIGHT:g}"'
    label = escape(title, quote=True)
    return f'<svg {size} role="img" aria-label="{label}">{"".join(parts)}</svg>'


def bars(title: str, label: str, rows: Sequence[Bar]) -> str:
    """Return a bar chart with a logarithmic axis and whiskers for the measured range as SVG.

    Bars with numbers that are not positive are omitted.
    """
    shown = [bar for bar in rows if bar.value > 0.0 and (bar.least is None or bar.least > 0.0)]
    if not shown:
        return ""
    ends = [end for bar in shown for end in (bar.value, bar.least, bar.most) if end is not None]
    names = 24.0 + LETTER * max(len(bar.name) for bar in shown)
    across = _Axis(ends, names, names + LONGEST)
    bottom = TOP + ROW * len(shown) + 4.0
    parts = [_text(12.0, 16.0, title, 'class="title"')]
    for power in across.ticks:
        x = across.at(10.0**power)
        parts.append(f'<path class="grid" d="M{x:.1f} {TOP:g}V{bottom:g}"/>')
        parts.append(_power(x, bottom + 18.0, power, 'text-anchor="middle"'))
    for number, bar in enumerate(shown):
        parts += _bar(bar, TOP + ROW * (number + 0.5) + 2.0, across, names)
    middle = names + 0.5 * LONGEST
    parts.append(_text(middle, bottom + BOTTOM - 8.0, label, 'text-anchor="middle"'))
    size = f'viewBox="0 0 {names + LONGEST + 24.0:g} {bottom + BOTTOM:g}"'
    called = escape(title, quote=True)
    return f'<svg {size} role="img" aria-label="{called}">{"".join(parts)}</svg>'


def _bar(bar: Bar, y: float, across: _Axis, names: float) -> list[str]:
    colour = COLOURS[bar.series % len(COLOURS)]
    left, right = across.at(10.0**across.low), across.at(bar.value)
    box = f'x="{left:.1f}" y="{y - 0.5 * BAR:.1f}" width="{right - left:.1f}" height="{BAR:g}"'
    parts = [
        _text(names - 8.0, y + 4.0, bar.name, 'text-anchor="end"'),
        f'<rect {box} fill="{colour}" fill-opacity="0.75"/>',
    ]
    if bar.least is not None and bar.most is not None:
        low, high = across.at(bar.least), across.at(bar.most)
        ends = f"M{low:.1f} {y - 3:.1f}v6M{high:.1f} {y - 3:.1f}v6"
        line = f'd="M{low:.1f} {y:.1f}H{high:.1f}{ends}"'
        parts.append(f'<path {line} fill="none" stroke="#000000" stroke-width="1.2"/>')
    return parts


def _text(x: float, y: float, text: str, extra: str = "") -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" {extra}>{escape(text)}</text>'


def _power(x: float, y: float, power: int, extra: str) -> str:
    raised = f'<tspan dy="-5" font-size="9">{power}</tspan>'
    return f'<text x="{x:.1f}" y="{y:.1f}" {extra}>10{raised}</text>'


def _frame(title: str, x_label: str, y_label: str, across: _Axis, up: _Axis) -> list[str]:
    right, bottom = WIDTH - RIGHT, HEIGHT - BOTTOM
    parts = [_text(LEFT, 16.0, title, 'class="title"')]
    for power in across.ticks:
        x = across.at(10.0**power)
        parts.append(f'<path class="grid" d="M{x:.1f} {TOP:g}V{bottom:g}"/>')
        parts.append(_power(x, bottom + 18.0, power, 'text-anchor="middle"'))
    for power in up.ticks:
        y = up.at(10.0**power)
        parts.append(f'<path class="grid" d="M{LEFT:g} {y:.1f}H{right:g}"/>')
        parts.append(_power(LEFT - 8.0, y + 4.0, power, 'text-anchor="end"'))
    middle = 0.5 * (LEFT + right)
    parts.append(_text(middle, HEIGHT - 8.0, x_label, 'text-anchor="middle"'))
    turn = f'text-anchor="middle" transform="rotate(-90 14 {0.5 * (TOP + bottom):.1f})"'
    parts.append(_text(14.0, 0.5 * (TOP + bottom), y_label, turn))
    return parts


def _line(number: int, line: ChartLine, across: _Axis, up: _Axis) -> list[str]:
    colour = COLOURS[number % len(COLOURS)]
    dash = DASHES[(number // 2) % len(DASHES)]
    points = [(across.at(x), up.at(y)) for x, y in zip(line.x, line.y, strict=True)]
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    stroke = f'fill="none" stroke="{colour}" stroke-width="1.8" stroke-dasharray="{dash}"'
    parts = [f'<polyline points="{path}" {stroke}/>']
    parts += [_marker(number, x, y, colour) for x, y in points]
    ring = f'r="6.4" fill="none" stroke="{colour}" stroke-width="1.4"'
    parts += [f'<circle cx="{x:.1f}" cy="{y:.1f}" {ring}/>'
              for x, y in (points[place] for place in line.ringed)]  # fmt: skip
    at = TOP + 8.0 + 17.0 * number
    x = WIDTH - RIGHT + 14.0
    parts.append(f'<path d="M{x:g} {at:g}h22" {stroke}/>')
    parts.append(_marker(number, x + 11.0, at, colour))
    parts.append(_text(x + 30.0, at + 4.0, line.name))
    return parts


def _marker(number: int, x: float, y: float, colour: str) -> str:
    if number % 3 == 0:
        return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3.4" fill="{colour}"/>'
    if number % 3 == 1:
        return f'<rect x="{x - 3:.1f}" y="{y - 3:.1f}" width="6" height="6" fill="{colour}"/>'
    return f'<path d="M{x - 4:.1f} {y + 3:.1f}h8l-4 -7z" fill="{colour}"/>'


def _triangle(slope: float, number: int, across: _Axis, up: _Axis) -> str:
    """Return a triangle with a given slope over half a power of ten."""
    begin, low = across.low + 0.15, up.low + 0.12 + 0.75 * number
    high = min(low + 0.5 * abs(slope), up.high)
    x0, x1 = across.at(10.0**begin), across.at(10.0 ** (begin + (high - low) / abs(slope)))
    y0, y1 = up.at(10.0**low), up.at(10.0**high)
    path = f'<path class="slope" d="M{x0:.1f} {y1:.1f}V{y0:.1f}H{x1:.1f}Z"/>'
    return path + _text(x1 + 4.0, y0, f"slope {slope:g}", 'class="small"')


# The report as one HTML page without external files, and as JSON.


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
.charts svg { width: 560px; max-width: 100%; background: var(--chart);
  border: 1px solid var(--line); }
svg text { font: 11px Arial, "Liberation Sans", sans-serif; fill: #202020; }
svg .title { font-weight: 600; font-size: 12px; } svg .small { font-size: 10px; }
svg .grid { stroke: #e4e4e8; stroke-width: 1; } svg .slope { fill: none; stroke: #555; }
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
