"""Planning on a discretisation that has passed its checks, with the estimate of the error."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from needlefem._arrays import Vector
from needlefem.checks.mesh_checks import overlaps
from needlefem.errors import CaseError
from needlefem.insertion.energy_balance import energy_terms
from needlefem.insertion.simulation import Simulation, Watch, discretised
from needlefem.insertion.strain_check import validity
from needlefem.planning.adaptive import PlanAttempt, PlanRequest, Stopwatch, attempt_plan
from needlefem.planning.reading import at_jump, broke_off, state_at
from needlefem.planning.result import (
    Evidence,
    Plan,
    PlanStatus,
    RefinementStep,
    RejectedDirection,
    with_headline,
)
from needlefem.scene import Scene, point_of, vary


def plan(
    scene: Scene,
    target: Any = None,
    search: str | None = None,
    *,
    all_solutions: bool = False,
    watch: Watch | None = None,
) -> Plan:
    """Plan for a scene; parameters, result and errors are those of `needlefem.plan`."""
    chosen = target if target is not None else scene.target
    if chosen is None:
        raise CaseError("target.point", "missing", "give a target to plan for")
    point = np.array(point_of(chosen, scene.dim, "target.point"))
    if search is not None:
        search = dataclasses.replace(scene.planning, search=search).search
    found = [_along(scene, point, search, all_solutions, watch)]
    for direction in scene.planning.directions if found[0].blocked is not None else ():
        if found[-1].status is PlanStatus.PLANNED:
            break
        found.append(_along(turned(scene, direction), point, search, all_solutions, watch))
    best = min(found, key=_rank)
    refused = tuple(_refusal(one) for one in found if one is not best)
    return dataclasses.replace(best, rejected_directions=refused, evidence=_timed(best, found))


def _timed(best: Plan, found: Sequence[Plan]) -> Evidence | None:
    """Return a plan's evidence with the time that all directions took."""
    if best.evidence is None:
        return None
    laps = [one.evidence.timings for one in found if one.evidence is not None]
    timings = {name: sum(lap.get(name, 0.0) for lap in laps) for name in best.evidence.timings}
    return dataclasses.replace(best.evidence, timings=timings)


def turned(scene: Scene, direction: Sequence[float]) -> Scene:
    """Return the scene with a needle of another direction, its entry left open."""
    unit = np.asarray(direction, dtype=float) / np.linalg.norm(direction)
    return vary(scene, {"motion.direction": tuple(unit.tolist()), "motion.entry": ()})


def _rank(found: Plan) -> tuple[bool, float]:
    """Rank plans along several directions: those that succeeded, then by error."""
    error = np.inf if found.best is None else found.best.placement_error
    return found.status is not PlanStatus.PLANNED, error


def _refusal(found: Plan) -> RejectedDirection:
    direction = tuple(found.insertion.axis.direction.tolist())
    return RejectedDirection(direction, found.status, found.sentence, found.insertions)


def _along(
    scene: Scene, target: Vector, search: str | None, all_solutions: bool, watch: Watch | None
) -> Plan:
    """Plan along the scene's direction."""
    clock = Stopwatch()
    wanted = PlanRequest(target=target, search=search, all_solutions=all_solutions, clock=clock)
    if scene.planning.accuracy > 0.0:
        from needlefem.planning.adaptive import make_accurate  # noqa: PLC0415

        made, trail = make_accurate(scene, wanted, watch)
    else:
        made, trail = attempt_plan(Simulation(scene, watch=watch), wanted), ()
    evidence = _evidence(made, trail)
    clock.lap("evidence")
    evidence = dataclasses.replace(evidence, timings=clock.laps)
    return with_headline(made.plan, evidence)


def _evidence(made: PlanAttempt, trail: tuple[RefinementStep, ...]) -> Evidence:
    simulation, found = made.simulation, made.plan
    insertion, energies, strains = found.insertion, None, None
    warnings = [*simulation.warnings, *_loose(simulation.scene)]
    warnings += overlaps(simulation.model.mesh, simulation.scene.contours)
    missing = {"estimate": made.not_estimated} if made.not_estimated else {}
    if found.best is None:
        missing |= dict.fromkeys(("energy", "validity"), "there is no release")
    elif broke_off(insertion):
        why = f"the insertion broke off: {insertion.outcome.sentence}"
        missing |= dict.fromkeys(("energy", "validity"), why)
    else:
        energies = energy_terms(insertion)
        depth = float(insertion.axis.axial_coordinate(found.best.release_point))
        if at_jump(insertion, depth):
            missing["validity"] = "the tip jumps at the depth of the release"
        else:
            strains = validity(insertion, state_at(insertion, depth))
            warnings += strains.warnings()
        if insertion.ruptures:
            warnings.append(f"the tip jumps ahead {len(insertion.ruptures)} times on its way")
    return Evidence(
        preflight=made.checks,
        energy=energies,
        validity=strains,
        estimate=made.estimate,
        refinement_history=trail,
        missing=missing,
        discretisation=discretised(simulation, made.entry),
        warnings=tuple(warnings),
        skipped=simulation.resolved.skipped,
        reasons=simulation.reasons,
        timings={},
    )


def _loose(scene: Scene) -> list[str]:
    """Say which obstacles may move with the tissue, which is not seen."""
    held = {name for support in scene.supports.values() for name in support.regions}
    return [
        f"obstacle '{name}' is not held: that it moves with the tissue is not seen; "
        f"give a support with regions = ['{obstacle.region}']"
        for name, obstacle in scene.obstacles.items()
        if obstacle.region is not None and obstacle.region not in held
    ]
