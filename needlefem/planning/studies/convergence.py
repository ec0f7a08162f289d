"""The plan under refinement along the path and at the contours.

Path spacing and kernel quadrature stay fixed; the quadrature is fine enough for the finest mesh.
A tip with a radius converges; a point tip drifts, because the displacement under a point force
is unbounded.
"""

import numpy as np

from needlefem.planning.studies.common import plan_or_reason
from needlefem.scene import Scene, vary
from needlefem.table import Table

LEVELS = 4
KERNEL_POINTS = 800
LAST_MOVE, LAST_SHARE = 5e-5, 1.0 / 3.0
"""Bounds of the last move: in m, and as a share of the first."""


def study(scene: Scene, other: Scene | None = None) -> list[Table]:
    """Return a table for the disc and one for the point tip."""
    del other
    return [refinement(scene, "disc"), refinement(scene, "point")]


def refinement(scene: Scene, tip: str, levels: int = LEVELS) -> Table:
    """Plan on meshes with elements of one tip radius, a half, a quarter, ... along the path."""
    rows: list[list[object]] = []
    points: list[np.ndarray] = []
    for level in range(levels):
        size = scene.needle.tip_radius / 2**level
        changes = {
            "mesh.refine.corridor_size": size,
            "mesh.refine.contour_size": size,
            "needle.tip": tip,
            "discretisation.kernel_points": KERNEL_POINTS,
        }
        plan, status = plan_or_reason(vary(scene, changes))
        if plan is None or plan.best is None:
            rows.append([1e3 * size, 0, "", "", "", status])
            continue
        points.append(plan.best.release_point)
        move = float(np.linalg.norm(points[-1] - points[-2])) if len(points) > 1 else np.nan
        dofs = plan.insertion.model.ndofs
        height, depth = (100.0 * points[-1]).tolist()
        rows.append([1e3 * size, dofs, height, depth, 100.0 * move, status])
    moves = np.linalg.norm(np.diff(points, axis=0), axis=1)
    converges = len(moves) == levels - 1 and bool(
        moves[-1] <= LAST_MOVE and moves[-1] <= LAST_SHARE * moves[0]
    )
    return Table(
        title=f"planned release point under refinement, {tip} tip",
        columns=(
            "elements (mm)",
            "dofs",
            *(f"{a} (cm)" for a in scene.axes),
            "move (cm)",
            "status",
        ),
        rows=rows,
        passed=converges or tip == "point",
        note="" if tip == "disc" else "a point tip is not expected to converge",
    )
