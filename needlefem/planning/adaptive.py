"""Plan on finer and finer discretisations until the stated error is within what was asked for."""

import dataclasses

from needlefem.insertion.simulation import Simulation, Watch
from needlefem.planning.making import PlanAttempt, PlanRequest, attempt_plan
from needlefem.planning.result import ErrorEstimate, Plan, PlanStatus, RefinementStep
from needlefem.planning.sizes import MeshSizes, finer
from needlefem.scene import Scene


def make_accurate(
    scene: Scene, wanted: PlanRequest, watch: Watch | None = None
) -> tuple[PlanAttempt, tuple[RefinementStep, ...]]:
    """Return the first plan that is accurate enough, and all discretisations tried.

    Each refines what the one before says matters, and starts at its height.

    Raises
    ------
    CaseError
        The mesh is from a file.
    CheckFailedError
        A discretisation fails a check.
    """
    accuracy, most = scene.planning.accuracy, scene.planning.max_unknowns
    sizes, trail = MeshSizes.first(scene), list[RefinementStep]()
    made = attempt_plan(
        Simulation(sizes.scene(scene, wanted.target), watch=watch), wanted, path=True
    )
    while made.plan.status is PlanStatus.PLANNED and made.estimate is not None:
        error = made.estimate
        trail.append(_attempt(made, sizes, error))
        if error.at_most <= accuracy:
            break
        sizes = finer(sizes, scene, made.simulation, made.plan, accuracy / error.at_most)
        wanted.clock.lap("estimate")
        simulation = Simulation(sizes.scene(scene, wanted.target), watch=watch)
        if len(simulation.model.free_dofs) > most:
            made = made._replace(plan=_short(made.plan, error, accuracy, most))
            break
        made = attempt_plan(simulation, wanted, made.plan.solution.height, path=True)
    if made.plan.status is PlanStatus.PLANNED and made.estimate is None:
        made = made._replace(plan=_unknown(made.plan, made.not_estimated, accuracy))
    return made, tuple(trail)


def _unknown(plan: Plan, why: str, accuracy: float) -> Plan:
    sentence = (
        f"{1e3 * accuracy:.3g} mm were asked for, but the error can't be estimated: {why}; "
        "leave planning.accuracy out to plan without"
    )
    return dataclasses.replace(plan, status=PlanStatus.NOT_ACCURATE, sentence=sentence)


def _attempt(made: PlanAttempt, sizes: MeshSizes, error: ErrorEstimate) -> RefinementStep:
    return RefinementStep(
        element=made.simulation.model.element.name,
        corridor=sizes.corridor,
        contour=sizes.contour,
        bulk=sizes.bulk,
        path=sizes.path,
        unknowns=len(made.simulation.model.free_dofs),
        insertions=made.plan.insertions,
        error=error.error,
        at_most=error.at_most,
    )


def _short(plan: Plan, error: ErrorEstimate, accuracy: float, most: int) -> Plan:
    sentence = (
        f"{1e3 * accuracy:.3g} mm were asked for, {1e3 * error.at_most:.2g} mm are what can be had "
        f"with {most:,} unknowns; ask for less, or allow more by planning.max_unknowns"
    )
    return dataclasses.replace(plan, status=PlanStatus.NOT_ACCURATE, sentence=sentence)
