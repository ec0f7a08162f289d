"""Pictures of mode shapes, scenes before the simulation, and the stages of a plan."""

import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from needlefem._arrays import Floats, Points, Vector
from needlefem.fem.tissue_model import TissueModel
from needlefem.insertion.result import Insertion
from needlefem.insertion.simulation import Simulation
from needlefem.mesh.generation import BACKGROUND
from needlefem.needle.needle_interface import InsertionAxis
from needlefem.planning.planner import Planner
from needlefem.planning.result import Plan, PlanStatus, Release, headline
from needlefem.plotting.canvas import Canvas
from needlefem.plotting.charts import draw_depth, draw_height
from needlefem.plotting.images import Plotter, Style, renderer, save
from needlefem.plotting.panel import Panel, Window, rulers, synthetic_ultrasound
from needlefem.plotting.timeline import Frame, Timeline
from needlefem.plotting.view import Body, TissueView, ViewOptions, region_colours
from needlefem.scene import Scene

ACROSS = 3
"""Panels in a row."""
SWING = 0.06
"""Largest displacement in a picture of a mode, relative to the size of the tissue."""


def draw_modes(
    scene: Scene, model: TissueModel, frequencies: Floats, shapes: Sequence[Points], path: Path
) -> Path:
    """Draw vibration modes, one per panel, with their frequencies (Hz).

    `shapes` are nodal fields, shape (nnodes, dim). They are scaled to a visible amplitude.

    Raises
    ------
    NoRendererError
        No renderer is available.
    """
    pv = renderer()
    style = Style()
    across = min(ACROSS, len(shapes))
    down = -(-len(shapes) // across)
    plotter = pv.Plotter(
        off_screen=True, shape=(down, across), window_size=[560 * across, 600 * down], border=False
    )
    plotter.set_background(style.background)
    axis = InsertionAxis(model.nodes[0], np.array(scene.motion.direction))
    size = float(np.ptp(model.nodes, axis=0).max())
    for number, (hertz, shape) in enumerate(zip(frequencies, shapes, strict=True)):
        plotter.subplot(number // across, number % across)
        canvas = Canvas(plotter, axis, style)
        largest = float(np.linalg.norm(shape, axis=1).max())
        field = model.dof_vector(SWING * size / largest * shape)
        body = Body(canvas, model)
        body.draw_regions()
        body.to(field)
        for region in scene.regions.values():
            points = region.contour.points
            canvas.contour(points + model.displacement_at(field, points))
        panel = Panel(plotter, style)
        # the same window for all modes, with room for the largest displacement
        panel.look(Window.around(canvas.screen(model.mesh.p.T), 0.02 + 1.5 * SWING))
        panel.line(f"mode {number + 1}: {hertz:.3g} Hz")
    return save(plotter, path)


# A scene before the simulation: regions, supports, needle, entry, target, names.


TEETH = 28
"""Number of hatching strokes along the longer side of the tissue."""


def draw_setup(
    scene: Scene,
    path: str | Path,
    *,
    size: tuple[int, int] = (1280, 900),
    style: Style | None = None,
) -> Path:
    """Draw a scene: mesh, regions, supports, insertion axis, entry, target, and their names.

    No insertion is simulated.

    Raises
    ------
    CaseError
        The scene is not valid.
    NoRendererError
        No renderer is available.
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
        self, plotter: Plotter, simulation: Simulation, axis: InsertionAxis, style: Style
    ) -> None:
        self.simulation, self.axis, self.style = simulation, axis, style
        self.scene, self.mesh = simulation.scene, simulation.model.mesh
        self.canvas = Canvas(plotter, axis, style)
        ruled = rulers(self.canvas, self.scene.axes)
        self.panel = Panel(plotter, style, lines=2, legend=self._legend(), ruled=ruled)
        at = self.canvas.screen(self.mesh.p.T)[:, :2]
        self.low, self.high = at.min(axis=0), at.max(axis=0)
        self.span = float((self.high - self.low).max())

    def draw(self) -> None:
        canvas = self.canvas
        Body(canvas, self.simulation.model).draw_regions()
        for region in self.scene.regions.values():
            canvas.contour(region.contour.points)
        for obstacle in self.scene.obstacles.values():
            canvas.obstacle(obstacle)
        room = 0.07 * self.span
        behind = canvas.screen(self.axis.tip_position(-0.3 * self.span))[0, :2]
        ends = np.array([self.low - room, self.high + room, behind])
        self.panel.look(Window.around(ends, 0.02))
        self._supports()
        self._needle()
        self.panel.line(self.scene.title, 0)
        numbers, model = self.scene.discretization, self.simulation.model
        self.panel.line(
            f"{self.mesh.nelements} cells of {numbers.element}, {model.ndofs} unknowns; "
            f"axes {', '.join(self.scene.axes)}",
            1,
        )

    def _supports(self) -> None:
        """Hatch supported faces on their outside."""
        spacing = self.span / TEETH
        middle = 0.5 * (self.low + self.high)
        named = self.mesh.boundaries or {}
        for support in self.scene.supports.values():
            for face in support.faces:
                facets = self.mesh.facets[:, named[face]]
                self._hatch(self.mesh.p.T[facets.T], spacing, middle)

    def _hatch(self, ends: Points, spacing: float, middle: Floats) -> None:
        """Draw short oblique strokes along edges, whose ends have the shape (n, 2, dim)."""
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
        """Return the legend: colours with names and numbers."""
        scene, style = self.scene, self.style
        colours = region_colours(self.simulation.model, style)
        found = [(colours[BACKGROUND], f"{scene.default_material} (background)")]
        covered = {obstacle.region for obstacle in scene.obstacles.values()}
        for name, region in scene.regions.items():
            text = name if name == region.material else f"{name}: {region.material}"
            if name not in covered:
                found.append((colours[name], text))
        for name, support in scene.supports.items():
            axes = f" ({', '.join(support.fixed)})" if support.fixed else ""
            found.append((style.support, f"{name}: fixed{axes}"))
        for name, obstacle in scene.obstacles.items():
            away = f"{100 * obstacle.clearance:.2f} cm"
            found.append((style.obstacle, f"{name}: clearance {away}"))
        found.append((style.path, f"entry {_centimetres(self.axis.entry)}"))
        if scene.target is not None:
            found.append((style.target, f"target {_centimetres(scene.target)}"))
        deepest = 100 * scene.motion.max_depth
        found.append((style.needle, f"needle, at most {deepest:.2f} cm deep"))
        return found


def _centimetres(point: Sequence[float] | Vector) -> str:
    return "(" + ", ".join(f"{100 * x:.2f}" for x in point) + ") cm"


# Pictures of a plan: stages, error against depth, best depth and error against lateral offset.


def draw_plan(scene: Scene, plan: Plan, folder: Path) -> list[Path]:
    """Draw the pictures that the scene requests; return their files."""
    planner = planner_of(scene, plan)
    painters: dict[str, Callable[[Path], Path]] = {
        "stages": lambda path: draw_stages(scene, plan, path),
        "depth": lambda path: draw_depth(planner, plan, path),
        "height": lambda path: draw_height(planner, plan, path),
    }
    wanted = [name for name in scene.outputs.pictures if plan.best is not None]
    return [painters[name](folder / f"{name}.png") for name in wanted]


def planner_of(scene: Scene, plan: Plan) -> Planner:
    """Return a planner for further insertions that reuses the plan's tissue and factorisation."""
    return Planner(Simulation(scene, model=plan.level.model), plan.target)


# Stages of a plan: before the insertion, release, retracted needle, placement error.


SIZE = (1600, 2360)


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class _Column:
    """One column of the picture: an insertion, its release, and the view options."""

    title: str
    film: Timeline
    release: Release
    target: Vector
    look: ViewOptions
    error: str

    @property
    def insertion(self) -> Insertion:
        return self.film.insertion

    @property
    def depth(self) -> float:
        return float(self.insertion.axis.axial_coordinate(self.release.release_point))


def draw_stages(scene: Scene, plan: Plan, path: Path, *, ultrasound: bool = False) -> Path:
    """Draw insertion, release and placement, unplanned (left) and planned (right).

    If the result without a plan is unknown, only the right column is drawn. The rows are: before
    the insertion, seed released, needle retracted, placement error, as in Fig. 1 of the paper of
    2003. With `ultrasound` an image is mapped on the tissue and deforms with it.
    """
    if plan.best is None:
        raise ValueError("a plan without a release has no stages to draw")
    style = Style()
    look = ViewOptions(style=style)
    if ultrasound:
        level = plan.level
        texture = synthetic_ultrasound(scene, level.model, level.axis)
        look = ViewOptions(style=style, texture=texture)
    columns = _columns(plan, look)
    size = [SIZE[0] * len(columns) // 2, SIZE[1]]
    plotter = renderer().Plotter(
        off_screen=True, shape=(4, len(columns)), window_size=size, border=False
    )
    plotter.set_background(style.background)
    for across, column in enumerate(columns):
        for down, stage in enumerate((_before, _released, _retracted, _error)):
            plotter.subplot(down, across)
            canvas = Canvas(plotter, column.insertion.axis, style)
            stage(canvas, Panel(plotter, style), column, scene.needle.tip_radius)
    return save(plotter, path)


def _columns(plan: Plan, look: ViewOptions) -> list[_Column]:
    """Return the columns: the unplanned insertion, if it is known, and the planned one."""
    first, found = headline(plan), []
    if plan.unplanned is not None:
        found.append(
            _Column(
                title="unplanned", film=Timeline(plan.level), release=plan.unplanned,
                target=plan.target, look=look,
                error=f"placement error {100.0 * plan.unplanned.placement_error:.2f} cm",
            )
        )  # fmt: skip
    if plan.best is not None:
        error = first.title
        if plan.status is not PlanStatus.PLANNED:
            error = f"{plan.status}: placement error {100.0 * plan.best.placement_error:.2g} cm"
        found.append(
            _Column(
                title="planned", film=Timeline(plan.insertion), release=plan.best,
                target=plan.target, look=look, error=error,
            )
        )  # fmt: skip
    return found


def _tissue(canvas: Canvas, panel: Panel, column: _Column, moment: Frame) -> None:
    TissueView(canvas, column.film, column.look).show(moment)
    if column.look.note:
        panel.note(column.look.note)


def _window(canvas: Canvas, column: _Column) -> Window:
    """Return a window from outside of the skin to behind the target."""
    depth = float(column.insertion.axis.axial_coordinate(column.target))
    width = depth + 0.037
    middle = column.target - 0.5 * depth * column.insertion.axis.direction
    centre = canvas.screen(middle)[0, :2] + np.array([-0.0065, 0.0095])
    return Window(centre, width, 0.56 * width)


def _finish(canvas: Canvas, panel: Panel, column: _Column, title: str) -> None:
    panel.look(_window(canvas, column))
    panel.line(title)


def _before(canvas: Canvas, panel: Panel, column: _Column, radius: float) -> None:
    _tissue(canvas, panel, column, column.film.undeformed())
    canvas.needle(column.insertion.axis.tip_position(0.0), radius, 0.05)
    canvas.target(column.target, 2.0 * radius)
    _finish(canvas, panel, column, f"{column.title}: before insertion")


def _released(canvas: Canvas, panel: Panel, column: _Column, radius: float) -> None:
    film = column.film
    _tissue(canvas, panel, column, film.moments([film.time_at(column.depth)])[0])
    canvas.needle(column.release.release_point, radius, column.depth + 0.05)
    canvas.target(column.target, 2.0 * radius)
    canvas.seed(column.release.release_point, 1.5 * radius)
    where = ", ".join(f"{100 * x:.2f}" for x in column.release.release_point)
    depth = f"depth {100 * column.depth:.2f} cm"
    _finish(canvas, panel, column, f"seed released at ({where}) cm, {depth}")


def _retracted(canvas: Canvas, panel: Panel, column: _Column, radius: float) -> None:
    _tissue(canvas, panel, column, column.film.undeformed())
    canvas.target(column.target, 2.0 * radius)
    canvas.seed(column.release.placed_at, 1.5 * radius)
    where = ", ".join(f"{100 * x:.2f}" for x in column.release.placed_at)
    _finish(canvas, panel, column, f"needle retracted, final position of the seed ({where}) cm")


def _error(canvas: Canvas, panel: Panel, column: _Column, radius: float) -> None:
    _tissue(canvas, panel, column, column.film.undeformed())
    canvas.target(column.target, 1.0 * radius)
    ends = np.stack([column.target, column.release.placed_at])
    canvas.polyline(ends, column.look.style.target, 5.0, 9)
    canvas.seed(column.release.placed_at, 0.75 * radius)
    middle = canvas.screen(column.target)[0, :2] + np.array([4e-3, 0.0])
    panel.look(Window(middle, 0.0245, 0.0137))
    panel.line(column.error)
