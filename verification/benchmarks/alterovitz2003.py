"""The method of Alterovitz et al. 2003 beside the package's: seconds of a plan, and its error."""

import dataclasses
from collections.abc import Callable

import numpy as np

from needlefem import load_case, plan
from needlefem.alterovitz2003.plan import own_plan, paper_plan
from needlefem.alterovitz2003.simulation import InTime
from needlefem.bench import OWN, Entrant, median, race
from needlefem.errors import CaseError
from needlefem.planning import Plan, ReferenceSolution
from needlefem.scene import Scene, with_element
from needlefem.studies import Table

ROUNDS = 3
LEAST = 20.0
"""How many times as long the method of 2003 must take on the same mesh."""


def run(case: str) -> Table:
    """Time both methods, and measure the error of both against the exact tissue."""
    scene = load_case(case)
    if scene.target is None:
        raise CaseError("target.point", "missing", "the benchmark plans for it")
    nodes = with_element(scene, "P1")  # the method of 2003 moves nodes of linear triangles
    paper = median([paper_plan(nodes).seconds for _ in range(ROUNDS)])
    own = median([own_plan(nodes).seconds for _ in range(ROUNDS)])
    table = race(scene, entrants(scene), ReferenceSolution(scene, np.array(scene.target)))
    ratio = paper / own
    note = (
        f"the method of 2003 takes {ratio:.1f} times as long ({paper:.2f} s of processor time "
        f"against {own:.3f} s, medians of {ROUNDS}; at least {LEAST:g}); {table.note}"
    )
    return dataclasses.replace(table, passed=ratio >= LEAST, note=note)


def entrants(scene: Scene) -> list[Entrant]:
    """Return the case as it is, and the coupling of 2003 with forces on nodes or spread."""
    found = [Entrant(OWN, "embedded needle", lambda: plan(scene))]
    nodes = with_element(scene, "P1")
    for spread in (False, True):
        label = "conforming P1, " + ("as thick as ours" if spread else "forces on nodes")
        found.append(Entrant("coupling", label, _conforming(nodes, InTime(spread=spread))))
    return found


def _conforming(scene: Scene, numbers: InTime) -> Callable[[], Plan]:
    return lambda: paper_plan(scene, numbers).plan
