"""A plotter's active panel as paper: rectangles, lines, dots and texts at its pixels."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from needlefem._arrays import Floats, Ints
from needlefem.plotting.backend import renderer
from needlefem.plotting.style import Style

GLYPH = 0.6
"""Width of a letter over the size of its text, about; texts that would not fit are shrunk."""
CORNERS = 24
"""Of a dot."""


class Sheet:
    """Drawing in pixels, from the lower left corner; what comes later lies on top.

    Parameters
    ----------
    plotter : pyvista.Plotter
        With this panel as its active subplot.
    style : Style
    """

    def __init__(self, plotter: Any, style: Style) -> None:
        self.plotter, self.style = plotter, style
        self.renderer = plotter.renderer
        self.wide, self.high = (float(n) for n in self.renderer.GetSize())
        least = float(style.smallest_text)
        self.text = max(style.text_size * min(self.high, 0.8 * self.wide), least)
        """Size of texts, pixels."""
        self._texts: dict[str, Any] = {}

    def colour(self, name: str) -> Floats:
        """Return a colour as red, green, blue, 0 to 1."""
        found: Floats = np.array(renderer().Color(name).float_rgb)
        return found

    def width(self, text: str) -> float:
        """Return about how wide a text is, pixels."""
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
        """Put (or replace) a text, no longer than `room` pixels."""
        size = min(self.text, room / (GLYPH * max(len(text), 1)))
        actor = self._texts.get(name)
        if actor is None:
            pv = renderer()
            actor = pv.Text(text)
            actor.prop.color = self.style.text
            actor.prop.justification_horizontal = justify
            actor.prop.justification_vertical = "bottom"
            actor.prop.orientation = 90.0 if upward else 0.0
            actor.SetLayerNumber(1)
            self._texts[name] = actor
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
        """Draw discs, `size` pixels wide, at places, shape (n, 2), in a thin pale rim."""
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
