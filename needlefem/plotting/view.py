"""An insertion in one panel: drawn once, then moved from moment to moment."""

import dataclasses
from typing import Any

import numpy as np

from needlefem._arrays import Floats, Points, Vector
from needlefem.fem.recovery import CellFields
from needlefem.plotting.body import Body
from needlefem.plotting.canvas import Canvas
from needlefem.plotting.panel import Panel, Scale, Window
from needlefem.plotting.quantities import FieldQuantity
from needlefem.plotting.style import Style
from needlefem.plotting.texture import Texture
from needlefem.plotting.timeline import Frame, Timeline

BEHIND = 0.3
"""Of the tissue's length along the needle, that is shown of the space that the needle is in."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class ViewOptions:
    """What a picture shows of the tissue.

    Parameters
    ----------
    field : FieldQuantity, optional
        Colours by this; by region when left out.
    scale : Scale, optional
        Of the field.
    texture : Texture, optional
        An image that deforms with the tissue, instead.
    style : Style
    """

    field: FieldQuantity | None = None
    scale: Scale | None = None
    texture: Texture | None = None
    style: Style = dataclasses.field(default_factory=Style)

    @property
    def note(self) -> str:
        """What must be said in the picture."""
        if self.texture is not None:
            return self.texture.note
        return "" if self.field is None else self.field.note


class TissueView:
    """Tissue and outlines of its regions, drawn once and moved from moment to moment.

    Parameters
    ----------
    canvas : Canvas
    film : Timeline
    look : ViewOptions
    """

    def __init__(self, canvas: Canvas, film: Timeline, look: ViewOptions) -> None:
        self.canvas, self.film, self.look = canvas, film, look
        self._cells = CellFields(film.model) if look.field and not look.field.nodal else None
        self._body = Body(canvas, film.model)
        start = film.undeformed()
        self._draw(start)
        self._lines = [canvas.contour(ring, self._ink) for ring in start.contours]
        for obstacle in film.insertion.scene.obstacles.values():
            canvas.obstacle(obstacle.contour.points)

    @property
    def _ink(self) -> str:
        style = self.look.style
        if self.look.field is not None:
            return style.on_field
        return style.outline if self.look.texture is None else style.on_image

    def _draw(self, start: Frame) -> None:
        look, body = self.look, self._body
        if look.texture is not None:
            found = look.texture.coordinates(self.canvas, body.surface.rest)
            body.data.active_texture_coordinates = found
            body.draw(edges=False, texture=look.texture.image())
        elif look.scale is not None:
            self._write_field(start.u, body.to(start.u))
            body.draw(
                scalars="field", clim=(look.scale.low, look.scale.high),
                cmap=look.style.colour_map, nan_color=look.style.folded,
                interpolate_before_map=True,
            )  # fmt: skip
        else:
            body.draw_regions()

    def _write_field(self, u: Floats, moved: Points) -> None:
        field, cells, body = self.look.field, self._cells, self._body
        if field is None:
            return
        if cells is None:
            body.data.point_data["field"] = field.factor * np.linalg.norm(moved, axis=1)
        else:
            body.data.cell_data["field"] = field.of(cells, u)[body.surface.cells]

    def show(self, moment: Frame) -> None:
        """Move to a moment."""
        self._write_field(moment.u, self._body.to(moment.u))
        for line, ring in zip(self._lines, moment.contours, strict=True):
            line.points = self.canvas.plane(np.vstack([ring, ring[:1]]), 2)


class View:
    """Tissue, needle, path, seeds and target of an insertion in a plotter's active panel.

    Parameters
    ----------
    plotter : pyvista.Plotter
    film : Timeline
    look : ViewOptions
    title : str
    window : Window, optional
        What is shown; the whole tissue when left out.
    """

    def __init__(
        self,
        plotter: Any,
        film: Timeline,
        look: ViewOptions,
        title: str,
        window: Window | None = None,
    ) -> None:
        self.film, self.look = film, look
        self.canvas = Canvas(plotter, film.insertion.axis, look.style)
        self.panel = Panel(plotter, look.style, lines=2, scale=look.scale)
        self._tissue = TissueView(self.canvas, film, look)
        self._path = self._draw_path()
        self.panel.look(window or whole(self.canvas, film))
        self._draw_instruments()
        self.panel.line(title, 0)
        if look.note:
            self.panel.note(look.note)
        self.show(film.undeformed())

    def _draw_path(self) -> Any:
        """Draw the whole path as a line that lies at the entry until it is cut."""
        entry = self.film.insertion.axis.entry
        self._path_size = max(len(self.film.moments([np.inf])[0].path), 2)
        style = self.look.style
        ends = np.repeat(entry[None], self._path_size, axis=0)
        return self.canvas.polyline(ends, style.path, style.path_width, 2.5)

    def _draw_instruments(self) -> None:
        insertion = self.film.insertion
        scene, axis, canvas = insertion.scene, insertion.axis, self.canvas
        radius, reach = (
            scene.needle.tip_radius,
            float(np.ptp(axis.axial_coordinate(self.film.model.mesh.p.T))),
        )
        home = axis.tip_position(0.0)
        self._needle = canvas.marker(canvas.needle(home, radius, 4.0 * reach), home)
        if scene.target is not None:
            canvas.target(np.array(scene.target), 2.0 * radius)
        self._seeds = [
            canvas.marker(canvas.seed(home, 1.1 * radius), home) for _ in insertion.seeds
        ]
        self._nowhere: Vector = home - 50.0 * reach * axis.direction

    def show(self, moment: Frame) -> None:
        """Move everything to a moment, and write its time, depth and force."""
        canvas = self.canvas
        self._tissue.show(moment)
        self._path.points = canvas.plane(self._padded(moment.path), 2.5)
        self._needle.to(self.film.insertion.axis.tip_position(moment.depth))
        for number, seed in enumerate(self._seeds):
            seed.to(moment.seeds[number] if number < len(moment.seeds) else self._nowhere)
        self.panel.line(self.caption(moment), 1)

    def _padded(self, path: Floats) -> Floats:
        """Return the path with as many points as it will have at its end."""
        if not len(path):
            path = self.film.insertion.axis.entry[None]
        rest = np.repeat(path[-1:], self._path_size - len(path), axis=0)
        return np.vstack([path, rest])

    def caption(self, moment: Frame) -> str:
        """Return time, depth and force as text."""
        solid = self.film.model.dim == 3
        force = f"{moment.force:.2f} N" if solid else f"{moment.force:.0f} N/m"
        depth = f"depth {100 * moment.depth:.2f} cm" if moment.depth >= 0.0 else "needle out"
        return f"{moment.time:.2f} s, {depth}, force {force}"


def whole(canvas: Canvas, film: Timeline) -> Window:
    """Return the window of the whole tissue and some of the space behind the needle's entry."""
    corners = canvas.screen(film.model.mesh.p.T)
    reach = float(np.ptp(corners[:, 0]))
    end = corners.max(axis=0) + np.array([BEHIND * reach, 0.0, 0.0])
    return Window.around(np.vstack([corners, end]), 0.03)
