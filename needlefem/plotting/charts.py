"""Charts in a panel of a plotter: curves, dots and blocks over axes with units."""

import dataclasses
from collections.abc import Sequence
from typing import Protocol

import numpy as np

from needlefem._arrays import Floats, Ints
from needlefem.plotting.images import Plotter, Style, renderer

GLYPH = 0.6
"""Approximate width of a letter relative to the text size; long texts are drawn smaller."""
CORNERS = 24
"""Corners of the polygon that represents a dot."""


class _TextStyle(Protocol):
    """A `pyvista.TextProperty`."""

    color: str
    justification_horizontal: str
    justification_vertical: str
    orientation: float
    font_size: int


class _TextActor(Protocol):
    """A `pyvista.Text`."""

    prop: _TextStyle
    input: str
    position: tuple[float, float]

    def SetLayerNumber(self, number: int) -> None: ...  # noqa: N802  (VTK's name)


class Sheet:
    """Drawing in pixel coordinates from the lower left corner; later objects cover earlier ones.

    Parameters
    ----------
    plotter : pyvista.Plotter
        A plotter whose active subplot is this panel.
    style : Style
    """

    def __init__(self, plotter: Plotter, style: Style) -> None:
        self.plotter, self.style = plotter, style
        self.renderer = plotter.renderer
        self.wide, self.high = (float(n) for n in self.renderer.GetSize())
        least = float(style.smallest_text)
        self.text = max(style.text_size * min(self.high, 0.8 * self.wide), least)
        """Size of texts, pixels."""
        self._texts: dict[str, _TextActor] = {}

    def colour(self, name: str) -> Floats:
        """Return a colour as red, green, blue, 0 to 1."""
        found: Floats = np.array(renderer().Color(name).float_rgb)
        return found

    def width(self, text: str) -> float:
        """Return the approximate width of a text, pixels."""
        return GLYPH * self.text * len(text)

    def write(
        self,
        name: str,
        text: str,
        at: Sequence[float],
        room: float,
        *,
        justify: str = "left",
        upward: bool = False,
    ) -> None:
        """Draw a text, or replace it; it is drawn smaller if it is longer than `room` pixels."""
        size = min(self.text, room / (GLYPH * max(len(text), 1)))
        actor = self._texts.get(name)
        if actor is None:
            actor = self._texts[name] = renderer().Text(text)
            actor.prop.color = self.style.text
            actor.prop.justification_horizontal = justify
            actor.prop.justification_vertical = "bottom"
            actor.prop.orientation = 90.0 if upward else 0.0
            actor.SetLayerNumber(1)
            self.renderer.add_actor(actor, reset_camera=False, render=False)
        actor.input = text
        actor.prop.font_size = max(round(size), 1)
        actor.position = (float(at[0]), float(at[1]))

    def rectangles(self, corners: Floats, colours: Floats) -> None:
        """Draw rectangles, shape (n, 4): left, bottom, right, top; colours (n, 3), 0 to 1."""
        x0, y0, x1, y1 = corners.T
        ring = np.stack([x0, y0, x1, y0, x1, y1, x0, y1], axis=1).reshape(-1, 2)
        self._draw(ring, np.arange(len(ring)).reshape(-1, 4), colours)

    def dots(self, places: Floats, size: float, colour: str) -> None:
        """Draw discs with a thin pale rim at places, shape (n, 2); `size`: diameter, pixels."""
        turn = 2.0 * np.pi * np.arange(CORNERS) / CORNERS
        circle = 0.5 * np.stack([np.cos(turn), np.sin(turn)], axis=1)
        for width, paint in ((size + 3.0, self.style.background), (size, colour)):
            rings = places[:, None] + width * circle
            numbers = np.arange(rings.shape[0] * CORNERS).reshape(-1, CORNERS)
            self._draw(rings.reshape(-1, 2), numbers, np.tile(self.colour(paint), (len(rings), 1)))

    def stroke(self, points: Floats, width: float, colour: str) -> None:
        """Draw a line through points, shape (n, 2), `width` pixels wide, with round joints."""
        along = np.diff(points, axis=0)
        along = along[np.any(along != 0.0, axis=1)]
        if not len(along):
            return
        starts = points[:-1][np.any(np.diff(points, axis=0) != 0.0, axis=1)]
        side = along[:, ::-1] * [-0.5, 0.5] * width / np.linalg.norm(along, axis=1)[:, None]
        bands = np.stack([starts - side, starts + along - side, starts + along + side,
                          starts + side], axis=1)  # fmt: skip
        paint = np.tile(self.colour(colour), (len(bands), 1))
        self._draw(bands.reshape(-1, 2), np.arange(4 * len(bands)).reshape(-1, 4), paint)
        turn = 2.0 * np.pi * np.arange(CORNERS) / CORNERS
        rings = points[:, None] + 0.5 * width * np.stack([np.cos(turn), np.sin(turn)], axis=1)
        paint = np.tile(self.colour(colour), (len(rings), 1))
        numbers = np.arange(len(rings) * CORNERS).reshape(-1, CORNERS)
        self._draw(rings.reshape(-1, 2), numbers, paint)

    def _draw(self, points: Floats, polygons: Ints, colours: Floats) -> None:
        """Draw convex polygons with corners of shape (n, k) among points, shape (npoints, 2)."""
        from vtkmodules.vtkRenderingCore import (  # noqa: PLC0415
            vtkActor2D,
            vtkPolyDataMapper2D,
        )

        faces = np.column_stack([np.full(len(polygons), polygons.shape[1]), polygons]).ravel()
        data = renderer().PolyData(np.column_stack([points, np.zeros(len(points))]), faces=faces)
        data.cell_data["colours"] = np.round(255.0 * colours).astype(np.uint8)
        data.set_active_scalars("colours", preference="cell")
        mapper, actor = vtkPolyDataMapper2D(), vtkActor2D()
        mapper.SetInputData(data)
        actor.SetMapper(mapper)
        self.renderer.AddViewProp(actor)


# Charts: curves, dots and blocks over two axes with quantity and unit.


MOST_TICKS = 8
"""Largest number of intervals between the ticks of an axis."""
TICK = 0.35
"""Length of a tick relative to the text size."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Axis:
    """One axis of a chart: quantity, unit and range.

    Parameters
    ----------
    label : str
        Quantity and unit.
    low, high : float
    """

    label: str
    low: float
    high: float

    @classmethod
    def over(cls, label: str, values: Floats, room: float = 0.04) -> "Axis":
        """Return an axis over all finite values with a margin of a share of their range."""
        finite = values[np.isfinite(values)]
        low, high = float(finite.min()), float(finite.max())
        more = room * (high - low) or 0.5 * abs(high) or 1.0
        return cls(label=label, low=low - more, high=high + more)

    @property
    def ticks(self) -> tuple[Floats, list[str]]:
        """Return round numbers on the axis, shape (n,), and their texts."""
        power = 10.0 ** np.floor(np.log10((self.high - self.low) / MOST_TICKS))
        steps = (float(n * power) for n in (1.0, 2.0, 5.0, 10.0))
        step = next(s for s in steps if (self.high - self.low) / s <= MOST_TICKS)
        slack = 1e-9 * step
        first, last = np.ceil((self.low - slack) / step), np.floor((self.high + slack) / step)
        values = step * np.arange(first, last + 1.0)
        digits = max(0, -int(np.floor(np.log10(step) + 1e-9)))
        return values, [f"{value + 0.0:.{digits}f}" for value in values]

    def share(self, values: Floats) -> Floats:
        """Return the positions of values between the ends of the axis, 0 to 1."""
        found: Floats = (np.asarray(values, dtype=float) - self.low) / (self.high - self.low)
        return found


class Chart(Sheet):
    """A chart that fills a plotter's active panel.

    Parameters
    ----------
    plotter : pyvista.Plotter
    style : Style
    title : str
    x, y : Axis
    legend : sequence of (colour, text)
        Entries above the chart.
    """

    def __init__(
        self,
        plotter: Plotter,
        style: Style,
        *,
        title: str = "",
        x: Axis,
        y: Axis,
        legend: Sequence[tuple[str, str]] = (),
    ) -> None:
        super().__init__(plotter, style)
        self.x, self.y = x, y
        size, (_, numbers) = self.text, y.ticks
        self._left = 2.6 * size + max(self.width(number) for number in numbers)
        self._low, self._right = 3.6 * size, self.wide - 1.5 * size
        if title:
            self.write("title", title, (self._left, self.high - 1.5 * size), self._across)
        top = self.high - (2.0 * size if title else 0.4 * size)
        self._top = self._legend(legend, top) - 0.8 * size
        self._grid()

    @property
    def _across(self) -> float:
        return self._right - self._left

    def _legend(self, entries: Sequence[tuple[str, str]], top: float) -> float:
        """Draw the legend in rows below a height; return the height of its lower edge."""
        size, left = self.text, self._left
        for number, (colour, text) in enumerate(entries):
            wide = 1.2 * size + self.width(text)
            if number and left + wide > self._right:
                left, top = self._left, top - 1.4 * size
            low = top - size
            square = np.array([[left, low, left + 0.8 * size, low + 0.8 * size]])
            self.rectangles(square, self.colour(colour)[None])
            room = self._right - left - 1.2 * size
            self.write(f"legend {number}", text, (left + 1.2 * size, low - 0.1 * size), room)
            left += wide + 0.8 * size
        return top - (1.4 * size if entries else 0.0)

    def at(self, x: Floats, y: Floats) -> Floats:
        """Return the pixel coordinates of values, shape (n, 2)."""
        across = self._left + self._across * self.x.share(x)
        return np.column_stack([across, self._low + (self._top - self._low) * self.y.share(y)])

    def _grid(self) -> None:
        """Draw axes, ticks with numbers, a pale grid, and the labels."""
        size, tick = self.text, TICK * self.text
        values, numbers = self.x.ticks
        across = self.at(values, np.full(len(values), self.y.low))[:, 0]
        levels, marks = self.y.ticks
        up = self.at(np.full(len(levels), self.x.low), levels)[:, 1]
        for at in across:
            self.stroke(np.array([[at, self._low], [at, self._top]]), 1.0, self.style.grid)
            self.stroke(np.array([[at, self._low - tick], [at, self._low]]), 2.0, self.style.text)
        for at in up:
            self.stroke(np.array([[self._left, at], [self._right, at]]), 1.0, self.style.grid)
            self.stroke(np.array([[self._left - tick, at], [self._left, at]]), 2.0, self.style.text)
        corner = [self._left, self._low]
        ends = np.array([[self._left, self._top], corner, [self._right, self._low]])
        self.stroke(ends, 2.0, self.style.text)
        for number, at in zip(numbers, across, strict=True):
            place, room = (at, self._low - tick - 1.2 * size), self._across / len(across)
            self.write(f"x {number}", number, place, room, justify="center")
        for mark, at in zip(marks, up, strict=True):
            place = (self._left - tick - 0.3 * size, at - 0.5 * size)
            self.write(f"y {mark}", mark, place, self._left, justify="right")
        middle = 0.5 * (self._left + self._right), 0.4 * size
        self.write("x label", self.x.label, middle, self._across, justify="center")
        upright = 1.4 * size, 0.5 * (self._low + self._top)
        high = self._top - self._low
        self.write("y label", self.y.label, upright, high, justify="center", upward=True)

    def curve(self, x: Floats, y: Floats, colour: str, width: float = 4.0) -> None:
        """Draw a curve through values, shape (n,), with gaps at values that are not finite."""
        points = self.at(x, y)
        broken = np.flatnonzero(~np.all(np.isfinite(points), axis=1))
        for part in np.split(points, broken):
            whole = part[np.all(np.isfinite(part), axis=1)]
            if len(whole) > 1:
                self.stroke(whole, width, colour)

    def marks(self, x: Floats, y: Floats, colour: str, size: float = 14.0) -> None:
        """Draw dots at values, shape (n,); `size` is their diameter, pixels."""
        self.dots(self.at(x, y), size, colour)

    def blocks(self, corners: Floats, colours: Floats) -> None:
        """Fill rectangles, shape (n, 4): from and to in x, from and to in y; colours (n, 3)."""
        low, high = self.at(corners[:, 0], corners[:, 2]), self.at(corners[:, 1], corners[:, 3])
        self.rectangles(np.hstack([low, high]), colours)
