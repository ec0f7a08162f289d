"""Drawing a 2D scene with PyVista: tissue, needle, seed, target, scale.

The needle comes from the right, as in the paper: depth runs to the left, height upward.
"""

import dataclasses
from typing import Any

import numpy as np

from needlefem.arrays import Floats, Points, SkfemMesh, Vector
from needlefem.fem.mesh import BACKGROUND
from needlefem.needle.axis import Axis
from needlefem.output.driver import renderer


@dataclasses.dataclass(frozen=True, kw_only=True)
class Style:
    """How everything looks; colours are safe for the colour-blind (Okabe and Ito)."""

    background: str = "white"
    tissue: tuple[str, ...] = ("#f4e7c5", "#e3b5a4", "#c9d5e8", "#cfe3cf")
    mesh: str = "#8a7f6a"
    outline: str = "#5b3a29"
    needle: str = "#20262e"
    seed: str = "#0072B2"
    target: str = "#D55E00"
    text: str = "#202020"
    mesh_width: float = 0.6
    outline_width: float = 3.0
    font_size: int = 22


@dataclasses.dataclass(frozen=True, eq=False)
class Window:
    """A part of the plane: centre (2,), m, width and height, m, in screen coordinates."""

    centre: Floats
    width: float
    height: float


class Canvas:
    """One panel of a picture in screen coordinates: right is against the needle, up is lateral.

    Parameters
    ----------
    plotter : pyvista.Plotter
        With this panel as its active subplot.
    axis : Axis
        The needle's line.
    style : Style
    """

    def __init__(self, plotter: Any, axis: Axis, style: Style) -> None:
        self.plotter, self.axis, self.style = plotter, axis, style
        self._pv = renderer()

    def screen(self, points: Points, layer: float = 0.0) -> Floats:
        """Return screen coordinates (n, 3), m; higher layers cover lower ones."""
        points = np.atleast_2d(points)
        directions = np.stack([-self.axis.direction, self.axis.laterals[0]], axis=1)
        return np.column_stack([points @ directions, np.full(len(points), 1e-3 * layer)])

    def tissue(self, mesh: SkfemMesh, moved: Points | None = None) -> None:
        """Draw the mesh by region, moved by a displacement of its vertices, shape (n, 2), m."""
        points = mesh.p.T if moved is None else mesh.p.T + moved
        at = self.screen(points)
        names = [BACKGROUND, *sorted(set(mesh.subdomains) - {BACKGROUND})]
        for number, name in enumerate(names):
            cells = mesh.t[:, mesh.subdomains[name]].T
            faces = np.column_stack([np.full(len(cells), cells.shape[1]), cells]).ravel()
            self.plotter.add_mesh(
                self._pv.PolyData(at, faces=faces),
                color=self.style.tissue[number % len(self.style.tissue)],
                show_edges=True,
                edge_color=self.style.mesh,
                line_width=self.style.mesh_width,
                lighting=False,
            )
        self._outline(mesh, points)

    def _outline(self, mesh: SkfemMesh, points: Points) -> None:
        """Draw the outer edge."""
        edge = mesh.facets[:, mesh.boundary_facets()].T
        lines = np.column_stack([np.full(len(edge), 2), edge]).ravel()
        self.plotter.add_mesh(
            self._pv.PolyData(self.screen(points, 1), lines=lines),
            color=self.style.outline,
            line_width=self.style.outline_width,
            lighting=False,
        )

    def _polygon(self, corners: Points, colour: str, layer: float) -> None:
        at = self.screen(corners, layer)
        face = np.concatenate([[len(at)], np.arange(len(at))])
        self.plotter.add_mesh(self._pv.PolyData(at, faces=face), color=colour, lighting=False)

    def contour(self, points: Points) -> None:
        """Draw a closed line through points of the world."""
        ring = self.screen(np.vstack([points, points[:1]]), 2)
        self.plotter.add_mesh(
            self._pv.lines_from_points(ring),
            color=self.style.outline,
            line_width=self.style.outline_width,
            lighting=False,
        )

    def needle(self, tip: Vector, radius: float, length: float) -> None:
        """Draw the needle with its tip at a point of the world; `length` of it is shown, m."""
        back, side = -self.axis.direction, 0.5 * radius * self.axis.laterals[0]
        neck = tip + 1.6 * radius * back
        end = tip + length * back
        self._polygon(
            np.array([tip, neck + side, end + side, end - side, neck - side]), self.style.needle, 3
        )

    def seed(self, point: Vector, size: float) -> None:
        """Draw a seed as a square, `size` m wide."""
        corners = point + 0.5 * size * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        self._polygon(point + 1.35 * (corners - point), "white", 5)
        self._polygon(corners, self.style.seed, 6)

    def target(self, point: Vector, size: float) -> None:
        """Draw the target as an upright cross, `size` m wide."""
        square = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        for colour, rim, layer in (("white", 0.05, 7), (self.style.target, 0.0, 8)):
            for arm in (np.array([0.5, 0.07]), np.array([0.07, 0.5])):
                self._polygon(point + size * (arm + rim) * square, colour, layer)

    def line(self, begin: Vector, end: Vector, width: float) -> None:
        """Draw a line in the target's colour, `width` pixels wide."""
        at = self.screen(np.array([begin, end]), 9)
        self.plotter.add_mesh(
            self._pv.lines_from_points(at),
            color=self.style.target,
            line_width=width,
            lighting=False,
        )

    def look(self, window: Window) -> None:
        """Point the camera straight at a part of the plane."""
        camera = self.plotter.camera
        camera.parallel_projection = True
        x, y = window.centre
        camera.focal_point, camera.position, camera.up = (x, y, 0.0), (x, y, 1.0), (0.0, 1.0, 0.0)
        wide, high = self.plotter.renderer.GetSize()
        camera.parallel_scale = 0.5 * max(window.height, window.width * high / wide)
        self.plotter.renderer.ResetCameraClippingRange()

    def scale_bar(self, window: Window, length: float, label: str) -> None:
        """Draw a bar of a length (m) in the lower left corner."""
        left = window.centre + np.array([-0.46 * window.width, -0.44 * window.height])
        thick = 0.008 * window.height
        corners = left + np.array([[0, 0], [length, 0], [length, thick], [0, thick]])
        at = np.column_stack([corners, np.full(4, 9e-3)])
        self.plotter.add_mesh(
            self._pv.PolyData(at, faces=[4, 0, 1, 2, 3]), color=self.style.text, lighting=False
        )
        self._label(np.array([left[0] + 0.5 * length, left[1] + 2.5 * thick]), label)

    def _label(self, at: Floats, text: str, align: str = "center") -> None:
        """Put a text over a point of the screen's plane."""
        point = np.array([[at[0], at[1], 1.2e-2]])
        self.plotter.add_point_labels(
            point, [text], font_size=self.style.font_size, text_color=self.style.text,
            shape=None, show_points=False, always_visible=True,
            justification_horizontal=align, justification_vertical="bottom",
        )  # fmt: skip

    def title(self, window: Window, text: str) -> None:
        """Write a line on a band of its own along the window's upper edge."""
        wide, high = self.plotter.renderer.GetSize()
        height = 2.0 * self.plotter.camera.parallel_scale
        half = 0.5 * height * wide / high
        band = 1.9 * self.style.font_size * height / high
        top = window.centre[1] + 0.5 * height
        left, right = window.centre[0] - half, window.centre[0] + half
        corners = np.array([[left, top - band], [right, top - band], [right, top], [left, top]])
        at = np.column_stack([corners, np.full(4, 9.5e-3)])
        self.plotter.add_mesh(
            self._pv.PolyData(at, faces=[4, 0, 1, 2, 3]),
            color=self.style.background,
            lighting=False,
        )
        middle = np.array([left + 0.4 * band, top - 0.75 * band])
        self._label(middle, text, align="left")


def line_chart(plotter: Any, title: str, x: str, y: str) -> Any:
    """Return an empty chart that fills a plotter's active panel."""
    chart = renderer().Chart2D()
    chart.title = title
    chart.x_label, chart.y_label = x, y
    for axis in (chart.x_axis, chart.y_axis):
        axis.label_size, axis.tick_label_size = 26, 22
    chart.GetTitleProperties().SetFontSize(28)
    chart.GetLegend().SetLabelSize(22)
    plotter.add_chart(chart)
    return chart
