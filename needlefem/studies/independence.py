"""Influence of the numerical parameters on the plan.

A plan with the case's own parameters is carried out with others: mesh, path spacing, lateral
penalty, quadrature. For each of them the final position of the seed may change by 0.02 mm at most.
"""

import numpy as np

from needlefem._table import Table
from needlefem.planning.planner import carry_out, planner_of
from needlefem.scene import BoxMesh, Refinement, Scene, contour_sizes, vary
from needlefem.scene.resolve import resolve

BOUND = 2e-5
"""Largest change of the final position of the seed, m."""


def study(scene: Scene, other: Scene | None = None) -> list[Table]:
    """Return the change of the seed's final position for all variations."""
    del other
    plan = planner_of(scene).plan()
    rows = []
    for name, changes in variations(resolve(scene).scene).items():
        reach = carry_out(vary(scene, changes), plan)
        moved = np.inf if reach is None else float(np.linalg.norm(reach.point - plan.target))
        rows.append([name, 100.0 * moved, moved <= BOUND])
    return [
        Table(
            title="seed of the case's plan, simulated with other numerical parameters",
            columns=("varied", "seed moves (cm)", "at most 0.002 cm"),
            rows=rows,
            passed=all(row[2] for row in rows),
        )
    ]


def variations(scene: Scene) -> dict[str, dict[str, object]]:
    """Return the changes of a resolved scene by name."""
    spacing = scene.discretization.path_spacing
    penalty, points = scene.needle.lateral_penalty, scene.discretization.tip_quadrature_points
    found: dict[str, dict[str, object]] = {"nothing": {}}
    refine = scene.mesh.refine if isinstance(scene.mesh, BoxMesh) else Refinement()
    if refine.corridor_size > 0.0:
        found["elements x 1/2"] = {
            "mesh.refine.corridor_size": 0.5 * refine.corridor_size,
            **contour_sizes(scene, 0.5),
            "discretization.tip_quadrature_points": 4 * points,
        }
    for factor in (2.0, 0.5, 0.25):
        found[f"path spacing x {factor:g}"] = {"discretization.path_spacing": factor * spacing}
    for factor in (0.1, 10.0, 100.0):
        found[f"lateral penalty x {factor:g}"] = {"needle.lateral_penalty": factor * penalty}
    for factor in (2, 4):
        found[f"kernel points x {factor}"] = {
            "discretization.tip_quadrature_points": factor * points
        }
    return found
