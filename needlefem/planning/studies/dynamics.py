"""An insertion with the tissue's inertia against the march, as the speed goes to zero.

The march leaves inertia and damping out. A slow, snap-free insertion stepped in time with both
must approach it. What remains at the lowest speed is the difference of the two paths' pieces.
"""

from itertools import pairwise

import numpy as np

from needlefem.dynamics import Damping, Newmark, TissueSystem
from needlefem.insertion.dynamic import DynamicInsertion
from needlefem.insertion.path import Path
from needlefem.insertion.simulation import Simulation
from needlefem.scene import Scene, vary
from needlefem.table import Table

SPEEDS = (0.05, 0.02, 0.01, 0.005, 0.001)
TRAVEL = 1e-4
"""Travel of the needle in a time step, m."""
DAMPING = Damping(mass_rate=5.0, stiffness_time=2e-3)
NEWMARK = Newmark(beta=0.3025, gamma=0.6)
"""A little numerical damping, for the steps are far longer than the tissue's vibrations."""
BOUND = 1e-5
"""Largest difference of the material point at the tip at the lowest speed, m."""


def study(scene: Scene, other: Scene | None = None) -> list[Table]:
    """Return the difference of the material points at the tip, over the speed."""
    del other
    fine = vary(scene, {"discretisation.path_spacing": 0.25 * scene.discretisation.path_spacing})
    simulation = Simulation(fine)
    entry = simulation.entry_of_case()
    depth = 0.6 * scene.motion.max_depth
    path = Path(simulation.insert(entry, lambda state: state.depth > depth + 3e-3))
    differences = []
    for speed in SPEEDS:
        system = TissueSystem(simulation.model, DAMPING)
        dynamics = NEWMARK.stepper(system, TRAVEL / speed)
        moving = DynamicInsertion(simulation.instrument(entry), dynamics, speed)
        apart = [
            float(np.linalg.norm(state.tip - reach.point))
            for state in moving.iterate(depth)
            if state.depth > 0.5 * depth and (reach := path.at_depth(state.depth)) is not None
        ]
        differences.append(max(apart))
    falls = all(a >= b for a, b in pairwise(differences))
    rows = [[100.0 * v, 100.0 * d] for v, d in zip(SPEEDS, differences, strict=True)]
    return [
        Table(
            title="dynamic insertion against the march: largest distance of the points at the tip",
            columns=("speed (cm/s)", "distance (cm)"),
            rows=rows,
            passed=falls and differences[-1] <= BOUND,
            note=f"over the second half of {100 * depth:.2g} cm; falls with the speed",
        )
    ]
