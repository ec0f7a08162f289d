"""Charts by matplotlib: forces, stick and slip, placement errors, convergence, computing times.

matplotlib is imported only when a chart is drawn, and without pyplot: a chart leaves no state
behind. The suffix of a file chooses PNG, PDF or SVG. Equal data give equal files.
"""

import dataclasses
import io
import math
from collections.abc import Callable, Sequence
from html import escape
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from needlefem._arrays import Bools, Floats, Vector
from needlefem._progress import doing
from needlefem.errors import NoRendererError
from needlefem.insertion.cut_path import TipTrajectory
from needlefem.insertion.result import Insertion
from needlefem.insertion.state import TipPhase
from needlefem.io.result_folder import whole_file
from needlefem.planning.planner import Planner
from needlefem.planning.reading import InsertionReader, ended_early
from needlefem.planning.result import Plan
from needlefem.plotting.images import Style, force_unit, require_kind, save_still
from needlefem.scene import Scene

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

KINDS = (".png", ".pdf", ".svg")
DOTS = 200
"""Resolution of a chart as PNG, pixels per inch."""
UNDATED = {"Date": None, "Creator": None, "Format": None, "Type": None}
"""Metadata that matplotlib omits from an SVG file, so that equal charts are equal files."""


def new_chart(
    width: float = 8.0, height: float = 5.0, rows: int = 1
) -> "tuple[Figure, list[Axes]]":
    """Return an empty chart, width and height in inches, with panels that share their x axis.

    Raises
    ------
    NoRendererError
        matplotlib is not installed.
    """
    if find_spec("matplotlib") is None:
        raise NoRendererError("charts need matplotlib: pip install 'needlefem[render]'")
    from matplotlib.figure import Figure  # noqa: PLC0415  (only a chart needs it)

    figure = Figure(figsize=(width, height), dpi=DOTS, layout="constrained")
    panels = list(figure.subplots(rows, 1, sharex=True, squeeze=False)[:, 0])
    for axes in panels:
        axes.grid(color=Style.grid)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
    return figure, panels


def save_chart(figure: "Figure", path: Path) -> Path:
    """Write a chart in the format of the file's suffix.

    Raises
    ------
    CaseError
        The suffix is none of `KINDS`.
    """
    require_kind(path, KINDS)
    doing(f"drawing {path.name!a}")
    if path.suffix == ".png":
        written = io.BytesIO()
        figure.savefig(written, format="rgba", dpi=DOTS)
        width, height = (round(DOTS * side) for side in figure.get_size_inches())
        image = np.frombuffer(written.getvalue(), dtype=np.uint8).reshape(height, width, 4)
        return save_still(image[:, :, :3], path)
    with whole_file(path) as part:
        part.write_bytes(_vector(figure, path.suffix[1:]))
    return path


def _vector(figure: "Figure", kind: str) -> bytes:
    """Return a chart as PDF or SVG; texts remain texts."""
    from matplotlib import rc_context  # noqa: PLC0415

    written = io.BytesIO()
    with rc_context({"svg.hashsalt": "needlefem", "svg.fonttype": "none", "pdf.fonttype": 42}):
        figure.savefig(
            written, format=kind, metadata=UNDATED if kind == "svg" else {"CreationDate": None}
        )
    return written.getvalue()


def _svg(title: str, draw: "Callable[[], Figure]") -> str:
    """Return a chart as an SVG element of an HTML page, or a sentence without matplotlib."""
    try:
        text = _vector(draw(), "svg").decode("utf-8")
    except NoRendererError as error:
        return f"<p>No chart: {escape(str(error))}</p>"
    label = f'<svg role="img" aria-label="{escape(title, quote=True)}" '
    return text[text.index("<svg") :].replace("<svg ", label, 1)


# Charts of convergence and of computing times, with logarithmic axes.


COLOURS = (
    "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#7F7F7F",
)  # fmt: skip
"""Colours for colour-blind readers (Okabe and Ito)."""
DASHES, MARKERS = ("-", "--", ":", "-."), ("o", "s", "^")


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


def loglog(
    title: str, x_label: str, y_label: str, lines: Sequence[ChartLine], slopes: Sequence[float] = ()
) -> str:
    """Return a chart as SVG; `slopes` of the theory are drawn as triangles.

    Lines with a number that is not positive (an error of zero) are omitted. Without matplotlib
    the result is a sentence that names the missing package.
    """
    shown = [line for line in lines if min(*line.x, *line.y) > 0.0]
    if not shown:
        return ""
    return _svg(title, lambda: _loglog_figure(title, x_label, y_label, shown, slopes))


def _loglog_figure(
    title: str, x_label: str, y_label: str, shown: Sequence[ChartLine], slopes: Sequence[float]
) -> "Figure":
    figure, (axes,) = new_chart(7.0, 4.2)
    axes.set(title=title, xlabel=x_label, ylabel=y_label, xscale="log", yscale="log")
    axes.set_xlim(*_decades([x for line in shown for x in line.x]))
    axes.set_ylim(*_decades([y for line in shown for y in line.y]))
    for number, line in enumerate(shown):
        colour = COLOURS[number % len(COLOURS)]
        dash, marker = DASHES[(number // 2) % len(DASHES)], MARKERS[number % len(MARKERS)]
        axes.plot(line.x, line.y, dash, color=colour, marker=marker, ms=5, label=line.name)
        rings = [line.x[at] for at in line.ringed], [line.y[at] for at in line.ringed]
        axes.plot(*rings, "o", ms=11, mfc="none", color=colour, gid="ringed")
    for number, slope in enumerate(sorted(set(slopes))):
        _triangle(axes, slope, number)
    figure.legend(loc="outside right upper", frameon=False)
    return figure


def _decades(values: Sequence[float]) -> tuple[float, float]:
    """Return the whole powers of ten around values."""
    low, high = math.log10(min(values)), math.log10(max(values))
    return 10.0 ** math.floor(low - 0.02), 10.0 ** math.ceil(high + 0.02)


def _triangle(axes: "Axes", slope: float, number: int) -> None:
    """Draw a triangle with a given slope over half a power of ten."""
    begin = math.log10(axes.get_xlim()[0]) + 0.15
    low = math.log10(axes.get_ylim()[0]) + 0.12 + 0.75 * number
    high = min(low + 0.5 * abs(slope), math.log10(axes.get_ylim()[1]))
    x = 10.0 ** np.array([begin, begin + (high - low) / abs(slope)])
    y = 10.0 ** np.array([low, high])
    axes.plot(x[[0, 0, 1, 0]], y[[1, 0, 0, 1]], color="#555555", lw=1.0)
    axes.annotate(f"slope {slope:g}", (x[1], y[0]), (4, 0), textcoords="offset points", fontsize=8)


def bars(title: str, label: str, rows: Sequence[Bar]) -> str:
    """Return a bar chart with a logarithmic axis and whiskers for the measured range as SVG.

    Bars with numbers that are not positive are omitted. Without matplotlib the result is a
    sentence that names the missing package.
    """
    shown = [bar for bar in rows if bar.value > 0.0 and (bar.least is None or bar.least > 0.0)]
    if not shown:
        return ""
    return _svg(title, lambda: bar_figure(title, label, shown))


def bar_figure(title: str, label: str, rows: Sequence[Bar]) -> "Figure":
    """Return a bar chart of positive numbers; see `bars`."""
    figure, (axes,) = new_chart(7.0, 1.2 + 0.26 * len(rows))
    axes.set(title=title, xlabel=label, xscale="log")
    ends = [end for bar in rows for end in (bar.value, bar.least, bar.most) if end is not None]
    axes.set_xlim(*_decades(ends))
    axes.grid(visible=False, axis="y")
    colours = [COLOURS[bar.series % len(COLOURS)] for bar in rows]
    values = np.array([bar.value for bar in rows])
    axes.barh(range(len(rows)), values, height=0.65, color=colours, alpha=0.75)
    least = [bar.value if bar.least is None else bar.least for bar in rows]
    most = [bar.value if bar.most is None else bar.most for bar in rows]
    ranged = np.array([bar.least is not None and bar.most is not None for bar in rows])
    reach = np.array([values - least, most - values])[:, ranged]
    if ranged.any():
        axes.errorbar(
            values[ranged], np.flatnonzero(ranged), xerr=reach, fmt="none", ecolor="k", capsize=2
        )
    axes.set_yticks(range(len(rows)), [bar.name for bar in rows])
    axes.invert_yaxis()
    return figure


# Charts of a motion: forces against depth, stick and slip against time.


STICK_COLOURS = ("#0072B2", "#8C8C8C", "#D55E00")
"""Colours of backward slip, stick, and forward slip."""
STICK_NAMES = ("slips backward", "sticks", "slips forward")
EVENTS = {
    "puncture": ("v", "puncture"), "rupture": ("s", "rupture"), "release": ("D", "release"),
    "retraction_start": ("<", "retraction starts"), "recontact": (">", "tip at the crack front"),
    "exit": ("X", "exit"), "entry": ("P", "entry into the path"),
}  # fmt: skip
"""Marker and name of the events in a chart of forces; stick and slip have a chart of their own."""
MOST_ARROWS = 12
"""Largest number of arrows along a curve."""
HEAD = "-|>,head_length=0.8,head_width=0.25"
"""Shape of an arrow head: much longer than wide, so that its direction can be seen."""
SHORTEST = 0.1
"""Shortest course with an arrow, relative to the range of depths."""


def draw_forces(insertion: Insertion, path: Path) -> Path:
    """Draw the force on the needle, and the force on its tip, against depth, with events.

    Arrows point in the direction of the motion.
    """
    return save_chart(force_figure(insertion), path)


def force_figure(insertion: Insertion) -> "Figure":
    """Return the chart of `draw_forces`."""
    figure, (axes,) = new_chart()
    depths = 100.0 * insertion.depths
    whole = np.array([state.force for state in insertion.states])
    tip = np.array([state.tip_force for state in insertion.states])
    axes.set(
        title="Force on the needle", xlabel="depth of the tip (cm)",
        ylabel=f"force ({force_unit(insertion.model.dim)})",
    )  # fmt: skip
    axes.axhline(0.0, color=Style.text, lw=0.8)
    axes.plot(depths, whole, color=Style.seed, lw=2.0, label="tip and shaft")
    axes.plot(depths, tip, color=Style.target, lw=1.2, label="tip")
    for first, last in _courses(depths):
        _arrow(axes, depths[first : last + 1], whole[first : last + 1])
    times = np.array([state.time for state in insertion.states])
    for kind, (marker, name) in EVENTS.items():
        when = [event for event in insertion.events if event.kind == kind]
        at = [_nearest(times, depths, event.time, 100.0 * event.depth) for event in when]
        if at:
            axes.plot(
                depths[at], whole[at], marker, color=Style.needle, mec="white", ms=8, label=name
            )
    figure.legend(loc="outside upper center", ncols=4, frameon=False)
    return figure


def _courses(depths: Floats) -> list[tuple[int, int]]:
    """Return first and last state of the longest parts of a motion in one direction."""
    turns, way = [0], 0.0
    for number, step in enumerate(np.sign(np.diff(depths))):
        if way * step < 0.0:
            turns.append(number)
        way = step or way
    ends = [*turns[1:], len(depths) - 1]
    length = np.abs(depths[ends] - depths[turns])
    order = np.argsort(-length, kind="stable")[:MOST_ARROWS]
    return sorted((turns[n], ends[n]) for n in order if length[n] > SHORTEST * np.ptp(depths))


def _arrow(axes: "Axes", x: Floats, y: Floats) -> None:
    """Draw an arrow head on the middle of a curve whose x is monotonic."""
    travel = np.abs(x - x[0])
    share = np.array([0.48, 0.5]) * travel[-1]
    before, middle = zip(*(np.interp(share, travel, values) for values in (x, y)), strict=True)
    axes.annotate(
        "", xy=middle, xytext=before,
        arrowprops={
            "arrowstyle": HEAD, "color": Style.seed, "mutation_scale": 18,
            "shrinkA": 0, "shrinkB": 0,
        },
    )  # fmt: skip


def _nearest(times: Floats, depths: Floats, time: float, depth: float) -> int:
    """Return the number of the state of an event; in path following all times may be zero."""
    spans = [float(np.ptp(values)) or 1.0 for values in (times, depths)]
    return int(np.argmin(np.hypot((times - time) / spans[0], (depths - depth) / spans[1])))


def draw_sticking(insertion: Insertion, path: Path) -> Path:
    """Draw which segments of the cut path stick or slip, against time."""
    times, places, ways = _stick_map(insertion)
    figure, (axes,) = new_chart()
    from matplotlib.colors import ListedColormap  # noqa: PLC0415
    from matplotlib.patches import Patch  # noqa: PLC0415

    axes.set(
        title="Stick and slip along the shaft", xlabel="time (s)",
        ylabel="position along the cut path (cm)",
        xlim=(0.0, 1.02 * float(times[-1]) or 1.0),
        ylim=(0.0, 104.0 * float(places[-1]) or 1.0),
    )  # fmt: skip
    if ways.size:
        axes.pcolormesh(
            times, 100.0 * places, np.ma.masked_greater(ways.T, 1.0),
            cmap=ListedColormap(STICK_COLOURS), vmin=-1.5, vmax=1.5, rasterized=True,
        )  # fmt: skip
    patches = [
        Patch(color=colour, label=name)
        for colour, name in zip(STICK_COLOURS, STICK_NAMES, strict=True)
    ]
    figure.legend(handles=patches, loc="outside upper center", ncols=3, frameon=False)
    return save_chart(figure, path)


def _stick_map(insertion: Insertion) -> tuple[Floats, Floats, Floats]:
    """Return times, positions along the path (m), and directions of slip; 9 is no contact."""
    states = [state for state in insertion.states if state.tip_phase is not TipPhase.RUPTURE]
    stiffness = insertion.instrument.lateral_penalty
    lengths = [1.0 / (p.compliance * stiffness) for p in insertion.segments[1:]]
    last = max((s.inserted_length for s in states), default=0.0)
    places = np.concatenate([[0.0], np.cumsum(lengths)])
    places = np.append(places, last) if last > places[-1] * (1.0 + 1e-9) else places
    times = np.array([state.time for state in states])
    keep = np.concatenate([[True], np.diff(times) > 0.0])
    ways = np.full((int(keep.sum()) - 1, len(places) - 1), 9.0)
    for row, state in enumerate(np.array(states, dtype=object)[keep][1:]):
        slipping = np.ones(len(state.friction_force)) if state.slipping is None else state.slipping
        filled = slipping[1 : ways.shape[1] + 1]
        ways[row, : len(filled)] = filled
    return times[keep], places, ways


# Charts of a plan: error against depth, best depth and error against lateral offset.


CURVE_POINTS = 200
HEIGHTS = 9
"""Insertions for the chart of the offset, the part of a plan's pictures with the highest cost."""


def draw_depth(planner: Planner, plan: Plan, path: Path) -> Path:
    """Draw the placement error against depth at the lateral offset of the target (Fig. 5).

    The curve is bold where the seed comes to rest inside of the target's region. Dots are the
    computed states; between them the path of the tip is straight.
    """
    simulation = planner.simulation
    scene, insertion = simulation.scene, simulation.insert(planner.entry)
    title = "Placement error at the lateral offset of the target"
    if ended_early(insertion):
        title += f"; unknown beyond {100.0 * insertion.depths[-1]:.2f} cm"
    deepest = min(scene.motion.max_depth, insertion.depths[-1])
    depths = np.linspace(0.0, deepest, CURVE_POINTS)
    error, inside = _placement_errors(insertion, plan.target, depths)
    figure, (axes,) = new_chart()
    axes.set(title=title, xlabel="insertion depth (cm)", ylabel="placement error (cm)")
    axes.plot(
        100.0 * depths, error, color=Style.seed, lw=1.2, label="a seed released at this depth"
    )
    if inside.any():
        axes.plot(
            100.0 * depths, np.where(inside, error, np.nan), color=Style.seed, lw=4.0,
            label="at rest in the region of the target",
        )  # fmt: skip
    states = np.unique(insertion.depths[(insertion.depths >= 0.0) & (insertion.depths <= deepest)])
    axes.plot(
        100.0 * states, _placement_errors(insertion, plan.target, states)[0], "o",
        color=Style.needle, ms=3, label="computed states",
    )  # fmt: skip
    if plan.depth_only is not None:
        at = 100.0 * float(insertion.axis.axial_coordinate(plan.depth_only.release_point))
        least = 100.0 * plan.depth_only.placement_error
        label = f"best depth {at:.2f} cm: error {least:.2g} cm"
        axes.plot(
            [at], [least], "o", color=Style.target, mec="white", ms=10, clip_on=False, label=label
        )
    axes.set_xlim(left=0.0)
    axes.set_ylim(bottom=0.0)
    figure.legend(loc="outside upper center", ncols=2, frameon=False)
    return save_chart(figure, path)


def _placement_errors(insertion: Insertion, target: Vector, depths: Floats) -> tuple[Floats, Bools]:
    """Return the error of a release at each depth (m), in cm, and whether it is in the region."""
    cut = TipTrajectory(insertion)
    reached = [cut.at_depth(float(depth)) for depth in depths]
    points = np.array([np.full(len(target), np.nan) if r is None else r.point for r in reached])
    error: Floats = 100.0 * np.linalg.norm(points - target, axis=1)
    return error, _inside_target_region(insertion.scene, target, points)


def _inside_target_region(scene: Scene, target: Vector, points: Floats) -> Bools:
    for region in scene.regions.values():
        if region.contour.contains(target[None])[0]:
            return region.contour.contains(points)
    return np.isfinite(points[:, 0])


def draw_height(
    planner: Planner, plan: Plan, path: Path, heights: tuple[float, float] | None = None
) -> Path:
    """Draw best depth and placement error against the insertion height (Fig. 6).

    `heights` (m, relative to the target) are the limits of the picture; the case's range by
    default. Each dot is an insertion; nothing is drawn between them.
    """
    dots = 100.0 * _height_table(planner, plan, heights)
    assert plan.best is not None
    height = 100.0 * float(plan.best.release_point @ plan.insertion.axis.lateral_directions[0])
    best = dots[np.argmin(np.abs(dots[:, 0] - height))]
    figure, panels = new_chart(8.0, 7.5, rows=2)
    label = f"plan: height {best[0]:.2f} cm, depth {best[1]:.2f} cm"
    quantities = ("best depth (cm)", "placement error (cm)")
    for number, (axes, quantity) in enumerate(zip(panels, quantities, strict=True), start=1):
        axes.set_ylabel(quantity)
        axes.axvline(best[0], color=Style.target, lw=0.8)
        axes.plot(dots[:, 0], np.abs(dots[:, number]), "o", color=Style.seed, label="an insertion")
        axes.plot(
            best[:1], np.abs(best[number : number + 1]), "o", color=Style.target, mec="white",
            ms=11, clip_on=False, label=label,
        )  # fmt: skip
    panels[1].set_ylim(bottom=0.0)
    panels[1].set_xlabel("insertion height (cm)")
    figure.align_ylabels(panels)
    figure.legend(
        handles=panels[0].get_lines()[1:], loc="outside upper center", ncols=2, frameon=False
    )
    return save_chart(figure, path)


def _height_table(planner: Planner, plan: Plan, within: tuple[float, float] | None) -> Floats:
    """Return rows of insertion height, best depth, signed lateral error, m, with the plan's."""
    low, high = within or planner.simulation.scene.planning.offset_range
    known = {0.0: plan.level, float(plan.solution.height[0]): plan.insertion}
    rows = []
    for height in np.union1d(np.linspace(low, high, HEIGHTS), list(known)).tolist():
        insertion = known.get(height)
        row = _closest(insertion or planner.insertion(np.array([height])), plan.target)
        if row is not None:
            rows.append(row)
    return np.array(rows)


def _closest(insertion: Insertion, target: Vector) -> tuple[float, float, float] | None:
    """Return height, depth and signed lateral error of the release closest to a target, m.

    The result is None if the insertion ended early or the skin is not cut.
    """
    reach, lateral = (
        InsertionReader(insertion, target).nearest().reach,
        insertion.axis.lateral_directions[0],
    )
    if reach is None:
        return None
    apart = reach.point - target
    miss = float(np.copysign(np.linalg.norm(apart), apart @ lateral))
    return float(insertion.axis.entry @ lateral), reach.depth, miss
