"""The frame of one panel: what its camera sees, and titles, scale and colours around it.

The scene gets a rectangle of its own; texts and bars stand in the margins, so that nothing
overlaps.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from needlefem._arrays import Floats
from needlefem.plotting.backend import renderer
from needlefem.plotting.sheet import Sheet
from needlefem.plotting.style import Style

LONGEST_BAR = 0.25
"""Of the scene's width, that the scale bar may have."""
SHADES = 64


@dataclasses.dataclass(frozen=True, eq=False)
class Window:
    """A part of the plane: centre (2,), m, width and height, m, in screen coordinates."""

    centre: Floats
    width: float
    height: float

    @classmethod
    def around(cls, points: Floats, room: float = 0.04) -> "Window":
        """Return the window around screen points, shape (n, >= 2), with room on all sides."""
        low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
        size = (1.0 + 2.0 * room) * (high - low)
        return cls(0.5 * (low + high), float(size[0]), float(size[1]))


@dataclasses.dataclass(frozen=True, kw_only=True)
class Scale:
    """What colours mean.

    Parameters
    ----------
    label : str
        Quantity and unit.
    low, high : float
    over : bool
        Whether some values lie above `high`.
    """

    label: str
    low: float
    high: float
    over: bool = False


class Panel(Sheet):
    """Margins and camera of a plotter's active subplot.

    Parameters
    ----------
    plotter : pyvista.Plotter
    style : Style
    lines : int
        Lines of text above the scene.
    scale : Scale, optional
        A colour bar on the right, if given.
    legend : sequence of (colour, text)
        A legend on the right, if given.
    """

    def __init__(
        self,
        plotter: Any,
        style: Style,
        *,
        lines: int = 1,
        scale: Scale | None = None,
        legend: Sequence[tuple[str, str]] = (),
    ) -> None:
        super().__init__(plotter, style)
        self._lines = lines
        self._right = self._right_margin(scale, legend)
        self._per_pixel = 1.0
        self._margins()
        if scale is not None:
            self._colour_bar(scale)
        self._legend(legend)

    def _right_margin(self, scale: Scale | None, legend: Sequence[tuple[str, str]]) -> float:
        """Return the width that colour bar or legend need, pixels."""
        longest = max((self.width(text) for _, text in legend), default=0.0)
        wide = longest + 2.4 * self.text if legend else 0.0
        if scale is not None:
            wide = max(wide, 6.5 * self.text, self.width(scale.label) + self.text)
        return min(wide, 0.5 * self.wide)

    def _margins(self) -> None:
        """Cover what of the scene would show in the margins."""
        wide, high = self.wide, self.high
        gap = 0.3 * self.text
        strips = [
            [0.0, 0.0, wide, self._bottom],
            [0.0, high - self._top, wide, high],
            [0.0, 0.0, gap, high],
            [wide - gap, 0.0, wide, high],
        ]
        if self._right:
            strips.append([wide - self._right, 0.0, wide, high])
        colour = self.colour(self.style.background)
        self.rectangles(np.array(strips), np.tile(colour, (len(strips), 1)))

    @property
    def _top(self) -> float:
        return self.text * (0.7 + 1.45 * self._lines)

    @property
    def _bottom(self) -> float:
        return 2.6 * self.text

    def look(self, window: Window) -> None:
        """Show a part of the plane in the middle of what the margins leave."""
        free_wide = self.wide - self._right - self.text
        free_high = self.high - self._top - self._bottom
        size = max(window.width / free_wide, window.height / free_high)
        self._per_pixel = size
        off = 0.5 * np.array([self._right, self._top - self._bottom]) * size
        x, y = window.centre + off
        camera = self.plotter.camera
        camera.parallel_projection = True
        camera.focal_point, camera.position, camera.up = (x, y, 0.0), (x, y, 1.0), (0.0, 1.0, 0.0)
        camera.parallel_scale = 0.5 * self.high * size
        self.renderer.ResetCameraClippingRange()
        self._scale_bar(LONGEST_BAR * free_wide * size)

    def line(self, text: str, number: int = 0) -> None:
        """Write (or replace) a line above the scene, shrunk until it fits."""
        at = (0.7 * self.text, self.high - (0.4 + 1.45 * (number + 0.8)) * self.text)
        self.write(f"line {number}", text, at, room=self.wide - 1.4 * self.text)

    def note(self, text: str) -> None:
        """Write a line in the lower right corner, beside the scale bar."""
        room = 0.6 * self.wide
        at = (self.wide - 0.7 * self.text, 0.9 * self.text)
        self.write("note", text, at, room=room, justify="right")

    def _scale_bar(self, longest: float) -> None:
        """Draw a bar of a round length in the lower left corner."""
        length = round_length(longest)
        wide = length / self._per_pixel
        left, low = 0.8 * self.text, 1.1 * self.text
        thick = max(0.22 * self.text, 2.0)
        bar = np.array([[left, low, left + wide, low + thick]])
        self.rectangles(bar, self.colour(self.style.text)[None])
        unit, factor = ("cm", 100.0) if length >= 0.00999 else ("mm", 1000.0)
        self.write(
            "scale", f"{factor * length:g} {unit}",
            (left + wide + 0.5 * self.text, 0.7 * self.text), room=0.3 * self.wide,
        )  # fmt: skip

    def _legend(self, entries: Sequence[tuple[str, str]]) -> None:
        """List colours with what they mean, from the top of the right margin down."""
        left, top = self.wide - self._right + 0.5 * self.text, self.high - self._top
        for number, (colour, text) in enumerate(entries):
            low = top - 1.6 * (number + 1) * self.text
            square = np.array([[left, low, left + 0.8 * self.text, low + 0.8 * self.text]])
            self.rectangles(square, self.colour(colour)[None])
            at = (left + 1.3 * self.text, low - 0.1 * self.text)
            self.write(f"legend {number}", text, at, room=self._right - 1.9 * self.text)

    def _colour_bar(self, scale: Scale) -> None:
        """Draw what colours mean in the right margin: label, bar, five numbers."""
        left = self.wide - self._right + 0.8 * self.text
        low, top = self._bottom + 0.5 * self.text, self.high - self._top - 2.6 * self.text
        table = renderer().LookupTable(cmap=self.style.colour_map, n_values=SHADES)
        edges = np.linspace(low, top, SHADES + 1)
        ends = np.full(SHADES, left), edges[:-1], np.full(SHADES, left + 1.1 * self.text), edges[1:]
        self.rectangles(np.stack(ends, axis=1), np.asarray(table.values)[:, :3] / 255.0)
        at = (self.wide - 0.5 * self.text, top + 1.1 * self.text)
        self.write("quantity", scale.label, at, room=self._right, justify="right")
        for number, share in enumerate(np.linspace(0.0, 1.0, 5)):
            value = scale.low + share * (scale.high - scale.low)
            sign = "\u2265 " if scale.over and number == 4 else ""
            where = (left + 1.6 * self.text, low + share * (top - low) - 0.5 * self.text)
            self.write(f"tick {number}", f"{sign}{value:.3g}", where, room=4.4 * self.text)


def round_length(longest: float) -> float:
    """Return the longest of 1, 2, 5 times a power of ten that is not above a length, m."""
    power = 10.0 ** np.floor(np.log10(longest))
    return float(max(n * power for n in (1.0, 2.0, 5.0) if n * power <= longest * (1.0 + 1e-9)))
