"""Plans for many random targets."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from needlefem._arrays import Ints, Points, SkfemMesh, Vector
from needlefem._table import Table
from needlefem.errors import CaseError
from needlefem.insertion.simulation import Simulation
from needlefem.mesh.file import read_mesh
from needlefem.mesh.generation import group_cells
from needlefem.planning.planner import Planner
from needlefem.planning.result import Plan, PlanStatus, Release
from needlefem.scene import FileMesh, Scene


@dataclasses.dataclass(frozen=True, eq=False)
class TargetTable:
    """Plans of several targets."""

    plans: tuple[Plan, ...]

    @property
    def unsolved(self) -> tuple[Plan, ...]:
        """Plans whose search found no root."""
        return tuple(plan for plan in self.plans if plan.status is not PlanStatus.PLANNED)

    @property
    def unplanned_mean(self) -> float:
        """Mean error of the unplanned insertions with a known result, m."""
        return float(np.mean(self._unplanned()))

    @property
    def unplanned_sd(self) -> float:
        """Sample standard deviation of these errors, m."""
        return float(np.std(self._unplanned(), ddof=1))

    @property
    def planned_mean(self) -> float:
        """Mean placement error of the plans, m."""
        return float(np.mean(_known([plan.best for plan in self.plans])))

    @property
    def unknown(self) -> tuple[Plan, ...]:
        """Plans whose unplanned release is unknown, because its insertion ended early."""
        return tuple(plan for plan in self.plans if plan.unplanned is None)

    def _unplanned(self) -> list[float]:
        return _known([plan.unplanned for plan in self.plans])


def _known(releases: Sequence[Release | None]) -> list[float]:
    """Return the errors of the known releases; NaN for the others."""
    errors = [release.placement_error for release in releases if release is not None]
    return errors or [np.nan]


def _error(release: Release | None) -> str | float:
    return "not known" if release is None else 100.0 * release.placement_error


def draw_targets(scene: Scene) -> Points:
    """Return points drawn uniformly inside the region that the case names, shape (n, dim), m.

    For a group of the mesh file they are drawn in its cells: in all of its parts, not in its holes.
    """
    wanted = scene.targets
    if wanted is None:
        raise CaseError("targets", "missing", "add [targets] with a region, count and seed")
    group = scene.regions[wanted.region].group
    if group is not None and isinstance(scene.mesh, FileMesh):
        mesh = read_mesh(scene.mesh.path, scene.mesh.unit)
        cells = group_cells(mesh, group, f"regions.{wanted.region}.group")
        return _in_cells(mesh, cells, wanted.count, np.random.default_rng(wanted.seed))
    contour = scene.regions[wanted.region].contour
    low, high = contour.points.min(axis=0), contour.points.max(axis=0)
    random = np.random.default_rng(wanted.seed)
    found: list[Vector] = []
    while len(found) < wanted.count:
        point = random.uniform(low, high)
        if contour.contains(point[None])[0]:
            found.append(point)
    return np.array(found)


def _in_cells(mesh: SkfemMesh, cells: Ints, count: int, random: np.random.Generator) -> Points:
    """Return points drawn uniformly in cells of a plane mesh, shape (count, 2), m."""
    corners = mesh.p[:, mesh.t[:, cells]].transpose(2, 1, 0)
    fans = [corners[:, [0, n, n + 1]] for n in range(1, corners.shape[1] - 1)]
    triangles = np.concatenate(fans)  # a quadrilateral consists of two triangles
    one, other = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    areas = np.abs(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0])
    chosen = random.choice(len(areas), size=count, p=areas / areas.sum())
    shares = random.uniform(size=(count, 2))
    beyond = shares.sum(axis=1) > 1.0
    shares[beyond] = 1.0 - shares[beyond]
    found: Points = (
        triangles[chosen, 0] + shares[:, :1] * one[chosen] + shares[:, 1:] * other[chosen]
    )
    return found


def target_table(scene: Scene, targets: Points) -> TargetTable:
    """Plan each target on one model."""
    simulation = Simulation(scene)
    return TargetTable(tuple(Planner(simulation, target).plan() for target in targets))


def _row(plan: Plan, golden: Plan) -> list[object]:
    return [
        *(100.0 * plan.target).tolist(),
        _error(plan.unplanned),
        _error(plan.best),
        plan.insertions,
        _error(golden.best),
        golden.insertions,
        len(plan.insertion.ruptures),
        plan.status,
    ]


def study(scene: Scene, other: Scene | None = None) -> list[Table]:
    """Return one row per target: errors without and with a plan, and the cost of both searches."""
    del other
    targets = draw_targets(scene)
    found = target_table(scene, targets)
    golden = Simulation(scene)
    by_golden = [Planner(golden, plan.target).plan("golden") for plan in found.plans]
    rows = [_row(*pair) for pair in zip(found.plans, by_golden, strict=True)]
    summary = {
        "unplanned_mean": found.unplanned_mean,
        "unplanned_sd": found.unplanned_sd,
        "planned_mean": found.planned_mean,
        "unsolved": len(found.unsolved),
        "unknown": len(found.unknown),
        "snaps": sum(len(plan.insertion.ruptures) for plan in found.plans),
        "most_insertions": max(plan.insertions for plan in found.plans),
        "golden_insertions": max(plan.insertions for plan in by_golden),
    }
    return [
        Table(
            title=f"{len(targets)} targets drawn in '{scene.targets and scene.targets.region}'",
            columns=(
                *(f"{axis} (cm)" for axis in scene.axes),
                "unplanned (cm)",
                "planned (cm)",
                "insertions",
                "golden (cm)",
                "insertions ",
                "ruptures",
                "status",
            ),
            rows=rows,
            note=f"means: unplanned {100 * found.unplanned_mean:.3f} cm (SD "
            f"{100 * found.unplanned_sd:.3f}), planned {100 * found.planned_mean:.1e} cm; "
            f"{len(found.unsolved)} without a solution"
            + (f", {len(found.unknown)} unplanned not computed" if found.unknown else ""),
            summary=summary,
        )
    ]
