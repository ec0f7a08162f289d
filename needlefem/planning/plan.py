"""Plan on a discretisation that has passed its checks, and say what the plan is worth."""

import dataclasses
import time

import numpy as np

from needlefem.arrays import Vector
from needlefem.checks.needle import needle_resolution, sticking_pieces
from needlefem.checks.result import CheckResult
from needlefem.checks.tissue import preflight
from needlefem.errors import CaseError, CheckFailedError
from needlefem.insertion.ledger import ledger
from needlefem.insertion.simulation import Simulation, Watch
from needlefem.insertion.validity import validity
from needlefem.planning.planner import Planner
from needlefem.planning.result import Evidence, Plan
from needlefem.scene import Scene


def plan(
    scene: Scene,
    target: Vector | None = None,
    search: str | None = None,
    *,
    all_solutions: bool = False,
    watch: Watch | None = None,
) -> Plan:
    """Find the release point from which a seed, biopsy or injection ends on the target.

    Parameters
    ----------
    scene : Scene
    target : array, shape (dim,), m, optional
        The case's own target when left out.
    search : str, optional
        ``"root"`` of the signed lateral miss; ``"golden"`` section on the error, as in the paper
        (R. Alterovitz et al., IROS 2003, section V.C); ``"grid"`` where the error is not
        unimodal. The case's choice when left out.
    all_solutions : bool
        Also scan the range for further heights that hit the target.
    watch : callable, optional
        Called with every state of every insertion.

    Raises
    ------
    CaseError
        The scene can't be built, or the target is missing or outside the tissue.
    CheckFailedError
        The discretisation fails a check: nothing is planned on it.
    """
    chosen = target if target is not None else scene.target
    if chosen is None:
        raise CaseError("target.point", "missing", "give a target to plan for")
    clock = _Clock()
    simulation = Simulation(scene, watch=watch)
    if scene.motion.entry:
        simulation.entry_of_case()  # a plan chooses its own, but the case's must be one
    planner = Planner(simulation, np.asarray(chosen, dtype=float))
    clock.lap("model")
    checks = checked(simulation)
    clock.lap("preflight")
    found = planner.plan(search, all_solutions=all_solutions)
    clock.lap("search")
    evidence = _evidence(simulation, found, checks)
    clock.lap("evidence")
    evidence = dataclasses.replace(evidence, timings=clock.laps)
    return dataclasses.replace(found, evidence=evidence)


def checked(simulation: Simulation) -> tuple[CheckResult, ...]:
    """Run the preflight on a simulation's tissue; raise `CheckFailedError` if a check fails."""
    checks = [*preflight(simulation.model), needle_resolution(simulation)]
    if simulation.steps:
        checks.append(sticking_pieces(simulation))
    failed = [check for check in checks if not check.passed]
    if failed:
        worst = failed[0]
        raise CheckFailedError(
            f"refused: check '{worst.name}' gives {worst.value:.3g}, at most {worst.bound:.3g} "
            f"is allowed ({worst.requirement}); repair the mesh or choose another element"
        )
    return tuple(checks)


def _evidence(simulation: Simulation, found: Plan, checks: tuple[CheckResult, ...]) -> Evidence:
    insertion, energies, strains = found.insertion, None, None
    warnings = list(simulation.resolved.warnings)
    if found.best is not None:
        energies = ledger(insertion)
        depth = float(insertion.axis.along(found.best.release_point))
        state = min(int(np.searchsorted(insertion.depths, depth)), len(insertion.states) - 1)
        strains = validity(insertion, state)
        warnings += strains.warnings()
        if insertion.snaps:
            warnings.append(f"the tip jumps ahead {len(insertion.snaps)} times on its way")
    return Evidence(
        preflight=checks,
        ledger=energies,
        validity=strains,
        warnings=tuple(warnings),
        skipped=simulation.resolved.skipped,
        reasons=simulation.reasons,
        timings={},
    )


class _Clock:
    """Seconds between laps."""

    def __init__(self) -> None:
        self.laps: dict[str, float] = {}
        self._last = time.perf_counter()

    def lap(self, name: str) -> None:
        now = time.perf_counter()
        self.laps[name], self._last = now - self._last, now
