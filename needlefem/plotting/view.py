"""Views of an insertion: visible faces and edges of the mesh, moved by displacements."""

import dataclasses

import numpy as np

from needlefem._arrays import Bools, Floats, Ints, Points, Vector
from needlefem.elements.shape_functions import ShapeTable, shape_table
from needlefem.fem.function_space import FunctionSpace
from needlefem.fem.recovery import CellFields
from needlefem.mesh.generation import BACKGROUND
from needlefem.plotting.canvas import Canvas, Strands
from needlefem.plotting.images import Plotter, PolyData, Style, renderer
from needlefem.plotting.panel import Panel, Scale, Texture, Window
from needlefem.plotting.quantities import FieldQuantity
from needlefem.plotting.timeline import Frame, Timeline

PIECES = 20_000
"""Approximate number of triangles and quadrilaterals that curved cells are divided into."""
FEWEST, MOST = 2, 6
"""Smallest number of parts of a curved edge, which has a middle node."""


class SurfaceMesh:
    """The visible faces of a mesh and their edges.

    In 2D these are the cells, in 3D the outer faces of the cells: triangles and quadrilaterals.
    If the displacement or the geometry is quadratic, the faces are divided into smaller ones, so
    that edges appear curved.

    Parameters
    ----------
    space : FunctionSpace
    shown : array, shape (ncells,), optional
        The visible cells; all by default.

    Attributes
    ----------
    rest : array, shape (npoints, dim), m
        The undeformed points.
    polygons : array, shape (n, corners)
        Numbers of points.
    cells : array, shape (n,)
        Cell of each polygon.
    edges : array, shape (m, parts + 1)
        Numbers of the points along each edge of a cell.
    outline : array, shape (k, parts + 1)
        The same for edges of one face only: the surface of plane tissue.
    parts : int
        Number of parts of an edge; 1 if it is straight.
    """

    def __init__(self, space: FunctionSpace, shown: Bools | None = None) -> None:
        self.space, mesh = space, space.mesh
        self._local = np.arange(len(mesh.t))[None]
        if mesh.dim() == 3:
            self._local = np.array(mesh.elem.refdom.facets)
        owners, kinds = self._faces(np.ones(mesh.nelements, bool) if shown is None else shown)
        corners = mesh.t[self._local[kinds], owners[:, None]]
        curved = space.element.degree > 1 or mesh.p.shape[1] != len(np.unique(mesh.t))
        self.parts = 1
        self._weights: Floats | None = None
        self.rest: Points = mesh.p.T
        self.polygons, self.cells = corners, owners
        along = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2)
        if curved:
            least = np.sqrt(PIECES / max(len(owners), 1))
            self.parts = int(np.clip(least, FEWEST, MOST))
            pattern = _Pattern(corners.shape[1], self.parts)
            numbers = np.arange(len(owners) * pattern.size).reshape(len(owners), pattern.size)
            self._cut(owners, kinds, pattern)
            self.polygons = numbers[:, pattern.sub_cells].reshape(-1, corners.shape[1])
            self.cells = np.repeat(owners, len(pattern.sub_cells))
            along = numbers[:, pattern.rim]
        self.edges, alone = _edges(corners, along)
        self.outline: Ints = self.edges[alone]

    def _faces(self, shown: Bools) -> tuple[Ints, Ints]:
        """Return the cell of each visible face, and the face's number in the cell."""
        mesh, kept = self.space.mesh, np.flatnonzero(shown)
        if mesh.dim() == 2:
            return kept, np.zeros(len(kept), dtype=np.intp)
        facets = mesh.t2f[:, kept].T
        seen = np.bincount(facets.ravel(), minlength=mesh.nfacets)[facets] == 1
        rows, kinds = np.nonzero(seen)
        return kept[rows], kinds

    def _cut(self, owners: Ints, kinds: Ints, pattern: "_Pattern") -> None:
        """Compute the points of divided faces and the nodal weights there."""
        mesh, element = self.space.mesh, self.space.element.make()
        reference = np.asarray(mesh.elem.refdom.p, dtype=float).T
        places = np.array([pattern.weights @ reference[local] for local in self._local])
        flat = places.reshape(-1, places.shape[2])
        ways = len(self._local), pattern.size
        shapes = shape_table(mesh.elem)(flat).reshape(*ways, -1)[kinds]
        found = mesh.doflocs.T[mesh.dofs.element_dofs[:, owners].T]
        self.rest = np.einsum("fpn,fnd->fpd", shapes, found).reshape(-1, mesh.dim())
        self._weights = ShapeTable(element)(flat).reshape(*ways, -1)[kinds]
        self._nodes = self.space.cell_nodes[owners]

    def displaced(self, u: Floats) -> Points:
        """Return the displacement of the points, shape (npoints, dim), m.

        Parameters
        ----------
        u : array, shape (ndofs,), m
        """
        if self._weights is None:
            found: Points = u[self.space.basis.nodal_dofs].T
            return found
        nodal = self.space.nodal(u)[self._nodes]
        moved: Points = np.matmul(self._weights, nodal).reshape(self.rest.shape)
        return moved


class _Pattern:
    """Division of a triangle or quadrilateral with equal parts of each edge.

    Attributes
    ----------
    weights : array, shape (size, corners)
        Weights of the corners at each point.
    sub_cells : array, shape (parts^2, corners)
        Point numbers of the parts.
    rim : array, shape (corners, parts + 1)
        Points along the edges.
    """

    def __init__(self, corners: int, parts: int) -> None:
        square = corners == 4
        ticks = range(parts + 1)
        grid = [(i, j) for j in ticks for i in ticks if square or i + j <= parts]
        number = {place: at for at, place in enumerate(grid)}
        x, y = np.array(grid, dtype=float).T / parts
        if square:
            columns = [(1 - x) * (1 - y), x * (1 - y), x * y, (1 - x) * y]
        else:
            columns = [1 - x - y, x, y]
        self.weights, self.size = np.stack(columns, axis=1), len(grid)
        found: list[list[tuple[int, int]]] = []
        for i, j in grid:
            ring = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
            split = [ring] if square else [[ring[0], ring[1], ring[3]], ring[1:]]
            found += [sub_cell for sub_cell in split if all(place in number for place in sub_cell)]
        self.sub_cells = np.array([[number[place] for place in sub_cell] for sub_cell in found])
        ends = [(0, 0), (parts, 0), (parts, parts), (0, parts)] if square else [
            (0, 0), (parts, 0), (0, parts)]  # fmt: skip
        self.rim = np.array(
            [_along(number, ends[k], ends[(k + 1) % corners], parts) for k in range(corners)]
        )


def _along(
    number: dict[tuple[int, int], int], start: tuple[int, int], end: tuple[int, int], parts: int
) -> list[int]:
    steps = [(end[axis] - start[axis]) // parts for axis in (0, 1)]
    return [number[start[0] + k * steps[0], start[1] + k * steps[1]] for k in range(parts + 1)]


def _edges(corners: Ints, along: Ints) -> tuple[Ints, Bools]:
    """Return each edge once, shape (m, parts + 1), and whether it belongs to one face only."""
    ends = np.sort(np.stack([corners, np.roll(corners, -1, axis=1)], axis=2), axis=2)
    key = ends[..., 0].ravel() * (int(corners.max()) + 1) + ends[..., 1].ravel()
    _, first, count = np.unique(key, return_index=True, return_counts=True)
    return along.reshape(-1, along.shape[2])[first], count == 1


# Tissue on a canvas: mesh with colours of regions or values, edges and surface.


EDGE_LAYER, SKIN_LAYER = 1, 2


class Body:
    """A mesh that is drawn once and then moved by displacements.

    Parameters
    ----------
    canvas : Canvas
    space : FunctionSpace
        Function space of plane or 3D tissue.

    Attributes
    ----------
    data : pyvista.PolyData
        Visible faces, which are coloured before they are drawn.
    surface : SurfaceMesh
    """

    def __init__(self, canvas: Canvas, space: FunctionSpace) -> None:
        self.canvas, self.space = canvas, space
        self.surface = SurfaceMesh(space, canvas.behind(space.mesh))
        self.data = canvas.polygons(self.surface.rest, self.surface.polygons)
        self._strands = []
        if space.dim == 2:
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
        """Draw the faces in the colours of their regions."""
        mesh, palette = self.space.mesh, self.canvas.style.tissue
        regions = mesh.subdomains or {}
        names = [BACKGROUND, *sorted(set(regions) - {BACKGROUND})]
        owner = np.zeros(mesh.nelements, dtype=np.intp)
        for number, name in enumerate(names):
            owner[regions[name]] = number
        colours = np.array([renderer().Color(c).int_rgb for c in palette], dtype=np.uint8)
        self.data.cell_data["colours"] = colours[owner[self.surface.cells] % len(palette)]
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
        self.panel = Panel(plotter, look.style, lines=2, scale=look.scale)
        self._tissue = TissueView(self.canvas, film, look)
        self._path = self._draw_path()
        self.panel.look(window or whole(self.canvas, film))
        self._draw_instruments()
        self.panel.line(title, 0)
        if look.note:
            self.panel.note(look.note)
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
        solid = self.film.model.dim == 3
        force = f"{moment.force:.2f} N" if solid else f"{moment.force:.0f} N/m"
        depth = (
            f"depth {100 * moment.depth:.2f} cm" if moment.depth >= 0.0 else "tip outside tissue"
        )
        return f"{moment.time:.2f} s, {depth}, force {force}"


def whole(canvas: Canvas, film: Timeline) -> Window:
    """Return a window with the whole tissue and a part of the space in front of the entry."""
    corners = canvas.screen(film.model.mesh.p.T)
    reach = float(np.ptp(corners[:, 0]))
    end = corners.max(axis=0) + np.array([BEHIND * reach, 0.0, 0.0])
    return Window.around(np.vstack([corners, end]), 0.03)
