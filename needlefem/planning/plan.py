"""Planning on a discretization that has passed its checks, with the estimate of the error."""

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from needlefem._arrays import Vector
from needlefem.checks.mesh_checks import overlaps
from needlefem.errors import CaseError
from needlefem.insertion.energy_balance import energy_terms
from needlefem.insertion.result import validity
from needlefem.insertion.simulation import Simulation, Watch, discretised
from needlefem.planning.adaptive import PlanAttempt, PlanRequest, Stopwatch, attempt_plan
from needlefem.planning.reading import at_rupture, ended_early, state_at
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
    target: ArrayLike | None = None,
    search: str | None = None,
    *,
    all_solutions: bool = False,
    watch: Watch | None = None,
) -> Plan:
    """Plan for a scene. Parameters, result and errors: see `needlefem.plan`."""
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
    rejected = tuple(_rejected(one) for one in found if one is not best)
    return dataclasses.replace(best, rejected_directions=rejected, evidence=_timed(best, found))


def _timed(best: Plan, found: Sequence[Plan]) -> Evidence | None:
    """Return the evidence of a plan with the total time of all directions."""
    if best.evidence is None:
        return None
    laps = [one.evidence.timings for one in found if one.evidence is not None]
    timings = {name: sum(lap.get(name, 0.0) for lap in laps) for name in best.evidence.timings}
    return dataclasses.replace(best.evidence, timings=timings)


def turned(scene: Scene, direction: Sequence[float]) -> Scene:
    """Return the scene with another needle direction and an open entry."""
    unit = np.asarray(direction, dtype=float) / np.linalg.norm(direction)
    return vary(scene, {"motion.direction": tuple(unit.tolist()), "motion.entry": ()})


def _rank(found: Plan) -> tuple[bool, float]:
    """Return the sort key of plans along several directions: first the status, then the error."""
    error = np.inf if found.best is None else found.best.placement_error
    return found.status is not PlanStatus.PLANNED, error


def _rejected(found: Plan) -> RejectedDirection:
    direction = tuple(found.insertion.axis.direction.tolist())
    return RejectedDirection(direction, found.status, found.sentence, found.insertions)


def _along(
    scene: Scene, target: Vector, search: str | None, all_solutions: bool, watch: Watch | None
) -> Plan:
    """Plan along the direction of the scene."""
    clock = Stopwatch()
    request = PlanRequest(target=target, search=search, all_solutions=all_solutions, clock=clock)
    if scene.planning.accuracy > 0.0:
        from needlefem.planning.adaptive import make_accurate  # noqa: PLC0415

        attempt, history = make_accurate(scene, request, watch)
    else:
        attempt, history = attempt_plan(Simulation(scene, watch=watch), request), ()
    evidence = _evidence(attempt, history)
    clock.lap("evidence")
    evidence = dataclasses.replace(evidence, timings=clock.laps)
    return with_headline(attempt.plan, evidence)


def _evidence(attempt: PlanAttempt, history: tuple[RefinementStep, ...]) -> Evidence:
    simulation, found = attempt.simulation, attempt.plan
    insertion, energies, strains = found.insertion, None, None
    warnings = [*simulation.warnings, *_movable_obstacles(simulation.scene)]
    warnings += overlaps(simulation.model.mesh, simulation.scene.contours)
    missing = {"estimate": attempt.not_estimated} if attempt.not_estimated else {}
    if found.best is None:
        missing |= dict.fromkeys(("energy", "validity"), "there is no release")
    elif ended_early(insertion):
        why = f"the insertion ended early: {insertion.outcome.sentence}"
        missing |= dict.fromkeys(("energy", "validity"), why)
    else:
        energies = energy_terms(insertion)
        depth = float(insertion.axis.axial_coordinate(found.best.release_point))
        if at_rupture(insertion, depth):
            missing["validity"] = "the tip advances at the depth of the release (rupture)"
        else:
            strains = validity(insertion, state_at(insertion, depth))
            warnings += strains.warnings()
        warnings += insertion.rupture_warnings
    return Evidence(
        preflight=attempt.checks,
        energy=energies,
        validity=strains,
        estimate=attempt.estimate,
        refinement_history=history,
        missing=missing,
        discretisation=discretised(simulation, attempt.entry),
        warnings=tuple(warnings),
        skipped=simulation.resolved.skipped,
        reasons=simulation.reasons,
        timings={},
    )


def _movable_obstacles(scene: Scene) -> list[str]:
    """Return a warning for each obstacle that may move with the tissue; this is not modeled."""
    supported = {name for support in scene.supports.values() for name in support.regions}
    return [
        f"obstacle '{name}' is not supported: its motion with the tissue is not modeled; "
        f"give a support with regions = ['{obstacle.region}']"
        for name, obstacle in scene.obstacles.items()
        if obstacle.region is not None and obstacle.region not in supported
    ]
