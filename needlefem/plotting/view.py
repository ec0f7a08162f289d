"""Views of an insertion: fields, tissue, needle and seeds, moved from frame to frame."""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np

from needlefem._arrays import Floats, Ints, Points, Vector
from needlefem.errors import CaseError, nearest
from needlefem.fem.recovery import CellFields
from needlefem.fem.tissue_model import TissueModel
from needlefem.insertion.result import LARGE_STRAIN
from needlefem.plotting.canvas import Canvas, Strands, SurfaceMesh
from needlefem.plotting.images import Plotter, PolyData, Style, force_unit, renderer
from needlefem.plotting.panel import Panel, Scale, Texture, Window, rulers
from needlefem.plotting.timeline import Frame, Timeline

# Fields that pictures can show: names, units, values and colour scales.


TOP = 99.5
"""Percentile of the values at the end of the colour scale; few cells at the tip exceed it."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class FieldQuantity:
    """A field that a picture can show.

    Parameters
    ----------
    label : str
        Name of the quantity with its unit.
    factor : float
        Factor from SI to this unit.
    values : callable
        Takes the cell fields of a model and a displacement, shape (ndofs,), m; returns one value
        per vertex or cell, NaN in inverted cells.
    nodal : bool
        Whether the values belong to vertices.
    signed : bool
        Whether the scale is symmetric about zero.
    note : str
        Note in the picture.
    """

    label: str
    factor: float
    values: Callable[[CellFields, Floats], Floats]
    nodal: bool = False
    signed: bool = False
    note: str = ""

    def of(self, cells: CellFields, u: Floats) -> Floats:
        """Return the values of a displacement in the unit of the label."""
        found: Floats = self.factor * self.values(cells, u)
        return found


def _displacement(cells: CellFields, u: Floats) -> Floats:
    moved = u[cells.model.basis.nodal_dofs]
    size: Floats = np.linalg.norm(moved, axis=0)
    return size


def _validity(cells: CellFields, u: Floats) -> Floats:
    """Return the strain relative to the limit of small strain; NaN in inverted cells."""
    share: Floats = cells.largest_strain(u) / LARGE_STRAIN
    return np.where(cells.volume_ratio(u) > 0.0, share, np.nan)


QUANTITIES = {
    "displacement": FieldQuantity(
        label="displacement (mm)", factor=1e3, values=_displacement, nodal=True
    ),
    "strain": FieldQuantity(
        label="largest strain (%)", factor=1e2, values=lambda cells, u: cells.largest_strain(u)
    ),
    "von-mises": FieldQuantity(
        label="von Mises stress (kPa)", factor=1e-3, values=lambda cells, u: cells.von_mises(u)
    ),
    "pressure": FieldQuantity(
        label="pressure (kPa)", factor=1e-3, values=lambda c, u: c.pressure(u), signed=True
    ),
    "validity": FieldQuantity(
        label=f"strain / {LARGE_STRAIN:g} (1)", factor=1.0, values=_validity,
        note="small strain is valid up to 1; orange: inverted cells",
    ),
}  # fmt: skip
"""The fields that a picture can show, by the names of ``--field``."""


def quantity(name: str) -> FieldQuantity:
    """Return a quantity by name.

    Raises
    ------
    CaseError
        The field does not exist.
    """
    if name not in QUANTITIES:
        raise CaseError("field", f"no field '{name}'", nearest(name, QUANTITIES))
    return QUANTITIES[name]


def scale_of(shown: FieldQuantity, values: Sequence[Floats]) -> Scale:
    """Return a common colour scale for several pictures."""
    finite = np.concatenate([found[np.isfinite(found)] for found in values])
    size = np.abs(finite) if finite.size else np.zeros(1)
    top = float(np.percentile(size, TOP)) or float(size.max()) or 1.0
    over = bool(finite.size and finite.max() > top * (1.0 + 1e-9))
    return Scale(label=shown.label, low=-top if shown.signed else 0.0, high=top, over=over)


# Tissue on a canvas: mesh with colours of regions or values, edges and surface.


EDGE_LAYER, SKIN_LAYER = 1, 2


def region_colours(model: TissueModel, style: Style) -> dict[str, str]:
    """Return the colour of the background and of each region, in the order of their materials."""
    palette = style.tissue
    return {name: palette[n % len(palette)] for n, name in enumerate(model.materials)}


class Body:
    """A mesh that is drawn once and then moved by displacements.

    Parameters
    ----------
    canvas : Canvas
    model : TissueModel
        Plane or 3D tissue.

    Attributes
    ----------
    data : pyvista.PolyData
        Visible faces, which are coloured before they are drawn.
    surface : SurfaceMesh
    """

    def __init__(self, canvas: Canvas, model: TissueModel) -> None:
        self.canvas, self.model = canvas, model
        self.surface = SurfaceMesh(model, canvas.behind(model.mesh))
        self.data = canvas.polygons(self.surface.rest, self.surface.polygons)
        self._strands = []
        if model.dim == 2:
            self._strands.append(self._lines(self.surface.outline, SKIN_LAYER))

    def _lines(self, numbers: Ints, layer: float) -> Strands:
        style, skin = self.canvas.style, layer == SKIN_LAYER
        width = style.outline_width if skin else style.mesh_width
        lines = self.canvas.strands(self.surface.rest, numbers, layer, width)
        return lines.draw(style.outline if skin else style.mesh, closed=skin)

    def draw(self, *, edges: bool = True, **how: object) -> None:
        """Draw the faces with options of PyVista."""
        straight = self.surface.parts == 1
        if edges and not straight:
            self._strands.append(self._lines(self.surface.edges, EDGE_LAYER))
        lines = self.canvas.edges() if edges and straight else {"show_edges": False}
        self.canvas.add(self.data, **lines, **how)

    def draw_regions(self) -> None:
        """Draw the faces in the colours of `region_colours`."""
        model = self.model
        colours = [
            renderer().Color(colour).int_rgb
            for colour in region_colours(model, self.canvas.style).values()
        ]
        cells = model.cell_materials[self.surface.cells]
        self.data.cell_data["colours"] = np.array(colours, dtype=np.uint8)[cells]
        self.draw(scalars="colours", rgb=True)

    def to(self, u: Floats) -> Points:
        """Move the mesh by a displacement, shape (ndofs,), m; return that of its points."""
        moved = self.surface.displaced(u)
        at = self.surface.rest + moved
        self.data.points = self.canvas.screen(at)
        for strands in self._strands:
            strands.to(at)
        return moved


# An insertion in one panel, drawn once and then moved from frame to frame.


BEHIND = 0.3
"""Length of the shown space in front of the skin, relative to the tissue's length."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class ViewOptions:
    """Appearance of the tissue.

    Parameters
    ----------
    field : FieldQuantity, optional
        Quantity that is shown by colours; regions are shown by default.
    scale : Scale, optional
        Colour scale of the field.
    texture : Texture, optional
        An image that deforms with the tissue, instead of colours.
    style : Style
    """

    field: FieldQuantity | None = None
    scale: Scale | None = None
    texture: Texture | None = None
    style: Style = dataclasses.field(default_factory=Style)

    @property
    def note(self) -> str:
        """Note that must be shown in the picture."""
        if self.texture is not None:
            return self.texture.note
        return "" if self.field is None else self.field.note


class TissueView:
    """Tissue and outlines of its regions, drawn once and moved from frame to frame.

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
            canvas.obstacle(obstacle)

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
                interpolate_before_map=True, edges=False,
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
        """Show a frame."""
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
        The shown part of the plane; the whole tissue by default.
    """

    def __init__(
        self,
        plotter: Plotter,
        film: Timeline,
        look: ViewOptions,
        title: str,
        window: Window | None = None,
    ) -> None:
        self.film, self.look = film, look
        self.canvas = Canvas(plotter, film.insertion.axis, look.style)
        self.panel = Panel(
            plotter, look.style, lines=2, scale=look.scale, row=shown_objects(film, look.style),
            ruled=rulers(self.canvas, film.insertion.scene.axes), note=look.note,
        )  # fmt: skip
        self._tissue = TissueView(self.canvas, film, look)
        self._path = self._draw_path()
        self.panel.look(window or whole(self.canvas, film))
        self._draw_instruments()
        self.panel.line(title, 0)
        self.show(film.undeformed())

    def _draw_path(self) -> PolyData:
        """Draw the whole path as a line; points that are not cut yet lie at the entry."""
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
        """Show a frame with its time, depth and force."""
        canvas = self.canvas
        self._tissue.show(moment)
        self._path.points = canvas.plane(self._padded(moment.path), 2.5)
        self._needle.to(self.film.insertion.axis.tip_position(moment.depth))
        for number, seed in enumerate(self._seeds):
            seed.to(moment.seeds[number] if number < len(moment.seeds) else self._nowhere)
        self.panel.line(self.caption(moment), 1)

    def _padded(self, path: Floats) -> Floats:
        """Return the path with the number of points that it has at its end."""
        if not len(path):
            path = self.film.insertion.axis.entry[None]
        rest = np.repeat(path[-1:], self._path_size - len(path), axis=0)
        return np.vstack([path, rest])

    def caption(self, moment: Frame) -> str:
        """Return time, depth and force as a text."""
        dim = self.film.model.dim
        force = f"{moment.force:.{2 if dim == 3 else 0}f} {force_unit(dim)}"
        depth = (
            f"depth {100 * moment.depth:.2f} cm" if moment.depth >= 0.0 else "tip outside tissue"
        )
        return f"{moment.time:.2f} s, {depth}, force {force}"


def whole(canvas: Canvas, film: Timeline) -> Window:
    """Return a window with the whole tissue and a part of the space in front of the entry."""
    corners = canvas.screen(film.model.mesh.p.T)
    reach = float(np.ptp(corners[:, 0]))
    behind = canvas.screen(canvas.axis.tip_position(-BEHIND * reach))
    return Window.around(np.vstack([corners, behind]), 0.03)


def shown_objects(film: Timeline, style: Style) -> list[tuple[str, str]]:
    """Return colour and name of the objects that a view of an insertion shows."""
    insertion, scene = film.insertion, film.insertion.scene
    found = [(style.needle, "needle"), (style.path, "path")]
    found += [(style.seed, "seed")] if insertion.seeds else []
    found += [(style.target, "target")] if scene.target is not None else []
    if scene.obstacles:
        kept = any(obstacle.clearance for obstacle in scene.obstacles.values())
        found.append((style.obstacle, "obstacle; line: clearance" if kept else "obstacle"))
    return found
