"""Properties of a scene's needle on its mesh, and what these checks know of a simulation."""

from typing import Protocol

import numpy as np

from needlefem._arrays import Vector
from needlefem.checks.result import CheckResult
from needlefem.fem.tissue_model import TissueModel
from needlefem.mesh.entry import Entry
from needlefem.mesh.generation import cell_sizes
from needlefem.scene import BoxMesh, Scene

SAMPLES = 200
"""Points of the needle's line at which cells are looked up."""


class NeedleInTissue(Protocol):
    """A scene's needle and tissue, ready for insertions."""

    scene: Scene
    model: TissueModel
    direction: Vector

    def reach(self, entry: Entry) -> float:
        """Return the largest depth of the scene's motion that is in the tissue, m."""
        ...


def sizes_along(simulation: NeedleInTissue, entry: Entry) -> Vector:
    """Return the sizes of the cells that a needle meets, m; empty if it meets none.

    The cells on its line count, as deep as the scene's motion goes.
    """
    model = simulation.model
    depths = np.linspace(0.0, simulation.reach(entry), SAMPLES)[1:]
    line = entry.point + depths[:, None] * simulation.direction
    cells = model.interpolation.locator.find(line)[0]
    found: Vector = cell_sizes(model.mesh)[np.unique(cells[cells >= 0])]
    return found


def needle_resolution(simulation: NeedleInTissue, entry: Entry) -> CheckResult:
    """Check that the mesh is not blind to the needle: elements of at most four tip radii.

    Accurate answers need nodes half a tip radius apart, of which `resolve` warns; beyond four
    radii the mesh alone decides where the needle goes. The cells on the needle's own line count.
    """
    radius, largest = simulation.scene.needle.tip_radius, sizes_along(simulation, entry)
    size = float(largest.max(initial=0.0)) if largest.size else np.inf
    if isinstance(simulation.scene.mesh, BoxMesh):
        finer = f'set mesh.refine.corridor_size to "{5e2 * radius:.2g} mm"'
    else:
        finer = "make the mesh file finer there, or check mesh.unit"
    return CheckResult(
        name="needle resolution",
        requirement="elements along the needle are at most four tip radii large",
        value=size / radius,
        bound=4.0,
        remedy=f"the elements there have up to {1e3 * size:.3g} mm, the tip's radius is "
        f"{1e3 * radius:.3g} mm: {finer}",
    )
