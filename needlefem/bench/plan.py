"""Stages of a plan, in milliseconds and in back-substitutions of the plan's own model."""

import numpy as np

from needlefem.bench.timing import in_turn, median
from needlefem.casefile.load import load_case
from needlefem.checks.tissue import preflight
from needlefem.errors import CaseError
from needlefem.fem.build import build_mesh, build_model
from needlefem.insertion.simulation import Simulation
from needlefem.planning.plan import plan
from needlefem.planning.planner import Planner
from needlefem.table import Table

ROUNDS = 7


def run(case: str) -> Table:
    """Time every stage, in turn."""
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
        "insertion, responses known": lambda: ready.insert(entry),
        "plan, responses known": lambda: Planner(ready, target).plan(),
        "plan with evidence, from the scene": lambda: plan(scene),
    }
    middle = {name: median(values) for name, values in in_turn(stages, ROUNDS).items()}
    unit = middle["back-substitution"]
    return Table(
        title=f"{scene.title}: {model.ndofs} dofs, medians of {ROUNDS} rounds",
        columns=("stage", "ms", "back-substitutions"),
        rows=[[name, 1e3 * seconds, round(seconds / unit)] for name, seconds in middle.items()],
    )
