"""The scene before anything is computed: regions, supports, needle, entry, target, names."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from needlefem._arrays import Floats, Points, Vector
from needlefem.insertion.simulation import Simulation
from needlefem.needle.insertion_axis import InsertionAxis
from needlefem.plotting.backend import renderer
from needlefem.plotting.body import Body
from needlefem.plotting.canvas import Canvas
from needlefem.plotting.images import save
from needlefem.plotting.panel import Panel, Window
from needlefem.plotting.style import Style
from needlefem.scene import Scene

TEETH = 28
"""Strokes of a support's hatching along the longer side of the tissue."""


def draw_setup(
    scene: Scene,
    path: str | Path,
    *,
    size: tuple[int, int] = (1280, 900),
    style: Style | None = None,
) -> Path:
    """Draw a scene as it is built: mesh, regions, supports, needle line, entry, target, names.

    Nothing is simulated.

    Raises
    ------
    CaseError
        The scene can't be built.
    NoRendererError
        Nothing here can draw.
    """
    simulation, style = Simulation(scene), style or Style()
    entry = simulation.entry_of_case()
    axis = InsertionAxis(entry.point, simulation.direction)
    plotter = renderer().Plotter(off_screen=True, window_size=list(size), border=False)
    plotter.set_background(style.background)
    drawing = _Setup(plotter, simulation, axis, style)
    drawing.draw()
    return save(plotter, Path(path))


class _Setup:
    def __init__(
        self, plotter: Any, simulation: Simulation, axis: InsertionAxis, style: Style
    ) -> None:
        self.simulation, self.axis, self.style = simulation, axis, style
        self.scene, self.mesh = simulation.scene, simulation.model.mesh
        self.canvas = Canvas(plotter, axis, style)
        self.panel = Panel(plotter, style, lines=2, legend=self._legend())
        at = self.canvas.screen(self.mesh.p.T)[:, :2]
        self.low, self.high = at.min(axis=0), at.max(axis=0)
        self.span = float((self.high - self.low).max())

    def draw(self) -> None:
        canvas = self.canvas
        Body(canvas, self.simulation.model).draw_regions()
        for region in self.scene.regions.values():
            canvas.contour(region.contour.points)
        for obstacle in self.scene.obstacles.values():
            canvas.obstacle(obstacle.contour.points)
        room = 0.07 * self.span
        ends = np.array([self.low - room, self.high + room + np.array([0.25 * self.span, 0.0])])
        self.panel.look(Window.around(ends, 0.02))
        self._supports()
        self._needle()
        self.panel.line(self.scene.title, 0)
        numbers, model = self.scene.discretisation, self.simulation.model
        self.panel.line(
            f"{self.mesh.nelements} cells of {numbers.element}, {model.ndofs} unknowns; "
            f"axes {', '.join(self.scene.axes)}",
            1,
        )

    def _supports(self) -> None:
        """Hatch what is held, outside the tissue; what is held along one axis only is named."""
        spacing = self.span / TEETH
        middle = 0.5 * (self.low + self.high)
        for support in self.scene.supports.values():
            for face in support.faces:
                facets = self.mesh.facets[:, self.mesh.boundaries[face]]
                self._hatch(self.mesh.p.T[facets.T], spacing, middle)

    def _hatch(self, ends: Points, spacing: float, middle: Floats) -> None:
        """Draw short oblique strokes along edges, ends of shape (n, 2, dim)."""
        begins, strokes = [], []
        for one, other in ends:
            a, b = self.canvas.screen(np.array([one, other]))[:, :2]
            count = max(round(float(np.linalg.norm(b - a)) / spacing), 1)
            begins += [a + (n + 0.5) / count * (b - a) for n in range(count)]
            normal = np.array([a[1] - b[1], b[0] - a[0]]) / np.linalg.norm(b - a)
            outward = normal * np.sign(normal @ (0.5 * (a + b) - middle))
            along = np.array([-outward[1], outward[0]])
            strokes += [0.7 * spacing * (outward + 0.6 * along)] * count
        begin, end = np.array(begins), np.array(begins) + np.array(strokes)
        layers = np.full((len(begin), 1), 1e-3)
        points = np.stack([np.hstack([begin, layers]), np.hstack([end, layers])], axis=1)
        lines = np.column_stack([np.full(len(begin), 2), np.arange(2 * len(begin)).reshape(-1, 2)])
        data = renderer().PolyData(points.reshape(-1, 3), lines=lines.ravel())
        self.canvas.add(data, color=self.style.support, line_width=2.0)

    def _needle(self) -> None:
        canvas, scene, axis = self.canvas, self.scene, self.axis
        radius = scene.needle.tip_radius
        ready = axis.tip_position(-0.02 * self.span)
        canvas.needle(ready, radius, 4.0 * self.span)
        dashes = np.linspace(0.0, scene.motion.max_depth, 2 * 20)
        for start, end in zip(dashes[::2], dashes[1::2], strict=True):
            canvas.polyline(
                np.stack([axis.tip_position(start), axis.tip_position(end)]),
                self.style.needle,
                2.0,
                3,
            )
        canvas.disc(axis.tip_position(0.0), 1.2 * radius, self.style.path)
        canvas.disc(axis.tip_position(scene.motion.max_depth), 1.0 * radius, self.style.needle)
        if scene.target is not None:
            canvas.target(np.array(scene.target), 2.0 * radius)

    def _legend(self) -> list[tuple[str, str]]:
        """Return names and numbers with the colours that they have in the picture."""
        scene, style = self.scene, self.style
        found = [(style.tissue[0], f"{scene.background} (background)")]
        covered = {obstacle.region for obstacle in scene.obstacles.values()}
        for number, (name, region) in enumerate(sorted(scene.regions.items()), start=1):
            colour = style.tissue[number % len(style.tissue)]
            text = name if name == region.material else f"{name}: {region.material}"
            if name not in covered:
                found.append((colour, text))
        for name, support in scene.supports.items():
            held = f" ({', '.join(support.fixed)})" if support.fixed else ""
            found.append((style.support, f"{name}: held{held}"))
        for name, obstacle in scene.obstacles.items():
            away = f"{100 * obstacle.clearance:.2f} cm"
            found.append((style.obstacle, f"{name}: keep {away} away"))
        found.append((style.path, f"entry {_centimetres(self.axis.entry)}"))
        if scene.target is not None:
            found.append((style.target, f"target {_centimetres(scene.target)}"))
        deepest = 100 * scene.motion.max_depth
        found.append((style.needle, f"needle, at most {deepest:.2f} cm deep"))
        return found


def _centimetres(point: Sequence[float] | Vector) -> str:
    return "(" + ", ".join(f"{100 * x:.2f}" for x in point) + ") cm"
