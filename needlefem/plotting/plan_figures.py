"""The pictures of a plan: its stages, error against depth, depth and error against height."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.interpolate import PchipInterpolator

from needlefem._arrays import Bools, Floats, Vector
from needlefem.insertion.result import Insertion
from needlefem.insertion.simulation import Simulation
from needlefem.insertion.trajectory import TipTrajectory as CutPath
from needlefem.planning.planner import Planner
from needlefem.planning.reading import InsertionReader, broke_off
from needlefem.planning.result import Plan
from needlefem.plotting.backend import renderer
from needlefem.plotting.charts import Axis, Chart
from needlefem.plotting.images import save
from needlefem.plotting.stages import draw_stages
from needlefem.plotting.style import Style
from needlefem.scene import Scene

CURVE_POINTS = 200
HEIGHTS = 9
"""Insertions behind the height picture, the most of what a plan's pictures cost."""


def draw_plan(scene: Scene, plan: Plan, folder: Path) -> list[Path]:
    """Draw the pictures that the scene asks for; return their files."""
    planner = planner_of(scene, plan)
    painters: dict[str, Callable[[Path], Path]] = {
        "stages": lambda path: draw_stages(scene, plan, path),
        "depth": lambda path: draw_depth(planner, plan, path),
        "height": lambda path: draw_height(planner, plan, path),
    }
    wanted = [name for name in scene.outputs.pictures if plan.best is not None]
    return [painters[name](folder / f"{name}.png") for name in wanted]


def planner_of(scene: Scene, plan: Plan) -> Planner:
    """Return a planner for further insertions on a plan's own tissue, factorised as it is."""
    return Planner(Simulation(scene, model=plan.level.model), plan.target)


def draw_depth(planner: Planner, plan: Plan, path: Path) -> Path:
    """Draw the error of a release at the target's height against its depth (Fig. 5).

    The bold part lies inside the region of the target.
    """
    style, simulation = Style(), planner.simulation
    scene, insertion = simulation.scene, simulation.insert(planner.entry)
    title = "Error of a release at the target's height"
    if broke_off(insertion):
        title += f"; not known beyond {100.0 * insertion.depths[-1]:.2f} cm"
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
        lines[0] = (style.seed, lines[0][1] + "; bold: it rests in the target's region")
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
    """Draw best depth and its error against the insertion height (Fig. 6).

    `heights` (m, relative to the target's) are the ends of what is shown, the case's range when
    left out. Between the insertions, which are dots, depth and signed miss are interpolated.
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
            legend=((style.seed, "dots: insertions; between them interpolated"),
                    (style.target, label)),
        )  # fmt: skip
        chart.curve(at, curve, style.seed)
        chart.marks(dots[:, 0], values, style.seed)
        chart.marks(best[:1], np.abs(best[number : number + 1]), style.target, 20.0)
    return save(plotter, path)


def _height_table(planner: Planner, plan: Plan, within: tuple[float, float] | None) -> Floats:
    """Return rows of insertion height, best depth, signed miss, m; the plan's among them."""
    low, high = within or planner.simulation.scene.planning.height_range
    known = {0.0: plan.level, float(plan.solution.height[0]): plan.insertion}
    rows = []
    for height in np.union1d(np.linspace(low, high, HEIGHTS), list(known)).tolist():
        insertion = known.get(height)
        row = _closest(insertion or planner.insertion(np.array([height])), plan.target)
        if row is not None:
            rows.append(row)
    return np.array(rows)


def _closest(insertion: Insertion, target: Vector) -> tuple[float, float, float] | None:
    """Return height, depth and signed miss of the release that comes nearest to a target, m.

    None where the insertion broke off, or the skin is not cut.
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
