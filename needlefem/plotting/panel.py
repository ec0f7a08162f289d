"""One panel of a picture: image on the tissue, camera, titles, scale bar, colour bar, legend.

An image (an ultrasound slice, or a synthetic one) is mapped on the tissue and deforms with it. It
covers the bounding box of the undeformed tissue on the screen.
"""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter

from needlefem._arrays import Floats, Ints, Points
from needlefem._inputfile import require_file
from needlefem.errors import CaseError
from needlefem.fem.tissue_model import TissueModel
from needlefem.needle.needle_interface import InsertionAxis
from needlefem.plotting.canvas import Canvas, screen_frame
from needlefem.plotting.images import GLYPH, Plotter, Sheet, Style, renderer
from needlefem.scene import Scene

PIXEL = 0.15e-3
"""Size of a pixel of a synthetic image, m."""
SPECKLE = (0.22e-3, 0.4e-3)
"""Size of a speckle along the beam and across it (standard deviations), m."""
RANGE = 45.0
"""Dynamic range of the echoes, dB."""
CHUNK = 20_000
"""Number of pixels whose distances to a contour are computed together."""
RIM = 0.5e-3
"""Thickness of the bright rim of a region, m."""
ECHO = (0.0, -8.0, -4.0, -11.0)
"""Mean echo of the background and of the regions in the order of their names, dB."""


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Texture:
    """A grey image on the tissue.

    Parameters
    ----------
    grey : array, shape (rows, columns)
        0 to 255, with the first row at the top.
    note : str
        Note in the picture, which must state that an image is not measured.
    """

    grey: Ints
    note: str = ""

    def image(self) -> object:
        """Return the image as a PyVista texture."""
        rgb = np.repeat(self.grey.astype(np.uint8)[:, :, None], 3, axis=2)
        found = renderer().Texture(rgb)
        found.interpolate = True
        return found

    @staticmethod
    def coordinates(canvas: Canvas, points: Points) -> Floats:
        """Return the positions of tissue points in the image, shape (n, 2), 0 to 1."""
        at = canvas.screen(points)[:, :2]
        found: Floats = (at - at.min(axis=0)) / np.ptp(at, axis=0)
        return found


def read_texture(path: str | Path) -> Texture:
    """Read an image of the undeformed tissue from a file in a format of Pillow.

    Raises
    ------
    CaseError
        The file can't be read.
    """
    require_file(path, "texture", remedy="give a PNG, JPEG or TIFF file")
    from PIL import Image, UnidentifiedImageError  # noqa: PLC0415  (comes with the pictures)

    try:
        with Image.open(path) as image:
            return Texture(grey=np.asarray(image.convert("L"), dtype=np.intp))
    except (OSError, UnidentifiedImageError) as error:
        remedy = "give a PNG, JPEG or TIFF file"
        raise CaseError("texture", f"'{path}' can't be read ({error})", remedy) from None


def synthetic_ultrasound(
    scene: Scene, model: TissueModel, axis: InsertionAxis, seed: int = 2003
) -> Texture:
    """Return a synthetic ultrasound image of plane tissue: speckle, dark regions, bright rims.

    Speckle is the magnitude of a sum of many random echoes under the point spread function of the
    beam (complex Gaussian noise, smoothed; J. W. Goodman 1976), shown in dB.
    """
    corners = screen_frame(axis).T
    at = model.mesh.p.T @ corners
    low, high = at.min(axis=0), at.max(axis=0)
    columns, rows = (max(int(n), 8) for n in np.ceil((high - low) / PIXEL))
    x, y = np.meshgrid(np.linspace(low[0], high[0], columns), np.linspace(high[1], low[1], rows))
    points = np.column_stack([x.ravel(), y.ravel()]) @ corners.T
    random = np.random.default_rng(seed)
    sizes = [size / PIXEL for size in SPECKLE]
    echoes = [gaussian_filter(random.standard_normal((rows, columns)), sizes) for _ in range(2)]
    size = np.hypot(*echoes)
    decibels = 20.0 * np.log10(size / size.mean() + 1e-6) + _mean_echo(scene, points).reshape(
        x.shape
    )
    grey = np.clip((decibels + 0.72 * RANGE) / RANGE, 0.0, 1.0)
    return Texture(grey=np.round(255.0 * grey).astype(np.intp), note="ultrasound image: synthetic")


def _mean_echo(scene: Scene, points: Floats) -> Floats:
    """Return the mean echo at points in space, dB."""
    found = np.full(len(points), ECHO[0])
    for number, region in enumerate(scene.regions.values(), start=1):
        found[region.contour.contains(points)] = ECHO[1 + (number - 1) % (len(ECHO) - 1)]
    for region in scene.regions.values():
        parts = np.array_split(points, 1 + len(points) // CHUNK)
        near = np.concatenate([region.contour.distance(part) for part in parts])
        found += 9.0 * np.exp(-((near / RIM) ** 2))
    return found


# The layout of one panel. The scene has a rectangle of its own; texts and bars are in the margins,
# so that they do not cover the scene.


LONGEST_BAR = 0.25
"""Largest length of the scale bar relative to the width of the scene."""
SHADES = 64
SMALL = 200
"""Height of a panel, pixels, below which it has a scale bar instead of axes."""


@dataclasses.dataclass(frozen=True, eq=False)
class Window:
    """A part of the plane: centre (2,), width and height in screen coordinates, m."""

    centre: Floats
    width: float
    height: float

    @classmethod
    def around(cls, points: Floats, room: float = 0.04) -> "Window":
        """Return the window around screen points, shape (n, >= 2), with a margin on all sides."""
        low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
        size = (1.0 + 2.0 * room) * (high - low)
        return cls(0.5 * (low + high), float(size[0]), float(size[1]))


@dataclasses.dataclass(frozen=True, kw_only=True)
class Scale:
    """The scale of a colour bar.

    Parameters
    ----------
    label : str
        Quantity and unit.
    low, high : float
    over : bool
        Whether some values are larger than `high`.
    """

    label: str
    low: float
    high: float
    over: bool = False


@dataclasses.dataclass(frozen=True, kw_only=True)
class Ruler:
    """A coordinate axis along a side of the scene.

    Parameters
    ----------
    label : str
        Coordinate and unit.
    sign : float
        Whether the coordinate increases (1) or decreases (-1) to the right or upwards.
    """

    label: str
    sign: float


def rulers(canvas: Canvas, names: Sequence[str]) -> tuple[Ruler, Ruler] | None:
    """Return the axes below and beside a scene, or None if a side is no coordinate axis."""
    sides = []
    for way in canvas.frame:
        number = int(np.argmax(np.abs(way)))
        if abs(way[number]) < 1.0 - 1e-9:
            return None
        sides.append(Ruler(label=f"{names[number]} (cm)", sign=float(np.sign(way[number]))))
    along = ", ".join(f"{x + 0.0:.2g}" for x in canvas.axis.direction)
    across = f"{sides[0].label}; depth along ({', '.join(names)}) = ({along})"
    return dataclasses.replace(sides[0], label=across), sides[1]


def round_numbers(low: float, high: float, most: int) -> Floats:
    """Return round numbers in a range, at most `most` intervals apart, shape (n,)."""
    from matplotlib.ticker import MaxNLocator  # noqa: PLC0415  (only a picture needs it)

    found = np.asarray(MaxNLocator(most, steps=[1, 2, 5, 10]).tick_values(low, high))
    slack = 1e-9 * (high - low)
    inside: Floats = found[(found >= low - slack) & (found <= high + slack)]
    return inside


class Panel(Sheet):
    """Margins and camera of a plotter's active subplot.

    Parameters
    ----------
    plotter : pyvista.Plotter
    style : Style
    lines : int
        Number of text lines above the scene.
    scale : Scale, optional
        Scale of a colour bar at the right.
    legend : sequence of (colour, text)
        Legend at the right.
    row : sequence of (colour, text)
        Legend in a row above the scene.
    ruled : (Ruler, Ruler), optional
        Axes below and beside the scene, instead of a scale bar; small panels have neither axes
        nor a legend in a row.
    note : str
        Note below the scene.
    """

    def __init__(
        self,
        plotter: Plotter,
        style: Style,
        *,
        lines: int = 1,
        scale: Scale | None = None,
        legend: Sequence[tuple[str, str]] = (),
        row: Sequence[tuple[str, str]] = (),
        ruled: tuple[Ruler, Ruler] | None = None,
        note: str = "",
    ) -> None:
        super().__init__(plotter, style)
        if self.high < SMALL:
            row, ruled = (), None
        self._below = 1.4 * self.text if ruled and note else 0.0
        self._ruled, self._top = ruled, self.text * (0.7 + 1.45 * (lines + bool(row)))
        self._left, self._bottom = self.text * np.array((4.6, 3.5) if ruled else (0.0, 2.6))
        self._bottom += self._below
        self._right = self._right_margin(scale, legend)
        self._per_pixel = 1.0
        self._margins()
        if scale is not None:
            self._colour_bar(scale)
        self._legend(legend)
        self._row(row, lines)
        if note:
            self.note(note)

    def _right_margin(self, scale: Scale | None, legend: Sequence[tuple[str, str]]) -> float:
        """Return the width of the colour bar or the legend, pixels."""
        longest = max((self.width(text) for _, text in legend), default=0.0)
        wide = longest + 2.4 * self.text if legend else 0.0
        if scale is not None:
            wide = max(wide, 6.5 * self.text, self.width(scale.label) + self.text)
        return min(wide, 0.5 * self.wide)

    def _margins(self) -> None:
        """Cover the parts of the scene that would be visible in the margins."""
        wide, high = self.wide, self.high
        gap = 0.3 * self.text
        strips = [
            [0.0, 0.0, wide, self._bottom],
            [0.0, high - self._top, wide, high],
            [0.0, 0.0, max(self._left, gap), high],
            [wide - gap, 0.0, wide, high],
        ]
        if self._right:
            strips.append([wide - self._right, 0.0, wide, high])
        colour = self.colour(self.style.background)
        self.rectangles(np.array(strips), np.tile(colour, (len(strips), 1)))

    def look(self, window: Window) -> None:
        """Show a window of the plane between the margins."""
        free_wide = self.wide - self._left - self._right - self.text
        free_high = self.high - self._top - self._bottom
        size = max(window.width / free_wide, window.height / free_high)
        self._per_pixel = size
        off = 0.5 * np.array([self._right - self._left, self._top - self._bottom]) * size
        x, y = window.centre + off
        camera = self.plotter.camera
        camera.parallel_projection = True
        camera.focal_point, camera.position, camera.up = (x, y, 0.0), (x, y, 1.0), (0.0, 1.0, 0.0)
        camera.parallel_scale = 0.5 * self.high * size
        self.renderer.ResetCameraClippingRange()
        if self._ruled is None:
            self._scale_bar(LONGEST_BAR * free_wide * size)
        else:
            self._rule(self._ruled, np.array([x, y]))

    def _rule(self, ruled: tuple[Ruler, Ruler], centre: Floats) -> None:
        """Draw axes with ticks at round values below and beside the scene; `centre`: (2,), m."""
        begin = np.array([self._left, self._bottom])
        end = np.array([self.wide - self._right - 0.5 * self.text, self.high - self._top])
        tick, thick = 0.35 * self.text, max(0.07 * self.text, 1.0)
        bars = [[*begin, end[0], begin[1] + thick], [*begin, begin[0] + thick, end[1]]]
        size, middle = 100.0 * self._per_pixel, 0.5 * np.array([self.wide, self.high])
        for side, ruler in enumerate(ruled):
            ends = 100.0 * centre[side] + size * (np.array([begin, end])[:, side] - middle[side])
            low, high = np.sort(ruler.sign * ends)
            most = max(int((end - begin)[side] / ((4.5, 3.0)[side] * self.text)), 2)
            for number, value in enumerate(round_numbers(low, high, most)):
                at = middle[side] + (ruler.sign * value - 100.0 * centre[side]) / size
                if side == 0:
                    bars.append([at, begin[1] - tick, at + thick, begin[1]])
                    place, justify = (at, begin[1] - tick - 1.1 * self.text), "center"
                else:
                    bars.append([begin[0] - tick, at, begin[0], at + thick])
                    place, justify = (begin[0] - 1.6 * tick, at - 0.5 * self.text), "right"
                self.write(
                    f"{side} {number}", f"{value + 0.0:g}", place, self._left, justify=justify
                )
        self.rectangles(np.array(bars), np.tile(self.colour(self.style.text), (len(bars), 1)))
        room = 0.9 * (self.wide - self._left)
        self.write("x", ruled[0].label, (begin[0], 0.4 * self.text + self._below), room=room)
        height = float(0.5 * (begin[1] + end[1]))
        self.write(
            "y", ruled[1].label, (1.4 * self.text, height), room, justify="center", upward=True
        )

    def line(self, text: str, number: int = 0) -> None:
        """Write or replace a line above the scene; its text is drawn smaller until it fits."""
        at = (0.7 * self.text, self.high - (0.4 + 1.45 * (number + 0.8)) * self.text)
        self.write(f"line {number}", text, at, room=self.wide - 1.4 * self.text)

    def note(self, text: str) -> None:
        """Write a line in the lower right corner, below the axes or beside the scale bar."""
        room = (0.9 if self._below else 0.6) * self.wide
        at = (self.wide - 0.7 * self.text, (0.4 if self._below else 0.9) * self.text)
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
        """Draw the legend from the top of the right margin downwards."""
        left, top = self.wide - self._right + 0.5 * self.text, self.high - self._top
        for number, (colour, text) in enumerate(entries):
            low = top - 1.6 * (number + 1) * self.text
            square = np.array([[left, low, left + 0.8 * self.text, low + 0.8 * self.text]])
            self.rectangles(square, self.colour(colour)[None])
            at = (left + 1.3 * self.text, low - 0.1 * self.text)
            self.write(f"legend {number}", text, at, room=self._right - 1.9 * self.text)

    def _row(self, entries: Sequence[tuple[str, str]], line: int) -> None:
        """Draw a legend in a row at a line above the scene, smaller if it would be too long."""
        full = sum(self.width(text) + 2.6 * self.text for _, text in entries)
        size = self.text * min(1.0, (self.wide - 1.4 * self.text) / max(full, 1.0))
        left, low = 0.7 * self.text, self.high - (0.4 + 1.45 * (line + 0.8)) * self.text
        for number, (colour, text) in enumerate(entries):
            square = np.array([[left, low, left + 0.8 * size, low + 0.8 * size]])
            self.rectangles(square, self.colour(colour)[None])
            room = GLYPH * size * len(text)
            self.write(f"row {number}", text, (left + 1.2 * size, low - 0.1 * size), room=room)
            left += room + 2.6 * size

    def _colour_bar(self, scale: Scale) -> None:
        """Draw the colour bar in the right margin: label, bar, limits and round values."""
        left = self.wide - self._right + 0.8 * self.text
        low, top = self._bottom + 0.5 * self.text, self.high - self._top - 2.6 * self.text
        table = renderer().LookupTable(cmap=self.style.colour_map, n_values=SHADES)
        edges = np.linspace(low, top, SHADES + 1)
        ends = np.full(SHADES, left), edges[:-1], np.full(SHADES, left + 1.1 * self.text), edges[1:]
        self.rectangles(np.stack(ends, axis=1), np.asarray(table.values)[:, :3] / 255.0)
        at = (self.wide - 0.5 * self.text, top + 1.1 * self.text)
        self.write("quantity", scale.label, at, room=self._right, justify="right")
        apart, marks = (
            1.4 * self.text * (scale.high - scale.low) / (top - low),
            [scale.low, scale.high],
        )
        between = round_numbers(scale.low, scale.high, 6)
        marks += [v for v in between.tolist() if min(v - scale.low, scale.high - v) > apart]
        for number, value in enumerate(marks):
            height = low + (value - scale.low) / (scale.high - scale.low) * (top - low)
            sign = "\u2265 " if scale.over and number == 1 else ""
            where = (left + 1.6 * self.text, height - 0.5 * self.text)
            self.write(f"tick {number}", f"{sign}{value:.3g}", where, room=4.4 * self.text)
        heights = low + (np.array(marks) - scale.low) / (scale.high - scale.low) * (top - low)
        ticks = np.array(
            [[left + 1.1 * self.text, y - 0.5, left + 1.4 * self.text, y + 0.5] for y in heights]
        )
        self.rectangles(ticks, np.tile(self.colour(self.style.text), (len(ticks), 1)))


def round_length(longest: float) -> float:
    """Return the largest of 1, 2, 5 times a power of ten that is not larger than a length, m."""
    power = 10.0 ** np.floor(np.log10(longest))
    return float(max(n * power for n in (1.0, 2.0, 5.0) if n * power <= longest * (1.0 + 1e-9)))
