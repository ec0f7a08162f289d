"""Fig. 3: the organ turns when the needle pushes against its lower half."""

from pathlib import Path

import numpy as np

from needlefem._arrays import Floats, Points, Vector
from needlefem.insertion.result import Insertion
from needlefem.plotting.backend import renderer
from needlefem.plotting.canvas import Canvas
from needlefem.plotting.images import save
from needlefem.plotting.panel import Panel, Window
from needlefem.plotting.style import Style
from needlefem.plotting.timeline import Timeline
from needlefem.plotting.view import TissueView, ViewOptions

SIZE = (1280, 900)
DASHES = 36


def turned(before: Points, after: Points) -> float:
    """Return the rotation that best moves points (n, 2) onto others, rad, counter-clockwise.

    The least squares of G. Wahba (1965), in the plane.
    """
    a, b = before - before.mean(axis=0), after - after.mean(axis=0)
    cross = float(np.sum(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]))
    return float(np.arctan2(cross, float(np.sum(a * b))))


def draw_turning(insertion: Insertion, depth: float, path: Path) -> float:
    """Draw the first region before and during an insertion; return its turn as seen, rad."""
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
                (style.path, "turn")),
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
        f"turned {abs(np.degrees(angle)):.1f}\u00b0 {way} at a depth of {100 * depth:.2f} cm"
    )
    save(plotter, path)
    return angle


def _hand(canvas: Canvas, middle: Vector, outline: Points, angle: float) -> Points:
    """Return the ends of an upright diameter that is turned by an angle on the screen."""
    size = 0.5 * float(np.ptp(canvas.screen(outline)[:, 1]))
    arm: Floats = -canvas.axis.direction * -np.sin(angle) + canvas.axis.lateral_directions[
        0
    ] * np.cos(angle)
    return np.stack([middle - size * arm, middle + size * arm])


def _dashed(canvas: Canvas, ring: Points, colour: str) -> None:
    closed = np.vstack([ring, ring[:1]])
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    ends = np.linspace(0.0, length[-1], 2 * DASHES + 1)
    at = np.stack([np.interp(ends, length, closed[:, k]) for k in range(closed.shape[1])], axis=1)
    for number in range(DASHES):
        canvas.polyline(at[2 * number : 2 * number + 2], colour, 2.5, 2.5)
