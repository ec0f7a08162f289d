"""Ten thousand cycles of insertion, rest and retraction: residual energy and memory.

When the needle returns to the same depth, the friction next to the tip has not reached its limit
yet. The tip force is therefore larger and the tip cuts further, by a distance that decreases from
cycle to cycle.
"""

import itertools
import resource

import numpy as np

from needlefem._arrays import Vector
from needlefem.errors import SimulationError
from needlefem.insertion import Simulation, TipPhase
from needlefem.scene import Scene, Stage, vary
from needlefem.studies import Table

CYCLES = 10_000
PIECES = 3
"""Path spacing, m; large, because the number of steps is large."""
LEFT, GROWTH = 1e-9, 0.02
"""Largest strain energy after the retraction, relative to the work; largest growth of memory after
a tenth of the cycles."""


def study(scene: Scene, other: Scene | None = None) -> list[Table]:
    """Return forces, tip positions and memory in some of the cycles."""
    del other
    return [cycled(scene, CYCLES)]


def cycled(scene: Scene, cycles: int) -> Table:
    """Return the table for a number of cycles."""
    depth = 0.5 * scene.motion.max_depth
    once = (Stage(depth=depth), Stage(dwell=1.0), Stage(depth=-1e-3))
    changes = {
        "motion.stages": once * cycles,
        "discretization.path_spacing": depth / PIECES,
        "discretization.integrator": "quasi_static",
    }
    simulation = Simulation(vary(scene, changes))
    course = simulation.insertion_run(simulation.entry_of_case())
    watched = {1, 2, cycles // 10, cycles // 2, cycles}
    rows: list[list[float]] = []
    number, rested, tip, left = 0, False, np.zeros(scene.dim), 0.0
    for state in course.iterate():
        course.take_events()
        resting = state.depth == depth
        if resting and not rested:
            number += 1
            if number in watched:
                rows.append([number, state.force, *advance(state.tip, tip), most_memory()])
            tip = state.tip
        rested = resting
        if state.tip_phase is TipPhase.OUTSIDE and course.stepping is not None:
            energy_balance = course.stepping.energy_balance
            left = max(
                left,
                abs(energy_balance.strain) / energy_balance.total_absolute_work
                if energy_balance.total_absolute_work
                else 0.0,
            )
    if number < cycles:
        raise SimulationError(f"only {number} of {cycles} cycles: {course.outcome.sentence}")
    growth = rows[-1][-1] / rows[2][-1] - 1.0
    advances = [row[3] for row in rows]
    falls = all(b <= a for a, b in itertools.pairwise(advances))
    return Table(
        title=f"{cycles} cycles of insertion, dwell and retraction",
        columns=("cycle", "force (N/m)", "material (cm)", "new cut (um)", "memory (MiB)"),
        rows=rows,
        passed=falls and growth <= GROWTH and left <= LEFT,
        note=f"at most {left:.1e} of the work is left in the tissue when the needle is out; memory "
        f"grows by {100 * growth:.2g} % after a tenth of the cycles",
    )


def advance(tip: Vector, before: Vector) -> tuple[float, float]:
    """Return the distance of the tip's material from the origin, cm, and from `before`, um."""
    return 100.0 * float(np.linalg.norm(tip)), 1e6 * float(np.linalg.norm(tip - before))


def most_memory() -> float:
    """Return the largest memory of the process so far, MiB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
