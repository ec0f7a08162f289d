"""Plan on a discretisation that has passed its checks, and say what the plan is worth."""

import dataclasses

import numpy as np

from needlefem.arrays import Vector
from needlefem.errors import CaseError
from needlefem.insertion.ledger import ledger
from needlefem.insertion.simulation import Simulation, Watch
from needlefem.insertion.validity import validity
from needlefem.planning.accuracy import make_accurate
from needlefem.planning.making import Clock, Made, Wanted, make
from needlefem.planning.result import Attempt, Evidence, Plan
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
    goal, clock = np.asarray(chosen, dtype=float), Clock()
    wanted = Wanted(target=goal, search=search, all_solutions=all_solutions, clock=clock)
    if scene.planning.accuracy > 0.0:
        made, trail = make_accurate(scene, wanted, watch)
    else:
        made, trail = make(Simulation(scene, watch=watch), wanted), ()
    evidence = _evidence(made, trail)
    clock.lap("evidence")
    evidence = dataclasses.replace(evidence, timings=clock.laps)
    return dataclasses.replace(made.plan, evidence=evidence)


def _evidence(made: Made, trail: tuple[Attempt, ...]) -> Evidence:
    simulation, found = made.simulation, made.plan
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
        preflight=made.checks,
        ledger=energies,
        validity=strains,
        estimate=made.estimate,
        trail=trail,
        warnings=tuple(warnings),
        skipped=simulation.resolved.skipped,
        reasons=simulation.reasons,
        timings={},
    )
