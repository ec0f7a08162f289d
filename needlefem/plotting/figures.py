"""Pictures of mode shapes, forces, stick and slip, scenes, and plans."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from scipy.interpolate import PchipInterpolator

from needlefem._arrays import Bools, Floats, Points, Vector
from needlefem.fem.tissue_model import TissueModel
from needlefem.insertion.cut_path import TipTrajectory as CutPath
from needlefem.insertion.result import Insertion
from needlefem.insertion.simulation import Simulation
from needlefem.insertion.state import TipPhase
from needlefem.needle.needle_interface import InsertionAxis
from needlefem.planning.planner import Planner
from needlefem.planning.reading import InsertionReader, ended_early
from needlefem.planning.result import Plan
from needlefem.plotting.canvas import Canvas
from needlefem.plotting.charts import Axis, Chart
from needlefem.plotting.images import Plotter, Style, renderer, save
from needlefem.plotting.panel import Panel, Window
from needlefem.plotting.stages import draw_stages
from needlefem.plotting.view import Body
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


# Pictures of a motion: forces against depth, stick and slip against time.


STICK_COLOURS = ("#0072B2", "#8C8C8C", "#D55E00")
"""Colours of backward slip, stick, and forward slip."""


def draw_forces(insertion: Insertion, path: Path) -> Path:
    """Draw the force on the needle, and the force on its tip, against depth."""
    style, states = Style(), insertion.states
    depths = 100.0 * insertion.depths
    unit = "N" if insertion.model.dim == 3 else "N/m"
    plotter = renderer().Plotter(off_screen=True, window_size=[1600, 1000])
    plotter.set_background(style.background)
    whole = np.array([state.force for state in states])
    tip = np.array([state.tip_force for state in states])
    chart = Chart(
        plotter, style, title="Force on the needle", x=Axis.over("depth (cm)", depths),
        y=Axis.over(f"force ({unit})", np.concatenate([whole, tip, [0.0]])),
        legend=((style.seed, "tip and shaft"), (style.target, "tip")),
    )  # fmt: skip
    chart.curve(depths, whole, style.seed, 5.0)
    chart.curve(depths, tip, style.target, 3.0)
    return save(plotter, path)


def draw_sticking(insertion: Insertion, path: Path) -> Path:
    """Draw which segments of the cut path stick or slip, against time."""
    style = Style()
    times, places, ways = _stick_map(insertion)
    places = 100.0 * places
    plotter = renderer().Plotter(off_screen=True, window_size=[1600, 1000])
    plotter.set_background(style.background)
    names = ("slips backward", "sticks", "slips forward")
    chart = Chart(
        plotter, style, title="Stick and slip along the shaft",
        x=Axis(label="time (s)", low=0.0, high=1.02 * float(times[-1]) or 1.0),
        y=Axis(label="length of the cut path (cm)", low=0.0, high=1.04 * float(places[-1]) or 1.0),
        legend=tuple(zip(STICK_COLOURS, names, strict=True)),
    )  # fmt: skip
    step, place = np.nonzero(ways < 2.0)
    if step.size:
        ends = times[step], times[step + 1], places[place], places[place + 1]
        palette = np.array([chart.colour(colour) for colour in STICK_COLOURS])
        chart.blocks(np.stack(ends, axis=1), palette[ways[step, place].astype(np.intp) + 1])
    return save(plotter, path)


def _stick_map(insertion: Insertion) -> tuple[Floats, Floats, Floats]:
    """Return times, positions along the path (m), and directions of slip; 9 is no contact."""
    states = [state for state in insertion.states if state.tip_phase is not TipPhase.RUPTURE]
    stiffness = insertion.instrument.lateral_penalty
    lengths = [1.0 / (p.compliance * stiffness) for p in insertion.segments[1:]]
    last = max((s.inserted_length for s in states), default=0.0)
    places = np.concatenate([[0.0], np.cumsum(lengths)])
    places = np.append(places, last) if last > places[-1] * (1.0 + 1e-9) else places
    times = np.array([state.time for state in states])
    keep = np.concatenate([[True], np.diff(times) > 0.0])
    ways = np.full((int(keep.sum()) - 1, len(places) - 1), 9.0)
    for row, state in enumerate(np.array(states, dtype=object)[keep][1:]):
        slipping = np.ones(len(state.friction_force)) if state.slipping is None else state.slipping
        filled = slipping[1 : ways.shape[1] + 1]
        ways[row, : len(filled)] = filled
    return times[keep], places, ways


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
        found = [(style.tissue[0], f"{scene.default_material} (background)")]
        covered = {obstacle.region for obstacle in scene.obstacles.values()}
        for number, (name, region) in enumerate(sorted(scene.regions.items()), start=1):
            colour = style.tissue[number % len(style.tissue)]
            text = name if name == region.material else f"{name}: {region.material}"
            if name not in covered:
                found.append((colour, text))
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


CURVE_POINTS = 200
HEIGHTS = 9
"""Insertions for the picture of the offset, the part of a plan's pictures with the highest cost."""


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


def draw_depth(planner: Planner, plan: Plan, path: Path) -> Path:
    """Draw the placement error against depth at the lateral offset of the target (Fig. 5).

    The curve is bold where the seed comes to rest inside of the target's region.
    """
    style, simulation = Style(), planner.simulation
    scene, insertion = simulation.scene, simulation.insert(planner.entry)
    title = "Placement error at the lateral offset of the target"
    if ended_early(insertion):
        title += f"; unknown beyond {100.0 * insertion.depths[-1]:.2f} cm"
    cut = CutPath(insertion)
    depths = np.linspace(0.0, min(scene.motion.max_depth, insertion.depths[-1]), CURVE_POINTS)
    reached = [cut.at_depth(float(depth)) for depth in depths]
    points = np.array(
        [np.full(len(plan.target), np.nan) if r is None else r.point for r in reached]
    )
    error = 100.0 * np.linalg.norm(points - plan.target, axis=1)
    lines = [(style.seed, "a seed released at this depth")]
    inside = _inside_target_region(scene, plan.target, points)
    if inside.any():
        lines[0] = (style.seed, lines[0][1] + "; bold: at rest in the region of the target")
    if plan.depth_only is not None:
        at = 100.0 * float(insertion.axis.axial_coordinate(plan.depth_only.release_point))
        least = 100.0 * plan.depth_only.placement_error
        lines.append((style.target, f"best depth {at:.2f} cm: error {least:.2g} cm"))
    plotter = renderer().Plotter(off_screen=True, window_size=[1600, 1000])
    plotter.set_background(style.background)
    depths = 100.0 * depths
    chart = Chart(
        plotter, style, title=title, legend=lines,
        x=Axis(label="insertion depth (cm)", low=0.0, high=1.02 * float(depths[-1])),
        y=Axis(label="placement error (cm)", low=0.0, high=1.05 * float(np.nanmax(error))),
    )  # fmt: skip
    chart.curve(depths, error, style.seed, 3.0)
    chart.curve(depths, np.where(inside, error, np.nan), style.seed, 9.0)
    if plan.depth_only is not None:
        chart.marks(np.array([at]), np.array([least]), style.target, 20.0)
    return save(plotter, path)


def _inside_target_region(scene: Scene, target: Vector, points: Floats) -> Bools:
    for region in scene.regions.values():
        if region.contour.contains(target[None])[0]:
            return region.contour.contains(points)
    return np.isfinite(points[:, 0])


def draw_height(
    planner: Planner, plan: Plan, path: Path, heights: tuple[float, float] | None = None
) -> Path:
    """Draw best depth and placement error against the insertion height (Fig. 6).

    `heights` (m, relative to the target) are the limits of the picture; the case's range by
    default. Depth and signed lateral error are interpolated between insertions, shown as dots.
    """
    style, dots = Style(), 100.0 * _height_table(planner, plan, heights)
    at = np.linspace(dots[0, 0], dots[-1, 0], CURVE_POINTS)
    at = np.union1d(at, dots[:, 0])
    between = np.full((len(at), 2), np.nan)
    if len(dots) > 1:
        between = PchipInterpolator(dots[:, 0], dots[:, 1:])(at)
    plotter = renderer().Plotter(
        off_screen=True, shape=(2, 1), window_size=[1600, 1700], border=False
    )
    plotter.set_background(style.background)
    assert plan.best is not None
    height = 100.0 * float(plan.best.release_point @ plan.insertion.axis.lateral_directions[0])
    best = dots[np.argmin(np.abs(dots[:, 0] - height))]
    label = f"plan: height {best[0]:.2f} cm, depth {best[1]:.2f} cm"
    for number, quantity in enumerate(("best depth (cm)", "placement error (cm)"), start=1):
        plotter.subplot(number - 1, 0)
        curve, values = np.abs(between[:, number - 1]), np.abs(dots[:, number])
        chart = Chart(
            plotter, style, x=Axis.over("insertion height (cm)", at),
            y=Axis.over(quantity, np.append(curve, values)),
            legend=((style.seed, "dots: insertions; interpolated between them"),
                    (style.target, label)),
        )  # fmt: skip
        chart.curve(at, curve, style.seed)
        chart.marks(dots[:, 0], values, style.seed)
        chart.marks(best[:1], np.abs(best[number : number + 1]), style.target, 20.0)
    return save(plotter, path)


def _height_table(planner: Planner, plan: Plan, within: tuple[float, float] | None) -> Floats:
    """Return rows of insertion height, best depth, signed lateral error, m, with the plan's."""
    low, high = within or planner.simulation.scene.planning.offset_range
    known = {0.0: plan.level, float(plan.solution.height[0]): plan.insertion}
    rows = []
    for height in np.union1d(np.linspace(low, high, HEIGHTS), list(known)).tolist():
        insertion = known.get(height)
        row = _closest(insertion or planner.insertion(np.array([height])), plan.target)
        if row is not None:
            rows.append(row)
    return np.array(rows)


def _closest(insertion: Insertion, target: Vector) -> tuple[float, float, float] | None:
    """Return height, depth and signed lateral error of the release closest to a target, m.

    The result is None if the insertion ended early or the skin is not cut.
    """
    reach, lateral = (
        InsertionReader(insertion, target).nearest().reach,
        insertion.axis.lateral_directions[0],
    )
    if reach is None:
        return None
    apart = reach.point - target
    miss = float(np.copysign(np.linalg.norm(apart), apart @ lateral))
    return float(insertion.axis.entry @ lateral), reach.depth, miss
