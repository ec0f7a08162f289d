"""The plan under refinement along the path and at the contours.

Path spacing and kernel quadrature are fixed; the quadrature is sufficient for the finest mesh. The
plan converges for a tip with a radius. It does not converge for a point tip, because the
displacement under a point force is unbounded.
"""

import numpy as np

from needlefem._arrays import Vector
from needlefem._table import Table
from needlefem.planning.planner import planner_of
from needlefem.planning.result import PlanStatus
from needlefem.scene import Scene, one_contour_size, vary

LEVELS = 4
KERNEL_POINTS = 800
LAST_MOVE, LAST_SHARE = 5e-5, 1.0 / 3.0
"""Bounds of the last change of the release point: in m, and relative to the first change."""


def study(scene: Scene, other: Scene | None = None) -> list[Table]:
    """Return one table for the disc and one for the point tip."""
    del other
    return [refinement(scene, "disc"), refinement(scene, "point")]


def refinement(scene: Scene, tip: str, levels: int = LEVELS) -> Table:
    """Plan on meshes with elements of one tip radius, a half, a quarter, ... along the path."""
    rows: list[list[object]] = []
    points: list[Vector] = []
    for level in range(levels):
        size = scene.needle.tip_radius / 2**level
        changes = {
            "mesh.refine.corridor_size": size,
            **one_contour_size(scene, size),
            "needle.tip": tip,
            "discretization.tip_quadrature_points": KERNEL_POINTS,
        }
        plan = planner_of(vary(scene, changes)).plan()
        cut = plan.level.puncture_depth
        row: list[object] = [1e3 * size, plan.level.model.ndofs, _digits(cut)]
        if plan.status is PlanStatus.PLANNED and plan.best is not None:
            points.append(plan.best.release_point)
            move = f"{100.0 * _move(points):.1e}" if len(points) > 1 else ""
            row += [*map(_digits, points[-1]), move]
        else:
            row += [""] * (scene.dim + 1)
        rows.append([*row, plan.status])
    moves = np.linalg.norm(np.diff(points, axis=0), axis=1)
    converges = len(moves) == levels - 1 and bool(
        moves[-1] <= LAST_MOVE and moves[-1] <= LAST_SHARE * moves[0]
    )
    return Table(
        title=f"planned release point under refinement, {tip} tip",
        columns=(
            "elements (mm)",
            "dofs",
            "skin cut at (cm)",
            *(f"{axis} (cm)" for axis in scene.axes),
            "move (cm)",
            "status",
        ),
        rows=rows,
        passed=converges or tip == "point",
        note="" if tip == "disc" else "a point tip does not converge, and loses its equilibrium",
    )


def _move(points: list[Vector]) -> float:
    return float(np.linalg.norm(points[-1] - points[-2]))


def _digits(length: float | None) -> str:
    return "never" if length is None else f"{100.0 * float(length):.5f}"
