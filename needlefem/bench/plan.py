"""Stages of a plan, in milliseconds and in back-substitutions of the plan's own model."""

import numpy as np

from needlefem._arrays import Vector
from needlefem._table import Table
from needlefem.alterovitz2003.plan import own_plan, paper_plan
from needlefem.bench.insertion import alone
from needlefem.bench.timing import in_turn, median, spread_bars
from needlefem.casefile.load import load_case
from needlefem.checks.mesh_checks import preflight
from needlefem.errors import CaseError
from needlefem.insertion.simulation import Simulation
from needlefem.planning.plan import plan
from needlefem.planning.planner import Planner
from needlefem.planning.result import Plan
from needlefem.scene import Scene
from needlefem.scene.build import build_mesh, build_model

ROUNDS, PAPER_ROUNDS = 7, 3
MOST, LEAST = 3000.0, 20.0
"""Back-substitutions that a plan at the size of the paper may take, model included, and how many
times as long the paper's method must take."""


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
        "insertion, responses known": lambda: alone(ready, entry),
        "plan, responses known": lambda: _planned(ready, target),
        "plan, model included": lambda: Planner(Simulation(scene), target).plan(),
        "plan with evidence, from the scene": lambda: plan(scene),
    }
    seconds = in_turn(stages, ROUNDS)
    middle = {name: median(values) for name, values in seconds.items()}
    unit, ours = middle["back-substitution"], middle["plan, model included"]
    notes, passed = list[str](), True
    if (ready.scene.discretisation.element, ready.model.dim) == ("P1", 2):
        ratio, said = _against_paper(scene)
        passed = ours <= MOST * unit and ratio >= LEAST
        notes = [f"a plan may take {MOST:g} back-substitutions, model included", said]
    return Table(
        title=f"{scene.title}: {model.ndofs} dofs, medians of {ROUNDS} rounds",
        columns=("stage", "ms", "least", "most", "back-substitutions"),
        rows=[
            [name, 1e3 * value, 1e3 * min(seconds[name]), 1e3 * max(seconds[name]),
             round(value / unit)]
            for name, value in middle.items()
        ],
        passed=passed,
        charts={scene.title: spread_bars("stages of a plan", "milliseconds", seconds, 1e-3)},
        note="; ".join(notes),
    )  # fmt: skip


def _against_paper(scene: Scene) -> tuple[float, str]:
    """Return how many times as long the paper's method takes, and a sentence that says so."""
    paper = median([paper_plan(scene).seconds for _ in range(PAPER_ROUNDS)])
    own = median([own_plan(scene).seconds for _ in range(PAPER_ROUNDS)])
    return paper / own, (
        f"the paper's method takes {paper / own:.1f} times as long ({paper:.2f} s of "
        f"processor time against {own:.3f} s, medians of {PAPER_ROUNDS}; at least {LEAST:g})"
    )


def _planned(ready: Simulation, target: Vector) -> Plan:
    ready.forget()
    return Planner(ready, target).plan()
