"""Friction that decreases from static to kinetic, gradually or suddenly, for decreasing steps.

The needle is inserted, rests, and continues. The force at which it continues after the rest is
larger, because the sticking segments have static friction. With a slip-weakening distance this
force converges as the steps decrease; without one it depends on the step.
"""

import numpy as np

from needlefem.insertion import Simulation
from needlefem.scene import Scene, Stage, vary
from needlefem.studies import Table

RATIO = 1.5
"""Ratio of static to kinetic friction."""
LENGTH = 1e-3
"""Slip-weakening distance, m."""
STEPS = (0.5e-3, 0.25e-3, 0.125e-3, 0.0625e-3)
"""Travel of the needle in a step, m."""
SETTLED, UNSETTLED = 0.01, 0.05
"""Largest relative change of the force in the last halving of the step with a slip-weakening
distance; smallest relative change over all halvings without one."""


def study(scene: Scene, other: Scene | None = None) -> list[Table]:
    """Return the force at which the needle continues after the rest, for each step."""
    del other
    found = {length: [_peak(scene, length, step) for step in STEPS] for length in (LENGTH, 0.0)}
    rows = [
        [1e3 * step, found[LENGTH][number], found[0.0][number]] for number, step in enumerate(STEPS)
    ]
    smooth, bare = found[LENGTH], found[0.0]
    change = abs(smooth[-1] / smooth[-2] - 1.0)
    spread = max(bare) / min(bare) - 1.0
    return [
        Table(
            title=f"static friction {RATIO:g} times the kinetic: force to move on after a rest",
            columns=("step (mm)", f"falls over {1e3 * LENGTH:g} mm (N/m)", "falls at once (N/m)"),
            rows=rows,
            passed=change <= SETTLED and spread >= UNSETTLED,
            note=f"over a length: {100 * change:.2g} % in the last halving; at once: the steps "
            f"differ by {100 * spread:.2g} %, as the warning says",
        )
    ]


def _peak(scene: Scene, length: float, step: float) -> float:
    """Return the largest force in the first part of the continued insertion, N (N/m in 2D)."""
    deep = scene.motion.max_depth
    on = 0.5 * deep + 4.0 * LENGTH
    fast = 100.0 * scene.motion.speed  # the result does not depend on time: long steps
    stages = (Stage(depth=0.5 * deep, speed=fast), Stage(dwell=1.0), Stage(depth=on))
    changes = {
        "motion.stages": stages,
        "needle.static_friction_ratio": RATIO,
        "needle.slip_weakening_distance": length,
        "discretization.path_spacing": 2.0 * scene.discretization.path_spacing,
        "discretization.time_step": step / scene.motion.speed,
    }
    simulation = Simulation(vary(scene, changes))
    course = simulation.insertion_run(simulation.entry_of_case())
    rested = 0.5 * deep / fast + 1.0 - 1e-9
    forces = [state.force for state in course.iterate() if state.time > rested]
    return float(np.max(forces))
