"""One panel of a picture: image on the tissue, camera, titles, scale bar, colour bar, legend.

An image (an ultrasound slice, or a synthetic one) is mapped on the tissue and deforms with it. It
covers the bounding box of the undeformed tissue on the screen: the needle enters at its right side,
up is lateral.
"""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

import numpy as np
from scipy.ndimage import gaussian_filter

from needlefem._arrays import Floats, Ints, Points
from needlefem._inputfile import require_file
from needlefem.errors import CaseError
from needlefem.fem.tissue_model import TissueModel
from needlefem.needle.needle_interface import InsertionAxis
from needlefem.plotting.canvas import Canvas
from needlefem.plotting.images import Plotter, Style, renderer
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
    corners = np.stack([-axis.direction, axis.lateral_directions[0]], axis=1)
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


GLYPH = 0.6
"""Approximate width of a letter relative to the text size; long texts are drawn smaller."""
LONGEST_BAR = 0.25
"""Largest length of the scale bar relative to the width of the scene."""
SHADES = 64


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
    """

    def __init__(
        self,
        plotter: Plotter,
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
        """Show a window of the plane between the margins."""
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
        """Write or replace a line above the scene; its text is drawn smaller until it fits."""
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
        """Draw the legend from the top of the right margin downwards."""
        left, top = self.wide - self._right + 0.5 * self.text, self.high - self._top
        for number, (colour, text) in enumerate(entries):
            low = top - 1.6 * (number + 1) * self.text
            square = np.array([[left, low, left + 0.8 * self.text, low + 0.8 * self.text]])
            self.rectangles(square, self.colour(colour)[None])
            at = (left + 1.3 * self.text, low - 0.1 * self.text)
            self.write(f"legend {number}", text, at, room=self._right - 1.9 * self.text)

    def _colour_bar(self, scale: Scale) -> None:
        """Draw the colour bar in the right margin: label, bar, five numbers."""
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
    """Return the largest of 1, 2, 5 times a power of ten that is not larger than a length, m."""
    power = 10.0 ** np.floor(np.log10(longest))
    return float(max(n * power for n in (1.0, 2.0, 5.0) if n * power <= longest * (1.0 + 1e-9)))
