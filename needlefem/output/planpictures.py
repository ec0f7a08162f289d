"""The pictures of a plan: its stages, error against depth, depth and error against height."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from needlefem.arrays import Bools, Floats, Vector
from needlefem.insertion.path import Path as CutPath
from needlefem.insertion.simulation import Simulation
from needlefem.output.charts import line_chart
from needlefem.output.driver import renderer
from needlefem.output.images import save
from needlefem.output.stages import draw_stages
from needlefem.output.style import Style
from needlefem.planning.planner import Planner
from needlefem.planning.result import Plan
from needlefem.scene import Scene

CURVE_POINTS = 200
HEIGHTS = 25
HEIGHT_SPAN = 6e-3
"""Range of heights in the height picture, m: that of the paper's Fig. 6."""


def draw_plan(scene: Scene, plan: Plan, folder: Path) -> list[Path]:
    """Draw the pictures that the scene asks for; return their files."""
    painters: dict[str, Callable[[Scene, Plan, Path], Path]] = {
        "stages": draw_stages,
        "depth": draw_depth,
        "height": draw_height,
    }
    wanted = [name for name in scene.outputs.pictures if plan.best is not None]
    return [painters[name](scene, plan, folder / f"{name}.png") for name in wanted]


def draw_depth(scene: Scene, plan: Plan, path: Path) -> Path:
    """Draw the error of a release at the target's height against its depth (Fig. 5).

    The bold part lies inside the region of the target.
    """
    style = Style()
    simulation = Simulation(scene)
    insertion = simulation.insert(simulation.entry_through(plan.target))
    cut = CutPath(insertion)
    depths = np.linspace(0.0, min(scene.motion.max_depth, insertion.depths[-1]), CURVE_POINTS)
    reached = [cut.at_depth(float(depth)) for depth in depths]
    points = np.array([np.full(2, np.nan) if r is None else r.point for r in reached])
    error = 100.0 * np.linalg.norm(points - plan.target, axis=1)
    plotter = renderer().Plotter(off_screen=True, window_size=[1600, 1000])
    plotter.set_background(style.background)
    title = "Error of a release at the target's height"
    chart = line_chart(plotter, title, "insertion depth (cm)", "placement error (cm)")
    chart.line(100.0 * depths, error, color=style.seed, width=2.0, label="any depth")
    inside = _inside_target_region(scene, plan.target, points)
    bold, at_rest = error[inside], "the seed rests in the target's region"
    if bold.size:
        chart.line(100.0 * depths[inside], bold, color=style.seed, width=7.0, label=at_rest)
    if plan.depth_only is not None:
        at = 100.0 * float(insertion.axis.along(plan.depth_only.release_point))
        least = 100.0 * plan.depth_only.placement_error
        label = f"best depth {at:.2f} cm: {least:.2f} cm"
        chart.scatter([at], [least], color=style.target, size=16, label=label)
    chart.y_range = [0.0, 1.05 * float(np.nanmax(error))]
    return save(plotter, path)


def _inside_target_region(scene: Scene, target: Vector, points: Floats) -> Bools:
    for region in scene.regions.values():
        if region.contour.contains(target[None])[0]:
            return region.contour.contains(points)
    return np.isfinite(points[:, 0])


def draw_height(scene: Scene, plan: Plan, path: Path) -> Path:
    """Draw best depth and its error against the insertion height (Fig. 6)."""
    style = Style()
    table = 100.0 * _height_table(scene, plan)
    plotter = renderer().Plotter(
        off_screen=True, shape=(2, 1), window_size=[1600, 1700], border=False
    )
    plotter.set_background(style.background)
    assert plan.best is not None
    height = 100.0 * float(plan.best.release_point @ plan.insertion.axis.laterals[0])
    best = table[np.argmin(np.abs(table[:, 0] - height))]
    label = f"plan: height {best[0]:.2f} cm, depth {best[1]:.2f} cm"
    for number, quantity in enumerate(("best depth (cm)", "placement error (cm)"), start=1):
        plotter.subplot(number - 1, 0)
        values = table[:, number]
        chart = line_chart(plotter, "", "insertion height (cm)", quantity)
        chart.line(table[:, 0], values, color=style.seed, width=3.0, label=quantity[:-5])
        chart.scatter([best[0]], [best[number]], color=style.target, size=16, label=label)
        room = 0.2 * float(np.ptp(values))  # for the legend
        chart.y_range = [float(values.min()) - 0.1 * room, float(values.max()) + room]
    return save(plotter, path)


def _height_table(scene: Scene, plan: Plan) -> Floats:
    """Return rows of insertion height, best depth, placement error, m; the plan's among them."""
    planner = Planner(Simulation(scene), plan.target)
    heights = np.linspace(-0.5 * HEIGHT_SPAN, 0.5 * HEIGHT_SPAN, HEIGHTS)
    rows = []
    for height in np.sort(np.append(heights, plan.solution.height[0])):
        offset = np.array([height])
        release = planner.release(offset, planner.path(offset).closest(plan.target))
        if release is not None:
            at = float(release.release_point @ planner.laterals[0])
            depth = float(
                (release.release_point - planner.entry.point) @ planner.simulation.direction
            )
            rows.append((at, depth, release.placement_error))
    return np.array(rows)
