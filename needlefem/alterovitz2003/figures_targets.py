"""Fig. 4 and 7: a target that moves with the tissue; many targets without and with plans."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from needlefem._arrays import Vector
from needlefem.insertion.result import Insertion
from needlefem.planning.result import Release
from needlefem.plotting.backend import renderer
from needlefem.plotting.canvas import Canvas
from needlefem.plotting.images import save
from needlefem.plotting.panel import Panel, Window
from needlefem.plotting.style import Style
from needlefem.plotting.timeline import Timeline
from needlefem.plotting.view import TissueView, ViewOptions
from needlefem.scene import Scene
from needlefem.studies.targets import TargetTable

AROUND = 0.024
"""Width of what Fig. 4 shows around the target, m."""


def draw_moved_target(insertion: Insertion, target: Vector, depth: float, path: Path) -> float:
    """Draw a target in the reference (cross) and in the world (dot), before and at a depth.

    Returns how far apart they are there, m.
    """
    film, style = Timeline(insertion), Style()
    plotter = renderer().Plotter(
        off_screen=True, shape=(1, 2), window_size=[1600, 800], border=False
    )
    plotter.set_background(style.background)
    moments = film.undeformed(), film.moments([film.time_at(depth)])[0]
    moved = film.model.displacement_at(moments[1].u, target[None])[0]
    size = float(np.linalg.norm(moved))
    texts = ("before: both coincide", f"depth {100 * depth:.2f} cm: {1000 * size:.2f} mm apart")
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
        panel.note("cross: in the reference, dot: in the world")
    save(plotter, path)
    return size


def draw_targets_hit(scene: Scene, table: TargetTable, path: Path) -> Path:
    """Draw targets and where seeds come to rest, without (left) and with plans (right)."""
    plans = table.plans
    columns = (
        ("without planning: mean error", [plan.unplanned for plan in plans], table.unplanned_mean),
        (
            "with planning: left by the searches, mean",
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
