"""Cost of the stages of a plan, in milliseconds and in back-substitutions of its model."""

import numpy as np

from needlefem._arrays import Vector
from needlefem._table import Table
from needlefem.bench.insertion import alone
from needlefem.bench.timing import in_turn, median, spread_bars
from needlefem.casefile.load import load_case
from needlefem.checks.mesh_checks import preflight
from needlefem.errors import CaseError
from needlefem.insertion.simulation import Simulation
from needlefem.planning.plan import plan
from needlefem.planning.planner import Planner
from needlefem.planning.result import Plan
from needlefem.scene.build import build_mesh, build_model

ROUNDS = 7
MOST = 3000.0
"""Largest number of back-substitutions of a plan of the paper's size, model included."""


def run(case: str) -> Table:
    """Time all stages in turn."""
    scene = load_case(case)
    if scene.target is None:
        raise CaseError("target.point", "missing", "the benchmark plans for it")
    target = np.array(scene.target)
    ready = Simulation(scene)
    model = ready.model
    rhs = np.ones(len(model.free_dofs))
    entry = ready.entry_through(target)
    stages = {
        "back-substitution": lambda: model.factor.solve(rhs),
        "mesh": lambda: build_mesh(ready.scene),
        "tissue, stiffness": lambda: build_model(ready.scene, model.mesh).stiffness.matrix,
        "factorisation": lambda: model.stiffness.factor(model.free_dofs),
        "preflight": lambda: preflight(model),
        "insertion, responses known": lambda: alone(ready, entry),
        "plan, responses known": lambda: _planned(ready, target),
        "plan, model included": lambda: Planner(Simulation(scene), target).plan(),
        "plan with evidence, from the scene": lambda: plan(scene),
    }
    seconds = in_turn(stages, ROUNDS)
    middle = {name: median(values) for name, values in seconds.items()}
    unit, ours = middle["back-substitution"], middle["plan, model included"]
    bounded = (ready.scene.discretization.element, ready.model.dim) == ("P1", 2)
    note = f"limit: {MOST:g} back-substitutions, model included" if bounded else ""
    return Table(
        title=f"{scene.title}: {model.ndofs} dofs, medians of {ROUNDS} rounds",
        columns=("stage", "ms", "minimum", "maximum", "back-substitutions"),
        rows=[
            [name, 1e3 * value, 1e3 * min(seconds[name]), 1e3 * max(seconds[name]),
             round(value / unit)]
            for name, value in middle.items()
        ],
        passed=not bounded or ours <= MOST * unit,
        charts={scene.title: spread_bars("stages of a plan", "milliseconds", seconds, 1e-3)},
        note=note,
    )  # fmt: skip


def _planned(ready: Simulation, target: Vector) -> Plan:
    ready.forget()
    return Planner(ready, target).plan()
