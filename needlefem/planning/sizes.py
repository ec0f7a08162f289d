"""Element sizes and path spacing, chosen for an accuracy of the placement."""

import dataclasses
import math

import numpy as np

from needlefem._arrays import Vector
from needlefem.errors import CaseError
from needlefem.insertion.simulation import Simulation
from needlefem.planning.error_estimate import HALVED, NoEstimateError, displacement_on, path_error
from needlefem.planning.result import Plan
from needlefem.scene import BoxMesh, Scene, one_contour_size, vary

SQUARES = 9
"""Squares along the longest side of the box to begin with."""
CORRIDOR_RADII = 4.0
"""Width of the corridor over the tip's radius, where the case gives none."""
CELLS_ACROSS = 8
"""Cells of the contour's size across the smallest region, at the least."""
MARGIN = 0.8
"""Share of the accuracy that sizes are chosen for."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class MeshSizes:
    """What an accuracy is bought with, m.

    Parameters
    ----------
    corridor, contour, bulk : float
        Element sizes along the needle and at the regions' contours, side of the squares elsewhere.
    path : float
        Spacing of the cut path's pieces.
    """

    corridor: float
    contour: float
    bulk: float
    path: float

    @classmethod
    def first(cls, scene: Scene) -> "MeshSizes":
        """Return the coarsest sizes that a plan is tried with."""
        radius = scene.needle.tip_radius
        spans = [float(np.ptp(r.contour.points, axis=0).min()) for r in scene.regions.values()]
        return cls(
            corridor=0.5 * radius,
            contour=min([radius, *(span / CELLS_ACROSS for span in spans)]),
            bulk=longest(scene) / SQUARES,
            path=0.4 * radius,
        )

    def halved(self, *names: str) -> "MeshSizes":
        """Return them with some halved."""
        return dataclasses.replace(self, **{name: 0.5 * getattr(self, name) for name in names})

    def scene(self, scene: Scene, target: Vector) -> Scene:
        """Return the scene in these sizes, refined along the line through a target."""
        box, radius = _box(scene), scene.needle.tip_radius
        changes: dict[str, object] = {
            "target": tuple(float(x) for x in target),
            "motion.entry": (),
            "mesh.divisions": tuple(math.ceil(x / self.bulk - 1e-9) for x in box.size),
            "mesh.interfaces": "fitted",
            "mesh.refine.corridor_size": self.corridor,
            "mesh.refine.corridor_width": box.refine.corridor_width or CORRIDOR_RADII * radius,
            **one_contour_size(scene, self.contour if scene.regions else 0.0),
            "discretisation.element": "auto",
            "discretisation.kernel_points": 0,
            "discretisation.path_spacing": self.path,
        }
        return vary(scene, changes)


def longest(scene: Scene) -> float:
    """Return the longest side of the scene's box, m."""
    return max(_box(scene).size)


def _box(scene: Scene) -> BoxMesh:
    if not isinstance(scene.mesh, BoxMesh):
        problem = "a mesh from a file has the sizes that it has"
        remedy = "leave it out and read the estimate, or give a box"
        raise CaseError("planning.accuracy", problem, remedy)
    return scene.mesh


def finer(
    sizes: MeshSizes, scene: Scene, simulation: Simulation, plan: Plan, share: float
) -> MeshSizes:
    """Return sizes with which the error falls to a share of what it is, each halved at most once.

    What each size does to the placement is measured by halving it alone; what is halved is taken
    to leave half of it.
    """
    parts = {"path": path_error(simulation, plan)}
    chosen: list[str] = []
    for name in ("corridor", "contour", "bulk") if scene.regions else ("corridor", "bulk"):
        other = Simulation(sizes.halved(name).scene(scene, plan.target))
        try:
            parts[name] = HALVED * float(np.linalg.norm(displacement_on(other, simulation, plan)))
        except NoEstimateError:
            chosen.append(name)  # what can't be measured is halved
    wanted = MARGIN * share * sum(parts.values())
    for name in sorted(parts, key=lambda name: -parts[name]):
        if sum(parts.values()) <= wanted:
            break
        parts[name] *= 0.5
        chosen.append(name)
    return sizes.halved(*chosen)
