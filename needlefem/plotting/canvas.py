"""Drawing of tissue, needle, seeds, target and paths with PyVista.

The needle enters from the right, as in the paper of 2003: the depth increases to the left, the
lateral offset upwards. Drawn objects can be moved, so that further pictures need no new objects.
"""

from collections.abc import Sequence

import numpy as np

from needlefem._arrays import Bools, Floats, Ints, Points, SkfemMesh, Vector
from needlefem.needle.needle_interface import InsertionAxis
from needlefem.plotting.images import Plotter, PolyData, Style, renderer

SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
LAYER = 1e-3
"""Distance between layers, m; a higher layer covers the lower ones."""
OBSTACLE_LAYER = 2.2
FULL = 600.0
"""Height of a panel, pixels, below which line widths are reduced in proportion."""
THINNEST = 1.25
"""Smallest line width, pixels; parts of a thinner line would fall between the samples."""


class Canvas:
    """Screen coordinates of one panel: right is opposite to the needle, up is lateral.

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
        self._pv = renderer()
        wide, high = plotter.renderer.GetSize()
        self._thin = min(1.0, min(high, 0.8 * wide) / FULL)

    def screen(self, points: Points, layer: float = 0.0) -> Floats:
        """Return screen coordinates of points, shape (n, dim), as (n, 3), m."""
        points = np.atleast_2d(points)
        across = np.stack([-self.axis.direction, self.axis.lateral_directions[0]], axis=1)
        height = np.full(len(points), LAYER * layer)
        if points.shape[1] == 3:
            height = height + self.axis.lateral_offset(points)[:, 1]
        return np.column_stack([points @ across, height])

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

    def obstacle(self, corners: Points) -> None:
        """Fill and outline a polygon, convex or not, that is fixed in space."""
        at = self.plane(corners, OBSTACLE_LAYER)
        filled = self._pv.PolyData(at, faces=[len(at), *range(len(at))]).triangulate()
        self.add(filled, color=self.style.obstacle)
        self.polyline(corners, self.style.needle, 2.0, OBSTACLE_LAYER + 0.1, closed=True)

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
        frame = np.stack([-self.axis.direction, self.axis.lateral_directions[0]])
        corners: Floats = point + (0.5 * np.asarray(size) * SQUARE) @ frame
        return corners

    def seed(self, point: Vector, size: float, colour: str | None = None) -> list[PolyData]:
        """Draw a seed as a square, `size` m wide."""
        rim = self.polygon(self._square(point, 1.35 * size), "white", 5)
        return [rim, self.polygon(self._square(point, size), colour or self.style.seed, 6)]

    def target(self, point: Vector, size: float, colour: str | None = None) -> None:
        """Draw the target as an upright cross, `size` m wide."""
        for paint, rim, layer in (("white", 0.05, 7), (colour or self.style.target, 0.0, 8)):
            for arm in (np.array([0.5, 0.07]), np.array([0.07, 0.5])):
                self.polygon(self._square(point, 2.0 * size * (arm + rim)), paint, layer)

    def disc(self, point: Vector, size: float, colour: str, layer: float = 6) -> PolyData:
        """Draw a disc, `size` m wide."""
        turn = 2.0 * np.pi * np.arange(32) / 32
        frame = np.stack([-self.axis.direction, self.axis.lateral_directions[0]])
        ring = np.stack([np.cos(turn), np.sin(turn)], axis=1)
        self.polygon(point + (0.5 * size + 0.06 * size) * ring @ frame, "white", layer - 0.5)
        return self.polygon(point + 0.5 * size * ring @ frame, colour, layer)

    def marker(self, shapes: Sequence[PolyData], home: Vector) -> "Marker":
        """Return shapes that were drawn at `home` as an object that can be moved."""
        return Marker(self, shapes, home)


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
