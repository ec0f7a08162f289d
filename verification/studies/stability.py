"""Extreme parameters and meshes: each result has a status, and no large error is unannounced.

Each scene is planned, and the plan is carried out on a fine discretisation of the same model. If
the error there is larger than half a millimetre, the plan must have a status other than `planned`,
a failed check or a warning.
"""

from typing import Any

import numpy as np

from needlefem import plan
from needlefem.errors import NeedlefemError
from needlefem.insertion import Simulation, TipTrajectory
from needlefem.planning import carry_out
from needlefem.scene import Scene, field_of, one_contour_size, resolve, vary
from needlefem.studies import Table

LARGEST_QUIET_ERROR = 5e-4
"""Largest error on the fine discretisation without a warning, m."""
COLUMNS = (
    "scene",
    "status",
    "energy residual",
    "error on the fine mesh (cm)",
    "warnings",
    "warned",
)


def study(scene: Scene, other: Scene | None = None) -> list[Table]:
    """Return one table of plans, and one of insertions with inertia over the time step."""
    del other
    rows = [_planned(scene, name, changes) for name, changes in extremes(scene).items()]
    return [
        Table(
            title="plans of extreme scenes",
            columns=COLUMNS,
            rows=rows,
            passed=all(bool(row[-1]) for row in rows),
        ),
        time_steps(scene),
    ]


def extremes(scene: Scene) -> dict[str, dict[str, Any]]:
    """Return the changes to the scene, by name."""
    radius = scene.needle.tip_radius
    background = field_of(scene, f"materials.{scene.default_material}.youngs_modulus")
    stiff = next(region.material for region in scene.regions.values())
    found: dict[str, dict[str, Any]] = {
        "as it is": {},
        "linear elements": {"discretization.element": "P1"},
        "contour not fitted": {"mesh.interfaces": "centroid"},
        "point tip": {"needle.tip": "point"},
    }
    names = [f"materials.{name}.poissons_ratio" for name in scene.materials]
    for ratio in (0.3, 0.4, 0.45, 0.49, 0.4999, 0.499999):
        ratios: dict[str, Any] = dict.fromkeys(names, ratio)
        found[f"Poisson's ratio {ratio}"] = {**ratios, "discretization.element": "auto"}
    found["quadratic elements at 0.4999"] = dict.fromkeys(names, 0.4999)
    for contrast in (1.0, 10.0, 100.0, 1000.0, 1e6):
        found[f"contrast {contrast:g}"] = {
            f"materials.{stiff}.youngs_modulus": contrast * background
        }
    for factor in (4.0, 2.0, 1.0):
        found[f"elements {factor:g} tip radii"] = {"mesh.refine.corridor_size": factor * radius}
    for factor in (1.0, 0.25, 0.05):
        found[f"path spacing {factor:g} tip radii"] = {
            "discretization.path_spacing": factor * radius
        }
    for hold in (1e6, 1e8, 1e12):
        found[f"lateral penalty {hold:g} N/m^3"] = {"needle.lateral_penalty": hold}
    for aspect in (10, 100):
        found[f"slivers 1 : {aspect}"] = {
            "mesh.divisions": (round(95 / aspect**0.5), aspect * round(95 / aspect**0.5)),
            "mesh.refine.corridor_size": 0.0,
            **one_contour_size(scene, 0.0),
            "mesh.interfaces": "centroid",
        }
    return found


def fine(scene: Scene) -> Scene:
    """Return the same model on a discretisation with half of the element size at the needle."""
    radius = scene.needle.tip_radius
    return vary(
        scene,
        {
            "discretization.element": "auto",
            "discretization.path_spacing": 8e-4,
            "needle.lateral_penalty": 1e10,
            "needle.tip": "disc",
            "mesh.divisions": (18, 18),
            "mesh.interfaces": "fitted",
            "mesh.refine.corridor_size": 0.25 * radius,
            "mesh.refine.corridor_width": 8e-3,
            **one_contour_size(scene, 0.5 * radius),
        },
    )


def _planned(scene: Scene, name: str, changes: dict[str, Any]) -> list[Any]:
    varied = vary(scene, changes)
    try:
        found = plan(vary(varied, {"planning.estimate": False}))  # it is carried out instead
    except NeedlefemError as refusal:
        return [name, f"refused: {refusal}"[:60], "", "", 0, True]
    warnings = len(resolve(varied).warnings)  # of the discretisation, known beforehand
    balance = None if found.evidence is None else found.evidence.energy
    reach = carry_out(fine(varied), found)
    error = np.inf if reach is None else float(np.linalg.norm(reach.point - found.target))
    told = error <= LARGEST_QUIET_ERROR or warnings > 0 or found.status != "planned"
    residual = "" if balance is None else f"{balance.residual:.0e}"
    return [name, str(found.status), residual, 100.0 * error, warnings, told]


def time_steps(scene: Scene) -> Table:
    """Return the insertion with inertia at the case's speed over the time step."""
    depth = 0.4 * scene.motion.max_depth
    simulation = Simulation(scene)
    entry = simulation.entry_of_case()
    path = TipTrajectory(simulation.insert(entry, lambda state: state.depth > depth + 3e-3))
    rows: list[list[Any]] = []
    for step in (1e-3, 1e-2, 1.0 / 30.0, 1e-1, 1.0):
        changes = {"discretization.integrator": "newmark", "discretization.time_step": step}
        moving = Simulation(vary(scene, changes), simulation.model)
        found = moving.insert(entry, lambda state: state.depth >= depth)
        last, reach = found.states[-1], path.at_depth(found.states[-1].depth)
        apart = np.inf if reach is None else float(np.linalg.norm(last.tip - reach.point))
        rows.append([step, str(found.outcome.status), 100.0 * apart])
    return Table(
        title="insertion with inertia over the time step",
        columns=("step (s)", "status", "distance to path following (cm)"),
        rows=rows,
    )
