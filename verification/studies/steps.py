"""A hundred thousand steps with inertia: to and fro with rests and stick-slip, without drift."""

from collections.abc import Iterator

import numpy as np

from needlefem._arrays import Ints
from needlefem.errors import SimulationError
from needlefem.insertion import InsertionRun, Simulation
from needlefem.scene import DYNAMIC, Scene, Stage, vary
from needlefem.studies import Table
from verification.studies.cycles import advance, most_memory
from verification.studies.dynamics import DAMPING, LEAK, SLOW, moving

STEPS = 100_000
PIECES, WEAKENING, STEP = 5, 1e-4, 0.01
"""Number of segments (few, as there are many steps); slip-weakening distance, m, so short that the
segments stick and slip; time step, s."""
DRIFT, GROWTH, GIVEN = 1e-2, 0.02, 1e-8
"""Change of force and kinetic energy at rest over the second half, relative to them; largest growth
of memory after a tenth of the steps; energy gain in a step over the total absolute work."""


def study(scene: Scene, other: Scene | None = None) -> list[Table]:
    """Return forces, places, energies and memory at some of the cycles."""
    del other
    return [stepped(scene, name, STEPS) for name in DYNAMIC]


def stepped(scene: Scene, integrator: str, steps: int) -> Table:
    """Return the table for a number of steps of an integrator."""
    deep, back = 0.4 * scene.motion.max_depth, 0.3 * scene.motion.max_depth
    once = (Stage(dwell=1.0), Stage(depth=back), Stage(dwell=1.0), Stage(depth=deep))
    cycles = int(np.ceil(steps * STEP / (2.0 * (1.0 + (deep - back) / SLOW))))
    changes = {
        "motion.stages": (Stage(depth=deep), *(cycles * once), Stage(dwell=1.0)),
        "needle.static_friction_ratio": 1.5,
        "needle.slip_weakening_distance": WEAKENING,
        "discretization.path_spacing": deep / PIECES,
    }
    moved = vary(moving(scene, integrator, SLOW, DAMPING), changes)
    simulation = Simulation(vary(moved, {"discretization.time_step": STEP}))
    course = simulation.insertion_run(simulation.entry_of_case())
    seen = list(_rests(course, deep))
    if len(seen) < cycles or course.stepping is None:
        raise SimulationError(f"only {len(seen)} of {cycles} cycles: {course.outcome.sentence}")
    tenth = cycles // 10
    rows = [seen[number] for number in sorted({0, 1, 2, tenth, cycles // 2, cycles - 1})]
    balance = course.stepping.energy_balance.energy_terms()
    growth = rows[-1][-1] / seen[tenth][-1] - 1.0
    drifts = [abs(rows[-1][column] / rows[-2][column] - 1.0) for column in (2, 4)]
    return Table(
        title=f"{cycles} cycles with dwells and inertia ({integrator})",
        columns=(
            "cycle", "steps", "force (N/m)", "new cut (um)", "kinetic energy", "began to stick",
            "memory (MiB)",
        ),
        rows=rows,
        passed=max(drifts) <= DRIFT and growth <= GROWTH and balance.residual <= LEAK
        and balance.largest_energy_gain <= GIVEN,
        note=f"at the end of a dwell; kinetic energy over the work of a cycle; began to stick: "
        f"segments that slipped before, in total; energy residual {balance.residual:.1e}, energy "
        f"gain {balance.largest_energy_gain:.1e}; memory grows by "
        f"{100 * growth:.2g} % after a tenth of the steps",
    )  # fmt: skip


def _rests(course: InsertionRun, deep: float) -> Iterator[list[float]]:
    """Yield a row for the end of each rest at a depth."""
    number, stuck, old, tip = 0, 0, None, np.zeros(course.model.dim)
    for count, state in enumerate(course.iterate()):
        course.take_events()
        if old is not None:
            stuck += _stick(old.slipping, state.slipping)
            if old.depth == deep and state.depth != deep and course.stepping is not None:
                number += 1
                energy_balance = course.stepping.energy_balance
                kinetic = energy_balance.kinetic / (energy_balance.total_absolute_work / number)
                cut = advance(old.tip, tip)[1]
                yield [number, count + 1, old.force, cut, kinetic, stuck, most_memory()]
                tip = old.tip
        old = state


def _stick(before: Ints | None, after: Ints | None) -> int:
    """Return the number of segments that slid before and stick after."""
    if before is None or after is None:
        return 0
    both = min(len(before), len(after))
    return int(np.count_nonzero((before[1:both] != 0) & (after[1:both] == 0)))
