"""Cost of a state of a needle in motion: path following, time stepping, and reversals."""

import functools
from collections.abc import Callable

import numpy as np

from needlefem import load_case
from needlefem.bench import PAPER, in_turn, median
from needlefem.insertion import Insertion, Simulation, State
from needlefem.plotting import Bar, bars
from needlefem.scene import Stage, tip_element_size, vary
from needlefem.studies import Table

ROUNDS = 5
TURNS = 4
"""Number of reversals of the needle."""
SHARE = (0.7, 0.5)
"""Largest depth of the motion and depth of the reversals, over that of the scene."""
TURNED = "path following, then retraction and a second push"
MOST = 12.0
"""Largest number of back-substitutions of a state with sticking and slipping segments."""


def run(case: str) -> Table:
    """Time path following, time stepping of the same insertion, and reversals at depth."""
    scene = load_case(case)
    spacing = max(scene.discretization.path_spacing, tip_element_size(scene) or 0.0)
    deep, back = (share * scene.motion.max_depth for share in SHARE)
    plain = vary(scene, {"discretization.path_spacing": spacing, "motion.max_depth": deep})
    turns = (Stage(depth=deep), *(Stage(depth=back), Stage(depth=deep)) * TURNS)
    motions = {
        "path following": plain,
        "time stepping": vary(plain, {"discretization.integrator": "quasi_static"}),
        TURNED: vary(plain, {"motion.stages": turns}),
    }
    ready = {name: Simulation(motion) for name, motion in motions.items()}
    found = {name: move(simulation) for name, simulation in ready.items()}
    model = next(iter(ready.values())).model
    rhs = np.ones(len(model.free_dofs))
    tasks: dict[str, Callable[[], object]] = {
        name: functools.partial(move, simulation) for name, simulation in ready.items()
    }
    tasks["back-substitution"] = lambda: model.factor.solve(rhs)
    seconds = {name: median(values) for name, values in in_turn(tasks, ROUNDS).items()}
    unit = seconds["back-substitution"]
    rows = [_row(name, found[name], seconds[name], unit) for name in motions]
    dearest = seconds[TURNED] / len(found[TURNED].states) / unit
    return Table(
        title=f"{scene.title}: {model.ndofs} dofs, medians of {ROUNDS} rounds",
        columns=("motion", "states", "evaluations", "sticking and slipping", "ms a state",
                 "back-substitutions a state"),
        rows=rows,
        charts={
            scene.title: bars("a state of a needle in motion", "milliseconds", [
                Bar(name, 1e3 * seconds[name] / len(found[name].states)) for name in motions
            ])
        },
        passed=model.ndofs > PAPER or dearest <= MOST,
        note=f"segments of {1e3 * spacing:.2g} mm, responses known; sticking and slipping: states "
        f"in which segments do both; limit for one: {MOST:g} back-substitutions at the size of the "
        f"paper; a back-substitution takes {1e3 * unit:.3g} ms",
    )  # fmt: skip


def move(simulation: Simulation) -> Insertion:
    """Run the scene's motion, as if it were the first."""
    simulation.forget()
    return simulation.move(simulation.entry_of_case())


def _row(name: str, found: Insertion, seconds: float, unit: float) -> list[object]:
    count = len(found.states)
    mixed = sum(_mixed(state) for state in found.states)
    each = seconds / count
    return [name, count, found.contact_solves, mixed, 1e3 * each, round(each / unit, 1)]


def _mixed(state: State) -> bool:
    """Say whether some pieces stick and others slip."""
    if state.slipping is None:
        return False
    return len(set(np.abs(state.slipping[1:]).tolist())) == 2
