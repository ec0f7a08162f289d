"""Cost of one insertion with known compliance, in back-substitutions, and its distribution."""

import cProfile
import itertools
import pstats
import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from needlefem._table import Table
from needlefem.bench.timing import in_turn, median, processor_seconds
from needlefem.casefile.load import load_case
from needlefem.errors import CaseError
from needlefem.insertion.result import Insertion
from needlefem.insertion.simulation import Simulation
from needlefem.mesh.surface import Entry
from needlefem.plotting.charts import Bar, bars

_Profile = dict[tuple[str, int, str], tuple[int, int, float, float, object]]
"""Calls, their own and their whole time, and callers, by file, line and function."""
ROUNDS = 15
WARM = 201
BESIDE = 5e-6
"""Offset of a second needle from the target's height, m."""
MOST = 400.0
"""Largest number of back-substitutions of one insertion for a model of the paper's size."""
PAPER = 2_000
"""Largest number of unknowns for which this is required; the cost of larger models differs."""
PARTS = {
    "functionals: points, cells, weights": ("needle/needle_interface.py", "tip_and_segment"),
    "responses and elimination of lateral forces": (
        "contact/condensed_contact.py",
        "trial",
    ),
    "equations of the step": ("insertion/tip_solver.py", "_try"),
    "iteration": ("insertion/tip_solver.py", "solve"),
    "new segments, states": ("insertion/path_following.py", "_accept"),
    "all": ("insertion/simulation.py", "insert"),
}
"""Functions by activity, with their files in the package; their time includes all calls."""
WITHIN = {
    "equations of the step": (
        "functionals: points, cells, weights",
        "responses and elimination of lateral forces",
    ),
    "iteration": ("equations of the step",),
    "all": ("iteration", "new segments, states"),
}
"""Activities that other activities contain, to be subtracted from them."""


def run(case: str) -> Table:
    """Time insertions at the target's height in turn with back-substitutions; profile one."""
    scene = load_case(case)
    if scene.target is None:
        raise CaseError("target.point", "missing", "the benchmark aims at it")
    ready = Simulation(scene)
    entry = ready.entry_through(np.array(scene.target))
    found = ready.insert(entry)
    beside = itertools.cycle(_beside(ready, side * BESIDE) for side in (1.0, -1.0))
    rhs = np.ones(len(ready.model.free_dofs))
    tasks = {
        "back-substitution": lambda: ready.model.factor.solve(rhs),
        "insertion": lambda: alone(ready, entry),
        "one beside the last": lambda: ready.insert(next(beside)),
    }
    seconds = in_turn(tasks, ROUNDS)
    warm = median(processor_seconds(lambda: ready.model.factor.solve(rhs), WARM))
    unit, whole, next_to = (median(seconds[name]) for name in tasks)
    shares = _shares(lambda: alone(ready, entry))
    rows = [
        _Row("back-substitution", 1e3 * unit, *_spread(seconds["back-substitution"]), 1),
        _Row("back-substitution, cached factor", 1e3 * warm),
        _Row("insertion", 1e3 * whole, *_spread(seconds["insertion"]), round(whole / unit)),
        _Row("one beside the last", 1e3 * next_to, *_spread(seconds["one beside the last"]),
             round(next_to / unit)),
        *(_Row(name, share * whole * 1e3, solves=round(share * whole / unit),
               share=f"{100 * share:.0f} %") for name, share in shares.items()),
    ]  # fmt: skip
    steps = len(found.states) - 2
    bound = ready.model.ndofs <= PAPER
    return Table(
        title=f"{scene.title}: {ready.model.ndofs} dofs, an insertion with responses known, "
        f"medians of {ROUNDS} rounds",
        columns=("activity", "ms", "minimum", "maximum", "back-substitutions", "share"),
        rows=rows,
        passed=not bound or whole <= MOST * unit,
        note=f"{steps} steps, {found.contact_solves} contact solves, "
        f"{found.contact_solves / steps:.1f} a step; beside the last: {2e6 * BESIDE:g} um apart; "
        f"{ready.responses.size} rows known; "
        "shares from a profile, which increases the cost of calls"
        + f"; {whole / warm:.0f} back-substitutions with the factor in the cache"
        + (f"; limit: {MOST:g} back-substitutions" if bound else ""),
        charts={
            scene.title: bars("an insertion and its parts", "milliseconds", list(map(_bar, rows)))
        },
        summary={"back_substitutions": whole / unit, "evaluations": found.contact_solves},
    )


class _Row(NamedTuple):
    """A total with its range, or a share of it; an empty text where there is no number."""

    name: str
    middle: float
    least: float | str = ""
    most: float | str = ""
    solves: int | str = ""
    share: str = ""


def _bar(row: _Row) -> Bar:
    """Return the bar of a row: a total with its range, or a share."""
    least, most = (float(end) if end else None for end in (row.least, row.most))
    return Bar(row.name, row.middle, least, most, series=int(bool(row.share)))


def alone(simulation: Simulation, entry: Entry) -> Insertion:
    """Run an insertion with an empty warm start."""
    simulation.forget()
    return simulation.insert(entry)


def _beside(ready: Simulation, height: float) -> Entry:
    """Return the entry at a height above that of the target, m."""
    lateral = ready.instrument(ready.entry_of_case()).axis.lateral_directions[0]
    return ready.entry_through(np.array(ready.scene.target) + height * lateral)


def _spread(seconds: list[float]) -> tuple[float, float]:
    return 1e3 * min(seconds), 1e3 * max(seconds)


def _shares(task: Callable[[], object]) -> dict[str, float]:
    """Return the time of each activity, without that of contained activities."""
    profile = cProfile.Profile(time.process_time)
    profile.runcall(task)
    spent = dict.fromkeys(PARTS, 0.0)
    entries: _Profile = pstats.Stats(profile).stats  # type: ignore[attr-defined]
    for (file, _, function), (_, _, _, cumulative, _) in entries.items():
        for name, (where, what) in PARTS.items():
            if file.endswith(where) and "needlefem" in file and function == what:
                spent[name] += cumulative
    own = {
        name: value - sum(spent[inner] for inner in WITHIN.get(name, ()))
        for name, value in spent.items()
    }
    own["all else"] = own.pop("all")
    return {name: value / spent["all"] for name, value in own.items()}
