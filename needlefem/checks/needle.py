"""Properties of a scene's needle on its mesh."""

import numpy as np

from needlefem.checks.result import CheckResult
from needlefem.fem.mesh import cell_sizes
from needlefem.insertion.simulation import Simulation


def needle_resolution(simulation: Simulation) -> CheckResult:
    """Check that the mesh is not blind to the needle: elements of at most four tip radii.

    Accurate answers need nodes half a tip radius apart, of which `resolve` warns; beyond four
    radii the mesh alone decides where the needle goes. The cells on the case's own line count, as
    deep as its motion goes.
    """
    model, scene = simulation.model, simulation.scene
    entry = simulation.entry_of_case()
    depths = np.linspace(0.0, simulation.reach(entry), 200)[1:]
    line = entry.point + depths[:, None] * simulation.direction
    cells = model.interpolation.locator.find(line)[0]
    return CheckResult(
        name="needle resolution",
        requirement="elements along the needle are at most four tip radii large",
        value=float(cell_sizes(model.mesh)[cells[cells >= 0]].max()) / scene.needle.tip_radius,
        bound=4.0,
    )
