"""Ten thousand times in, rest, and out: nothing drifts, and memory does not grow."""

import itertools
import tracemalloc

import numpy as np

from needlefem.insertion.simulation import Simulation
from needlefem.insertion.state import State
from needlefem.scene import Scene, Stage, vary
from needlefem.table import Table

CYCLES = 10_000
PIECES = 3
"""Of the path; long ones, for there are many steps."""
DRIFT, GROWTH = 1e-9, 0.02
"""Largest change of force and place between the second cycle and the last, relative; and growth
of memory from a tenth of the cycles to their end."""


def study(scene: Scene, other: Scene | None = None) -> list[Table]:
    """Return forces, places and memory at some of the cycles."""
    del other
    return [cycled(scene, CYCLES)]


def cycled(scene: Scene, cycles: int) -> Table:
    """Return the table of so many cycles."""
    depth = 0.5 * scene.motion.max_depth
    once = (Stage(to=depth), Stage(hold=1.0), Stage(to=-1e-3))
    changes = {
        "motion.stages": once * cycles,
        "discretisation.path_spacing": depth / PIECES,
        "discretisation.integrator": "quasi-static",
    }
    simulation = Simulation(vary(scene, changes))
    course = simulation.course(simulation.entry_of_case())
    watched = {2, cycles // 10, cycles // 2, cycles}
    rows, seen, number = [], [], 0
    tracemalloc.start()
    states = course.iterate()
    for before, state in itertools.pairwise(states):
        course.take_events()
        if state.depth == depth and before.depth == depth:
            number += 1
            if number in watched:
                seen.append(_measures(state))
                rows.append([number, *seen[-1], tracemalloc.get_traced_memory()[0] / 2**20])
    tracemalloc.stop()
    drift = max(np.max(np.abs(np.array(m) / np.array(seen[0]) - 1.0)) for m in seen)
    growth = rows[-1][-1] / rows[1][-1] - 1.0
    energies = course.result(()).energies
    left = abs(energies.strain) / energies.turnover if energies is not None else np.inf
    return Table(
        title=f"{cycles} cycles of going in, resting, and coming out",
        columns=("cycle", "force (N/m)", "material at the tip (m)", "memory (MiB)"),
        rows=rows,
        passed=bool(number == cycles and drift <= DRIFT and growth <= GROWTH and left <= DRIFT),
        note=f"{course.outcome.sentence}; drift {drift:.1e}, memory grows by {100 * growth:.2g} %, "
        f"{left:.1e} of the work is left in the tissue",
    )


def _measures(state: State) -> list[float]:
    return [state.force, float(np.linalg.norm(state.tip))]
