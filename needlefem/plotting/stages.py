"""Picture of the stages of a plan: initial state, release, retracted needle, placement error."""

import dataclasses
from pathlib import Path

import numpy as np

from needlefem._arrays import Vector
from needlefem.insertion.result import Insertion
from needlefem.planning.result import Plan, PlanStatus, Release, headline
from needlefem.plotting.canvas import Canvas
from needlefem.plotting.images import Style, renderer, save
from needlefem.plotting.panel import Panel, Window, synthetic_ultrasound
from needlefem.plotting.timeline import Frame, Timeline
from needlefem.plotting.view import TissueView, ViewOptions
from needlefem.scene import Scene

SIZE = (1600, 2360)


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class _Column:
    """One column of the picture: an insertion, its release, and the view options."""

    title: str
    film: Timeline
    release: Release
    target: Vector
    look: ViewOptions
    error: str

    @property
    def insertion(self) -> Insertion:
        return self.film.insertion

    @property
    def depth(self) -> float:
        return float(self.insertion.axis.axial_coordinate(self.release.release_point))


def draw_stages(scene: Scene, plan: Plan, path: Path, *, ultrasound: bool = False) -> Path:
    """Draw insertion, release and placement, unplanned (left) and planned (right).

    If the result without a plan is unknown, only the right column is drawn. The rows are: before
    the insertion, seed released, needle retracted, placement error, as in Fig. 1 of the paper of
    2003. With `ultrasound` an image is mapped on the tissue and deforms with it.
    """
    if plan.best is None:
        raise ValueError("a plan without a release has no stages to draw")
    style = Style()
    look = ViewOptions(style=style)
    if ultrasound:
        level = plan.level
        texture = synthetic_ultrasound(scene, level.model, level.axis)
        look = ViewOptions(style=style, texture=texture)
    columns = _columns(plan, look)
    size = [SIZE[0] * len(columns) // 2, SIZE[1]]
    plotter = renderer().Plotter(
        off_screen=True, shape=(4, len(columns)), window_size=size, border=False
    )
    plotter.set_background(style.background)
    for across, column in enumerate(columns):
        for down, stage in enumerate((_before, _released, _retracted, _error)):
            plotter.subplot(down, across)
            canvas = Canvas(plotter, column.insertion.axis, style)
            stage(canvas, Panel(plotter, style), column, scene.needle.tip_radius)
    return save(plotter, path)


def _columns(plan: Plan, look: ViewOptions) -> list[_Column]:
    """Return the columns: the unplanned insertion, if it is known, and the planned one."""
    first, found = headline(plan), []
    if plan.unplanned is not None:
        found.append(
            _Column(
                title="unplanned", film=Timeline(plan.level), release=plan.unplanned,
                target=plan.target, look=look,
                error=f"placement error {100.0 * plan.unplanned.placement_error:.2f} cm",
            )
        )  # fmt: skip
    if plan.best is not None:
        error = first.title
        if plan.status is not PlanStatus.PLANNED:
            error = f"{plan.status}: placement error {100.0 * plan.best.placement_error:.2g} cm"
        found.append(
            _Column(
                title="planned", film=Timeline(plan.insertion), release=plan.best,
                target=plan.target, look=look, error=error,
            )
        )  # fmt: skip
    return found


def _tissue(canvas: Canvas, panel: Panel, column: _Column, moment: Frame) -> None:
    TissueView(canvas, column.film, column.look).show(moment)
    if column.look.note:
        panel.note(column.look.note)


def _window(canvas: Canvas, column: _Column) -> Window:
    """Return a window from outside of the skin to behind the target."""
    depth = float(column.insertion.axis.axial_coordinate(column.target))
    width = depth + 0.037
    centre = canvas.screen(column.target)[0, :2] + np.array([0.5 * depth - 0.0065, 0.0095])
    return Window(centre, width, 0.56 * width)


def _finish(canvas: Canvas, panel: Panel, column: _Column, title: str) -> None:
    panel.look(_window(canvas, column))
    panel.line(title)


def _before(canvas: Canvas, panel: Panel, column: _Column, radius: float) -> None:
    _tissue(canvas, panel, column, column.film.undeformed())
    canvas.needle(column.insertion.axis.tip_position(0.0), radius, 0.05)
    canvas.target(column.target, 2.0 * radius)
    _finish(canvas, panel, column, f"{column.title}: before insertion")


def _released(canvas: Canvas, panel: Panel, column: _Column, radius: float) -> None:
    film = column.film
    _tissue(canvas, panel, column, film.moments([film.time_at(column.depth)])[0])
    canvas.needle(column.release.release_point, radius, column.depth + 0.05)
    canvas.target(column.target, 2.0 * radius)
    canvas.seed(column.release.release_point, 1.5 * radius)
    where = ", ".join(f"{100 * x:.2f}" for x in column.release.release_point)
    depth = f"depth {100 * column.depth:.2f} cm"
    _finish(canvas, panel, column, f"seed released at ({where}) cm, {depth}")


def _retracted(canvas: Canvas, panel: Panel, column: _Column, radius: float) -> None:
    _tissue(canvas, panel, column, column.film.undeformed())
    canvas.target(column.target, 2.0 * radius)
    canvas.seed(column.release.placed_at, 1.5 * radius)
    where = ", ".join(f"{100 * x:.2f}" for x in column.release.placed_at)
    _finish(canvas, panel, column, f"needle retracted, final position of the seed ({where}) cm")


def _error(canvas: Canvas, panel: Panel, column: _Column, radius: float) -> None:
    _tissue(canvas, panel, column, column.film.undeformed())
    canvas.target(column.target, 1.0 * radius)
    ends = np.stack([column.target, column.release.placed_at])
    canvas.polyline(ends, column.look.style.target, 5.0, 9)
    canvas.seed(column.release.placed_at, 0.75 * radius)
    middle = canvas.screen(column.target)[0, :2] + np.array([4e-3, 0.0])
    panel.look(Window(middle, 0.0245, 0.0137))
    panel.line(column.error)
