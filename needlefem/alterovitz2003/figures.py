"""The figures of the paper of 2003 with results of needlefem, and the page that shows them."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from needlefem._arrays import Floats, Points, Vector
from needlefem.errors import SimulationError
from needlefem.insertion.result import Insertion
from needlefem.io.result_folder import write_text
from needlefem.planning.plan import plan
from needlefem.planning.result import Plan, Release
from needlefem.plotting.canvas import Canvas
from needlefem.plotting.charts import draw_depth, draw_height
from needlefem.plotting.figures import draw_stages, planner_of
from needlefem.plotting.images import Style, renderer, save
from needlefem.plotting.panel import Panel, Window
from needlefem.plotting.timeline import Timeline
from needlefem.plotting.view import TissueView, ViewOptions
from needlefem.scene import Scene
from needlefem.studies.targets import TargetTable, draw_targets, target_table

HEAD = """# Figures of the paper

This page repeats figures of Alterovitz et al., *Sensorless Planning for Medical Needle Insertion Procedures*,
IROS 2003, with the results of needlefem. `make figures` writes this page. Fig. 2 of the
paper is a sketch: `needlefem render CASE --setup` draws such a scene. The page of
[the case](../cases/prostate-2003/README.md) lists the calibrated numbers.
"""  # noqa: E501  (the line is a sentence of the page)

HEIGHTS = (-3e-3, 3e-3)
"""Range of Fig. 6: insertion heights relative to the target, m."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Figure:
    """A figure of the paper with its caption and numbers.

    Parameters
    ----------
    number : int
        Number of the figure in the paper.
    file : str
    caption : str
    rows : sequence of (quantity, value of the paper, value of needlefem)
    """

    number: int
    file: str
    caption: str
    rows: Sequence[tuple[str, str, str]]

    def text(self, folder: str) -> str:
        """Return the figure as Markdown; `folder` is the path of its file from the page."""
        table = [
            "| | paper | needlefem |",
            "|---|---|---|",
            *(f"| {' | '.join(r)} |" for r in self.rows),
        ]
        picture = f"![{self.caption}]({folder}/{self.file})"
        return "\n".join([f"## Fig. {self.number}", "", picture, "", self.caption, "", *table, ""])


def draw_figures(scene: Scene, page: Path, folder: Path) -> list[Figure]:
    """Draw all figures into a folder and write the page that shows them.

    Raises
    ------
    SimulationError
        The plan has no release, or the result of the unplanned insertion is unknown.
    """
    found = plan(scene)
    if found.best is None or found.unplanned is None or found.depth_only is None:
        why = "; ".join([found.sentence, *found.missing.values()])
        raise SimulationError(f"the figures need a planned and an unplanned release: {why}")
    depth = _depth(found.unplanned, found)
    draw_stages(scene, found, folder / "figure-1.webp", ultrasound=True)
    angle = draw_turning(found.level, depth, folder / "figure-3.png")
    moved = draw_moved_target(found.level, found.target, depth, folder / "figure-4.png")
    planner = planner_of(scene, found)
    draw_depth(planner, found, folder / "figure-5.png")
    draw_height(planner, found, folder / "figure-6.png", HEIGHTS)
    table = target_table(scene, draw_targets(scene))
    draw_targets_hit(scene, table, folder / "figure-7.png")
    figures = [
        _placement(found.unplanned, found.best),
        _turn(angle),
        _target(moved),
        _depths(found.unplanned, found.depth_only, found),
        _heights(found.best, found),
        _targets(table),
    ]
    where = folder.relative_to(page.parent).as_posix()
    write_text(page, "\n".join([HEAD, *(figure.text(where) for figure in figures)]))
    return figures


def _depth(release: Release, found: Plan) -> float:
    return float(found.level.axis.axial_coordinate(release.release_point))


def _point(point: Sequence[float] | np.ndarray, digits: int = 2) -> str:
    return "(" + ", ".join(f"{100 * float(x):.{digits}f}" for x in point) + ") cm"


def _error(value: float) -> str:
    return f"{100 * value:.3f} cm" if value >= 1e-5 else f"{100 * value:.0e} cm"


def _placement(unplanned: Release, best: Release) -> Figure:
    return Figure(
        number=1,
        file="figure-1.webp",
        caption="State before the insertion, seed released, needle retracted, placement error; "
        "without (left) and with a plan (right). The ultrasound image is synthetic.",
        rows=(
            (
                "unplanned: final position of the seed",
                "(1.41, 2.21) cm",
                _point(unplanned.placed_at, 3),
            ),
            ("unplanned: placement error", "0.79 cm", _error(unplanned.placement_error)),
            (
                "residual of the search on the planning model",
                "0.003 cm",
                _error(best.placement_error),
            ),
        ),
    )


def _turn(angle: float) -> Figure:
    way = "clockwise" if angle < 0.0 else "counter-clockwise"
    ours = f"{abs(np.degrees(angle)):.1f}\u00b0 {way}"
    return Figure(
        number=3,
        file="figure-3.png",
        caption="The needle loads the lower half of the prostate, which rotates because it is "
        "stiffer than the tissue around it.",
        rows=(("rotation of the prostate's contour", "clockwise, slightly", ours),),
    )


def _target(moved: float) -> Figure:
    return Figure(
        number=4,
        file="figure-4.png",
        caption="The target in the undeformed (cross) and in the deformed tissue (dot), before the "
        "insertion and with the tip at the depth of the target.",
        rows=(("displacement of the target", "not given", f"{1000 * moved:.2f} mm"),),
    )


def _depths(unplanned: Release, depth_only: Release, found: Plan) -> Figure:
    return Figure(
        number=5,
        file="figure-5.png",
        caption="Placement error against depth at the insertion height of the target.",
        rows=(
            ("error at the target's depth", "0.79 cm", _error(unplanned.placement_error)),
            ("best depth", "3.84 cm", f"{100 * _depth(depth_only, found):.3f} cm"),
            ("placement error at the best depth", "0.14 cm", _error(depth_only.placement_error)),
        ),
    )


def _heights(best: Release, found: Plan) -> Figure:
    axis = found.insertion.axis
    height = float(best.release_point @ axis.lateral_directions[0])
    return Figure(
        number=6,
        file="figure-6.png",
        caption="Best depth and placement error against the insertion height.",
        rows=(
            ("best height", "1.59 cm", f"{100 * height:.3f} cm"),
            (
                "best depth",
                "3.80 cm",
                f"{100 * float(axis.axial_coordinate(best.release_point)):.3f} cm",
            ),
            ("residual of the search", "0.003 cm", _error(best.placement_error)),
        ),
    )


def _targets(table: TargetTable) -> Figure:
    ours = f"{100 * table.unplanned_mean:.3f} ({100 * table.unplanned_sd:.3f}) cm"
    return Figure(
        number=7,
        file="figure-7.png",
        caption=f"{len(table.plans)} random targets: final positions of the seeds without (left) "
        "and with plans (right).",
        rows=(
            ("unplanned error, mean (SD)", "0.59 (0.10) cm", ours),
            ("residual of the searches, mean", "0.002 cm", _error(table.planned_mean)),
        ),
    )


# Fig. 4: displacement of a target. Fig. 7: many targets without and with plans.


AROUND = 0.024
"""Width of the window of Fig. 4 around the target, m."""


def draw_moved_target(insertion: Insertion, target: Vector, depth: float, path: Path) -> float:
    """Draw a target in undeformed (cross) and deformed tissue (dot), before and at a depth.

    Returns the displacement of the target at this depth, m.
    """
    film, style = Timeline(insertion), Style()
    plotter = renderer().Plotter(
        off_screen=True, shape=(1, 2), window_size=[1600, 800], border=False
    )
    plotter.set_background(style.background)
    moments = film.undeformed(), film.moments([film.time_at(depth)])[0]
    moved = film.model.displacement_at(moments[1].u, target[None])[0]
    size = float(np.linalg.norm(moved))
    texts = (
        "before the insertion",
        f"depth {100 * depth:.2f} cm: displacement {1000 * size:.2f} mm",
    )
    radius = insertion.scene.needle.tip_radius
    for number, (moment, text) in enumerate(zip(moments, texts, strict=True)):
        plotter.subplot(0, number)
        canvas = Canvas(plotter, insertion.axis, style)
        TissueView(canvas, film, ViewOptions(style=style)).show(moment)
        panel = Panel(plotter, style)
        there = target + number * moved
        if number:
            canvas.needle(insertion.axis.tip_position(depth), radius, 0.2)
            canvas.polyline(np.stack([target, there]), style.target, 3.0, 9)
        canvas.disc(there, 0.9 * radius, style.seed, 6)
        canvas.target(target, 1.0 * radius)
        centre = canvas.screen(target + 0.5 * moved)[0, :2]
        panel.look(Window(centre, AROUND, AROUND))
        panel.line(text)
        panel.note("cross: undeformed, dot: deformed")
    save(plotter, path)
    return size


def draw_targets_hit(scene: Scene, table: TargetTable, path: Path) -> Path:
    """Draw targets and final positions of seeds, without (left) and with plans (right)."""
    plans = table.plans
    columns = (
        (
            "unplanned: mean placement error",
            [plan.unplanned for plan in plans],
            table.unplanned_mean,
        ),
        (
            "planned: mean residual of the searches",
            [plan.best for plan in plans],
            table.planned_mean,
        ),
    )
    style, targets = Style(), [plan.target for plan in plans]
    plotter = renderer().Plotter(
        off_screen=True, shape=(1, 2), window_size=[1600, 860], border=False
    )
    plotter.set_background(style.background)
    film = Timeline(plans[0].level)
    for number, (title, releases, mean) in enumerate(columns):
        plotter.subplot(0, number)
        canvas, panel = Canvas(plotter, film.insertion.axis, style), Panel(plotter, style)
        TissueView(canvas, film, ViewOptions(style=style)).show(film.undeformed())
        _placements(canvas, targets, releases, scene.needle.tip_radius)
        near = np.vstack([canvas.screen(r.contour.points) for r in scene.regions.values()])
        panel.look(Window.around(near, 0.1))
        panel.line(f"{title} {_length(mean)}")
        panel.note("cross: target, dot: seed")
    return save(plotter, path)


def _placements(
    canvas: Canvas, targets: Sequence[Vector], releases: Sequence[Release | None], radius: float
) -> None:
    for target, release in zip(targets, releases, strict=True):
        if release is not None:
            ends = np.stack([target, release.placed_at])
            canvas.polyline(ends, canvas.style.target, 2.5, 4)
            canvas.disc(release.placed_at, 0.6 * radius, canvas.style.seed, 6)
        canvas.target(target, 0.9 * radius)


def _length(value: float) -> str:
    return f"{100 * value:.2f} cm" if value >= 1e-4 else f"{100 * value:.1e} cm"


# Fig. 3: rotation of the organ under the load of the needle on its lower half.


SIZE = (1280, 900)
DASHES = 36


def turned(before: Points, after: Points) -> float:
    """Return the least-squares rotation from points (n, 2) to others, rad, counter-clockwise.

    The problem is that of G. Wahba (1965) in the plane.
    """
    a, b = before - before.mean(axis=0), after - after.mean(axis=0)
    cross = float(np.sum(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]))
    return float(np.arctan2(cross, float(np.sum(a * b))))


def draw_turning(insertion: Insertion, depth: float, path: Path) -> float:
    """Draw the first region before and during an insertion; return its rotation, rad."""
    film, style = Timeline(insertion), Style()
    plotter = renderer().Plotter(off_screen=True, window_size=list(SIZE), border=False)
    plotter.set_background(style.background)
    canvas = Canvas(plotter, insertion.axis, style)
    start, moment = film.undeformed(), film.moments([film.time_at(depth)])[0]
    before, after = start.contours[0], moment.contours[0]
    angle = turned(canvas.screen(before)[:, :2], canvas.screen(after)[:, :2])
    panel = Panel(
        plotter, style, lines=1,
        legend=((style.support, "undeformed"), (style.outline, "deformed"),
                (style.path, "rotation")),
    )  # fmt: skip
    TissueView(canvas, film, ViewOptions(style=style)).show(moment)
    _dashed(canvas, before, style.support)
    for middle, turn, colour in (
        (before.mean(axis=0), 0.0, style.support),
        (after.mean(axis=0), angle, style.path),
    ):
        canvas.polyline(_hand(canvas, middle, before, turn), colour, 4.0, 3)
    canvas.needle(insertion.axis.tip_position(depth), insertion.scene.needle.tip_radius, 0.2)
    near = np.vstack([canvas.screen(before), canvas.screen(after)])
    panel.look(Window.around(near, 0.45))
    way = "clockwise" if angle < 0.0 else "counter-clockwise"
    panel.line(
        f"rotation {abs(np.degrees(angle)):.1f}\u00b0 {way} at a depth of {100 * depth:.2f} cm"
    )
    save(plotter, path)
    return angle


def _hand(canvas: Canvas, middle: Vector, outline: Points, angle: float) -> Points:
    """Return the ends of a vertical diameter, rotated by an angle on the screen."""
    size = 0.5 * float(np.ptp(canvas.screen(outline)[:, 1]))
    arm: Floats = np.array([-np.sin(angle), np.cos(angle)]) @ canvas.frame
    return np.stack([middle - size * arm, middle + size * arm])


def _dashed(canvas: Canvas, ring: Points, colour: str) -> None:
    closed = np.vstack([ring, ring[:1]])
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    ends = np.linspace(0.0, length[-1], 2 * DASHES + 1)
    at = np.stack([np.interp(ends, length, closed[:, k]) for k in range(closed.shape[1])], axis=1)
    for number in range(DASHES):
        canvas.polyline(at[2 * number : 2 * number + 2], colour, 2.5, 2.5)
