"""Drawing of tissue, needle, seeds, target and paths with PyVista.

A needle along the second coordinate enters from the right, as in the paper of 2003. Drawn objects
can be moved, so that further pictures need no new objects.
"""

from collections.abc import Sequence

import numpy as np

from needlefem._arrays import Bools, Floats, Ints, Points, SkfemMesh, Vector
from needlefem.elements.shape_functions import ShapeTable, shape_table
from needlefem.fem.function_space import FunctionSpace
from needlefem.geometry.contour import Contour
from needlefem.needle.needle_interface import InsertionAxis
from needlefem.plotting.images import Plotter, PolyData, Style, renderer
from needlefem.scene import Obstacle

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
        mesh, element = self.space.mesh, self.space.element.skfem_element()
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


# The canvas of one panel, and objects on it that can be moved.


SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
GRID = 200
"""Points a side of the grid on which the line around an obstacle is found."""
LAYER = 1e-3
"""Distance between layers, m; a higher layer covers the lower ones."""
OBSTACLE_LAYER = 2.2
FULL = 600.0
"""Height of a panel, pixels, below which line widths are reduced in proportion."""
THINNEST = 1.25
"""Smallest line width, pixels; parts of a thinner line would fall between the samples."""


def screen_frame(axis: InsertionAxis) -> Floats:
    """Return the directions to the right and upwards on the screen, shape (2, dim).

    In 2D the first coordinate increases upwards and the second to the left, for any needle: the
    patient is upright and an oblique needle is drawn oblique. In 3D both directions lie in the
    plane of the needle, the first opposite to the coordinate axis nearest to the needle.
    """
    along, up = -axis.direction, axis.lateral_directions[0]
    if len(along) == 2:
        return np.array([[0.0, -1.0], [1.0, 0.0]])
    nearest = int(np.argmax(np.abs(along)))
    x, y = np.sign(along[nearest]) * np.array([along[nearest], up[nearest]])
    turned: Floats = np.array([[x, y], [-y, x]]) @ np.stack([along, up]) / np.hypot(x, y)
    return turned


class Canvas:
    """Screen coordinates of one panel; see `screen_frame`.

    In 3D, the half of the tissue behind the plane of the needle is shown; all other objects lie in
    this plane.

    Parameters
    ----------
    plotter : pyvista.Plotter
        A plotter whose active subplot is this panel.
    axis : InsertionAxis
        The insertion axis.
    style : Style
    """

    def __init__(self, plotter: Plotter, axis: InsertionAxis, style: Style) -> None:
        self.plotter, self.axis, self.style = plotter, axis, style
        self._pv, self.frame = renderer(), screen_frame(axis)
        wide, high = plotter.renderer.GetSize()
        self._thin = min(1.0, min(high, 0.8 * wide) / FULL)

    def screen(self, points: Points, layer: float = 0.0) -> Floats:
        """Return screen coordinates of points, shape (n, dim), as (n, 3), m."""
        points = np.atleast_2d(points)
        height = np.full(len(points), LAYER * layer)
        if points.shape[1] == 3:
            height = height + self.axis.lateral_offset(points)[:, 1]
        return np.column_stack([points @ self.frame.T, height])

    def plane(self, points: Points, layer: float) -> Floats:
        """Return screen coordinates in the plane of the needle, shape (n, 3), m."""
        at = self.screen(points, layer)
        at[:, 2] = LAYER * layer
        return at

    def behind(self, mesh: SkfemMesh) -> Bools:
        """Return whether cells are shown, shape (ncells,); in 3D those behind the needle."""
        if mesh.dim() == 2:
            return np.ones(mesh.nelements, dtype=bool)
        middles = mesh.p[:, mesh.t].mean(axis=1).T
        found: Bools = self.axis.lateral_offset(middles)[:, 1] <= 0.0
        return found

    def polygons(self, points: Points, corners: Ints) -> PolyData:
        """Return polygons, corners of shape (n, k), as a PyVista mesh that can be moved."""
        faces = np.column_stack([np.full(len(corners), corners.shape[1]), corners]).ravel()
        found: PolyData = self._pv.PolyData(self.screen(points), faces=faces)
        return found

    def edges(self) -> dict[str, object]:
        """Return the drawing options of the edges of polygons."""
        width = self._thin * self.style.mesh_width
        return {"show_edges": True, "edge_color": self.style.mesh, "line_width": width}

    def add(self, data: PolyData, **how: object) -> None:
        """Draw a PyVista mesh without shading."""
        self.plotter.add_mesh(
            data, lighting=False, show_scalar_bar=False, reset_camera=False, render=False, **how
        )

    def strands(self, points: Points, numbers: Ints, layer: float, width: float) -> "Strands":
        """Return lines through points, numbers of shape (n, k), that can be drawn and moved."""
        return Strands(self, points, numbers, layer, self.width(width))

    def width(self, width: float) -> float:
        """Return the width of a line in this panel, pixels."""
        return max(float(self._thin * width), THINNEST)

    def polyline(
        self, points: Points, colour: str, width: float, layer: float, *, closed: bool = False
    ) -> PolyData:
        """Draw a line through points of the world, `width` pixels wide."""
        ring = np.vstack([points, points[:1]]) if closed else points
        data: PolyData = self._pv.lines_from_points(self.plane(ring, layer))
        self.add(data, color=colour, line_width=self.width(width))
        return data

    def contour(self, points: Points, colour: str | None = None) -> PolyData:
        """Draw a closed line through points of the world."""
        shown = colour or self.style.outline
        return self.polyline(points, shown, self.style.outline_width, 2, closed=True)

    def polygon(self, corners: Points, colour: str, layer: float) -> PolyData:
        """Fill a polygon with corners in the world."""
        at = self.plane(corners, layer)
        data: PolyData = self._pv.PolyData(at, faces=[len(at), *range(len(at))])
        self.add(data, color=colour)
        return data

    def obstacle(self, obstacle: Obstacle) -> None:
        """Draw an obstacle, fixed in space, and a line at the distance of its clearance."""
        corners = obstacle.contour.points
        at = self.plane(corners, OBSTACLE_LAYER)
        filled = self._pv.PolyData(at, faces=[len(at), *range(len(at))]).triangulate()
        self.add(filled, color=self.style.obstacle)
        self.polyline(corners, self.style.needle, 2.0, OBSTACLE_LAYER + 0.1, closed=True)
        for ring in clearance_lines(obstacle.contour, obstacle.clearance):
            self.polyline(ring, self.style.obstacle, 2.0, OBSTACLE_LAYER + 0.1)

    def needle_corners(self, tip: Vector, radius: float, length: float) -> Floats:
        """Return the outline of the needle, tip first, over a length (m) behind the tip."""
        back, side = -self.axis.direction, 0.5 * radius * self.axis.lateral_directions[0]
        neck, end = tip + 1.6 * radius * back, tip + length * back
        return np.array([tip, neck + side, end + side, end - side, neck - side])

    def needle(self, tip: Vector, radius: float, length: float) -> list[PolyData]:
        """Draw the needle with a thin pale rim and its tip at a point in space."""
        rim = self.needle_corners(tip, 1.15 * radius, length)
        rim[0] = tip
        shapes = [self.polygon(rim, self.style.background, 3)]
        shapes.append(self.polygon(self.needle_corners(tip, radius, length), self.style.needle, 4))
        return shapes

    def _square(self, point: Vector, size: Floats | float) -> Floats:
        corners: Floats = point + (0.5 * np.asarray(size) * SQUARE) @ self.frame
        return corners

    def seed(self, point: Vector, size: float, colour: str | None = None) -> list[PolyData]:
        """Draw a seed as a square, `size` m wide."""
        rim = self.polygon(self._square(point, 1.35 * size), "white", 5)
        return [rim, self.polygon(self._square(point, size), colour or self.style.seed, 6)]

    def target(self, point: Vector, size: float, colour: str | None = None) -> None:
        """Draw the target as four arms of an upright cross, `2 size` m wide, open in the middle."""
        for paint, rim, layer in (("white", 0.05, 7), (colour or self.style.target, 0.0, 8)):
            for arm in (np.array([0.32, 0.07]), np.array([0.07, 0.32])):
                way = np.where(arm > 0.1, 0.34 * 2.0 * size, 0.0)
                for side in (-way, way):
                    shape = self._square(point + side @ self.frame, 2.0 * size * (arm + rim))
                    self.polygon(shape, paint, layer)

    def disc(self, point: Vector, size: float, colour: str, layer: float = 6) -> PolyData:
        """Draw a disc, `size` m wide."""
        turn = 2.0 * np.pi * np.arange(32) / 32
        ring = np.stack([np.cos(turn), np.sin(turn)], axis=1)
        self.polygon(point + (0.5 * size + 0.06 * size) * ring @ self.frame, "white", layer - 0.5)
        return self.polygon(point + 0.5 * size * ring @ self.frame, colour, layer)

    def marker(self, shapes: Sequence[PolyData], home: Vector) -> "Marker":
        """Return shapes that were drawn at `home` as an object that can be moved."""
        return Marker(self, shapes, home)


def clearance_lines(contour: Contour, distance: float) -> list[Points]:
    """Return the lines outside of a contour at a distance (m) from it."""
    if distance == 0.0:
        return []
    from contourpy import contour_generator  # noqa: PLC0415  (comes with matplotlib)

    low, high = contour.points.min(axis=0), contour.points.max(axis=0)
    x, y = np.linspace(low - 1.1 * distance, high + 1.1 * distance, GRID).T
    points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    apart = np.where(contour.contains(points), 0.0, contour.distance(points))
    lines = contour_generator(x, y, apart.reshape(GRID, GRID)).lines(distance)
    return [np.asarray(line) for line in lines]


class Marker:
    """Shapes that move together in the plane of the needle."""

    def __init__(self, canvas: Canvas, shapes: Sequence[PolyData], home: Vector) -> None:
        self._canvas, self._shapes = canvas, tuple(shapes)
        self._bases = [np.array(shape.points) for shape in shapes]
        self._home = canvas.plane(home, 0)[0]

    def to(self, point: Vector) -> None:
        """Move to a point of the world, shape (dim,), m."""
        shift = self._canvas.plane(point, 0)[0] - self._home
        for shape, base in zip(self._shapes, self._bases, strict=True):
            shape.points = base + shift


class Strands:
    """Lines through points that move."""

    def __init__(
        self, canvas: Canvas, points: Points, numbers: Ints, layer: float, width: float
    ) -> None:
        self._canvas, self._layer, self._width = canvas, layer, width
        self._used, place = np.unique(numbers, return_inverse=True)
        count, size = numbers.shape
        lines = np.column_stack([np.full(count, size), place.reshape(count, size)]).ravel()
        self._data: PolyData = renderer().PolyData(self._at(points), lines=lines)

    def _at(self, points: Points) -> Floats:
        return self._canvas.screen(points[self._used], self._layer)

    def draw(self, colour: str, *, closed: bool = False) -> "Strands":
        """Draw the lines; `closed` fills pixels that would remain open where lines meet."""
        self._canvas.add(self._data, color=colour, line_width=self._width)
        if closed:
            self._canvas.add(self._data, color=colour, style="points", point_size=self._width)
        return self

    def to(self, points: Points) -> None:
        """Move all points, shape (npoints, dim), m."""
        self._data.points = self._at(points)
