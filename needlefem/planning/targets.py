"""Many targets: how well the planner does on points drawn at random."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from needlefem.arrays import Points, Vector
from needlefem.errors import CaseError
from needlefem.insertion.simulation import Simulation
from needlefem.planning.planner import Planner
from needlefem.planning.result import Plan, PlanStatus, Release
from needlefem.scene import Scene


@dataclasses.dataclass(frozen=True, eq=False)
class TargetTable:
    """Plans of several targets."""

    plans: tuple[Plan, ...]

    @property
    def unsolved(self) -> tuple[Plan, ...]:
        """Plans whose search found no height that hits."""
        return tuple(plan for plan in self.plans if plan.status is not PlanStatus.PLANNED)

    @property
    def unplanned_mean(self) -> float:
        """Mean placement error without planning, over all targets, m."""
        return float(np.mean(self._unplanned()))

    @property
    def unplanned_sd(self) -> float:
        """Standard deviation (of the sample) of the same, m."""
        return float(np.std(self._unplanned(), ddof=1))

    @property
    def planned_mean(self) -> float:
        """Mean placement error after planning, over all targets, m."""
        return float(np.mean([_error(plan.best) for plan in self.plans]))

    def _unplanned(self) -> list[float]:
        return [_error(plan.unplanned) for plan in self.plans]


def _error(release: Release | None) -> float:
    return np.inf if release is None else release.placement_error


def draw_targets(scene: Scene) -> Points:
    """Return points drawn uniformly inside the region that the case names, shape (n, dim), m."""
    wanted = scene.targets
    if wanted is None:
        raise CaseError("targets", "missing", "add [targets] with a region, count and seed")
    contour = scene.regions[wanted.region].contour
    low, high = contour.points.min(axis=0), contour.points.max(axis=0)
    random = np.random.default_rng(wanted.seed)
    found: list[Vector] = []
    while len(found) < wanted.count:
        point = random.uniform(low, high)
        if contour.contains(point[None])[0]:
            found.append(point)
    return np.array(found)


def target_table(scene: Scene, targets: Points, searches: Sequence[str] = ()) -> TargetTable:
    """Plan every target, on one model; `searches` replaces the case's search for all."""
    simulation = Simulation(scene)
    plans = []
    for target in targets:
        planner = Planner(simulation, target)
        plans += [planner.plan(search) for search in searches or (None,)]
    return TargetTable(tuple(plans))
