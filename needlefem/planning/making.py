"""A plan on one discretisation, which has passed its checks."""

import dataclasses
import time
from typing import NamedTuple

from needlefem._arrays import Floats, Vector
from needlefem._progress import doing
from needlefem.checks.result import CheckResult
from needlefem.insertion.simulation import Simulation
from needlefem.mesh.entry import Entry
from needlefem.planning.error_estimate import NoEstimateError, estimate
from needlefem.planning.planner import Planner
from needlefem.planning.result import ErrorEstimate, Plan


class Stopwatch:
    """Seconds between laps; laps of one name add up."""

    def __init__(self) -> None:
        self.laps: dict[str, float] = {}
        self._last = time.perf_counter()

    def lap(self, name: str) -> None:
        """End a lap."""
        now = time.perf_counter()
        self.laps[name] = self.laps.get(name, 0.0) + now - self._last
        self._last = now


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class PlanRequest:
    """What to plan for, and how.

    Parameters
    ----------
    target : array, shape (dim,), m
    search : str or None
        See `needlefem.plan`.
    all_solutions : bool
    clock : Stopwatch
    """

    target: Vector
    search: str | None = None
    all_solutions: bool = False
    clock: Stopwatch = dataclasses.field(default_factory=Stopwatch)


class PlanAttempt(NamedTuple):
    """A plan, what it was made on, and the estimate of its error or why there is none."""

    simulation: Simulation
    entry: Entry
    checks: tuple[CheckResult, ...]
    plan: Plan
    estimate: ErrorEstimate | None
    not_estimated: str = ""


def attempt_plan(
    simulation: Simulation, wanted: PlanRequest, start: Floats | None = None, *, path: bool = False
) -> PlanAttempt:
    """Check the discretisation, plan, and estimate what the discretisation does.

    Parameters
    ----------
    simulation : Simulation
    wanted : PlanRequest
    start : array, shape (dim - 1,), m, optional
        Height to begin with.
    path : bool
        Whether the estimate is made whatever the scene says, and with the path's spacing in it.

    Raises
    ------
    CheckFailedError
        The discretisation fails a check.
    """
    clock = wanted.clock
    if simulation.scene.motion.entry:
        simulation.entry_of_case()  # a plan chooses its own, but the case's must be one
    planner = Planner(simulation, wanted.target)
    clock.lap("model")
    checks = simulation.check(planner.entry)
    clock.lap("preflight")
    found = planner.plan(wanted.search, all_solutions=wanted.all_solutions, start=start)
    clock.lap("search")
    error, why = None, ""
    if path or simulation.scene.planning.estimate:
        doing("estimating what the mesh does to the placement")
        try:
            error = estimate(simulation, found, path=path)
        except NoEstimateError as reason:
            why = str(reason)
        clock.lap("estimate")
    return PlanAttempt(simulation, planner.entry, checks, found, error, why)
