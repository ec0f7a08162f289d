"""Charts: lines, dots and blocks over two axes that say their units."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from needlefem._arrays import Floats
from needlefem.plotting.sheet import Sheet
from needlefem.plotting.style import Style

MOST_TICKS = 8
"""Intervals between ticks of an axis, at most."""
TICK = 0.35
"""Length of a tick over the size of texts."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Axis:
    """One axis of a chart: what it measures, in its unit, and from where to where.

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
        """Return the axis over all finite values, with some of their range on both sides."""
        finite = values[np.isfinite(values)]
        low, high = float(finite.min()), float(finite.max())
        more = room * (high - low) or 0.5 * abs(high) or 1.0
        return cls(label=label, low=low - more, high=high + more)

    @property
    def ticks(self) -> tuple[Floats, list[str]]:
        """Round numbers on the axis, shape (n,), and how they are written."""
        power = 10.0 ** np.floor(np.log10((self.high - self.low) / MOST_TICKS))
        steps = (float(n * power) for n in (1.0, 2.0, 5.0, 10.0))
        step = next(s for s in steps if (self.high - self.low) / s <= MOST_TICKS)
        slack = 1e-9 * step
        first, last = np.ceil((self.low - slack) / step), np.floor((self.high + slack) / step)
        values = step * np.arange(first, last + 1.0)
        digits = max(0, -int(np.floor(np.log10(step) + 1e-9)))
        return values, [f"{value + 0.0:.{digits}f}" for value in values]

    def share(self, values: Floats) -> Floats:
        """Return where values lie between the axis' ends, 0 to 1."""
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
        Stands above the chart, so that it covers nothing.
    """

    def __init__(
        self,
        plotter: Any,
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
        """Write the legend in rows below a height; return the height of its lower edge."""
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
        """Return the pixels of values, shape (n, 2)."""
        across = self._left + self._across * self.x.share(x)
        return np.column_stack([across, self._low + (self._top - self._low) * self.y.share(y)])

    def _grid(self) -> None:
        """Draw axes, ticks with their numbers, a pale grid, and what the axes measure."""
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
        """Draw a line through values, shape (n,); it is broken where one is not finite."""
        points = self.at(x, y)
        broken = np.flatnonzero(~np.all(np.isfinite(points), axis=1))
        for part in np.split(points, broken):
            whole = part[np.all(np.isfinite(part), axis=1)]
            if len(whole) > 1:
                self.stroke(whole, width, colour)

    def marks(self, x: Floats, y: Floats, colour: str, size: float = 14.0) -> None:
        """Draw dots, `size` pixels wide, at values, shape (n,)."""
        self.dots(self.at(x, y), size, colour)

    def blocks(self, corners: Floats, colours: Floats) -> None:
        """Fill rectangles, shape (n, 4): from and to in x, from and to in y; colours (n, 3)."""
        low, high = self.at(corners[:, 0], corners[:, 2]), self.at(corners[:, 1], corners[:, 3])
        self.rectangles(np.hstack([low, high]), colours)
