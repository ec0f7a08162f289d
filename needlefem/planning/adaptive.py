"""Plans on one discretisation or on a sequence of refined ones, and reference solutions."""

import dataclasses
import math
import time
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from needlefem._arrays import Floats, Vector
from needlefem._progress import doing
from needlefem.checks.result import CheckResult
from needlefem.errors import CaseError, SimulationError
from needlefem.insertion.simulation import Simulation, Watch
from needlefem.mesh.surface import Entry
from needlefem.planning.error_estimate import (
    HALVED,
    NoEstimateError,
    displacement_on,
    estimate,
    path_error,
)
from needlefem.planning.planner import Planner
from needlefem.planning.reading import InsertionReader
from needlefem.planning.result import ErrorEstimate, Plan, PlanStatus, RefinementStep
from needlefem.scene import BoxMesh, Scene, one_contour_size, vary
from needlefem.scene.resolve import cell_shape


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


# Element sizes and path spacing, chosen for an accuracy of the placement.


SQUARES = 9
"""Squares along the longest side of the box to begin with."""
CORRIDOR_RADII = 4.0
"""Width of the corridor over the tip's radius, where the case gives none."""
CELLS_ACROSS = 8
"""Cells of the contour's size across the smallest region, at the least."""
MARGIN = 0.8
"""Share of the accuracy that sizes are chosen for."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class MeshSizes:
    """What an accuracy is bought with, m.

    Parameters
    ----------
    corridor, contour, bulk : float
        Element sizes along the needle and at the regions' contours, side of the squares elsewhere.
    path : float
        Spacing of the cut path's pieces.
    """

    corridor: float
    contour: float
    bulk: float
    path: float

    @classmethod
    def first(cls, scene: Scene) -> "MeshSizes":
        """Return the coarsest sizes that a plan is tried with."""
        radius = scene.needle.tip_radius
        spans = [float(np.ptp(r.contour.points, axis=0).min()) for r in scene.regions.values()]
        return cls(
            corridor=0.5 * radius,
            contour=min([radius, *(span / CELLS_ACROSS for span in spans)]),
            bulk=longest(scene) / SQUARES,
            path=0.4 * radius,
        )

    def halved(self, *names: str) -> "MeshSizes":
        """Return them with some halved."""
        return dataclasses.replace(self, **{name: 0.5 * getattr(self, name) for name in names})

    def scene(self, scene: Scene, target: Vector) -> Scene:
        """Return the scene in these sizes, refined along the line through a target."""
        box, radius = _box(scene), scene.needle.tip_radius
        changes: dict[str, object] = {
            "target": tuple(float(x) for x in target),
            "motion.entry": (),
            "mesh.divisions": tuple(math.ceil(x / self.bulk - 1e-9) for x in box.size),
            "mesh.interfaces": "fitted",
            "mesh.refine.corridor_size": self.corridor,
            "mesh.refine.corridor_width": box.refine.corridor_width or CORRIDOR_RADII * radius,
            **one_contour_size(scene, self.contour if scene.regions else 0.0),
            "discretization.element": "auto",
            "discretization.tip_quadrature_points": 0,
            "discretization.path_spacing": self.path,
        }
        return vary(scene, changes)


def longest(scene: Scene) -> float:
    """Return the longest side of the scene's box, m."""
    return max(_box(scene).size)


def _box(scene: Scene) -> BoxMesh:
    if not isinstance(scene.mesh, BoxMesh):
        problem = "a mesh from a file has the sizes that it has"
        remedy = "leave it out and read the estimate, or give a box"
        raise CaseError("planning.accuracy", problem, remedy)
    return scene.mesh


def finer(
    sizes: MeshSizes, scene: Scene, simulation: Simulation, plan: Plan, share: float
) -> MeshSizes:
    """Return sizes with which the error falls to a share of what it is, each halved at most once.

    What each size does to the placement is measured by halving it alone; what is halved is taken
    to leave half of it.
    """
    parts = {"path": path_error(simulation, plan)}
    chosen: list[str] = []
    for name in ("corridor", "contour", "bulk") if scene.regions else ("corridor", "bulk"):
        other = Simulation(sizes.halved(name).scene(scene, plan.target))
        try:
            parts[name] = HALVED * float(np.linalg.norm(displacement_on(other, simulation, plan)))
        except NoEstimateError:
            chosen.append(name)  # what can't be measured is halved
    wanted = MARGIN * share * sum(parts.values())
    for name in sorted(parts, key=lambda name: -parts[name]):
        if sum(parts.values()) <= wanted:
            break
        parts[name] *= 0.5
        chosen.append(name)
    return sizes.halved(*chosen)


# Refinement until the stated error is at most the requested accuracy.


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


# Reference solutions on a much finer mesh, for the true placement error.


KERNEL_POINTS = 1600
REFERENCE_SQUARES = {"triangle": 36, "quadrilateral": 18}
"""Along the longest side of the box; one is cut into two triangles or six quadrilaterals."""
CORRIDOR, CONTOUR, PATH = 0.25, 0.5, 0.25
"""Element sizes along the needle and at contours, and path spacing, over the tip's radius."""
SPAN = 1e-4
"""Heights up to which placements are interpolated, on either side of the exact plan's, m."""


def reference(scene: Scene, target: Vector, cells: str = "triangle") -> Simulation:
    """Return a scene's tissue on the finest discretisation that is affordable.

    Elements are the quadratic ones that suit the tissue.

    Parameters
    ----------
    scene : Scene
        On a box.
    target : array, shape (dim,), m
        The needle's line passes near it.
    cells : str
        ``"triangle"`` or ``"quadrilateral"``: two that can be held against each other.
    """
    if cell_shape(scene) != cells:
        pattern = "diagonal" if cells == "triangle" else "quadrilateral"
        scene = vary(scene, {"mesh.pattern": pattern})
    radius = scene.needle.tip_radius
    sizes = MeshSizes(
        corridor=CORRIDOR * radius,
        contour=CONTOUR * radius,
        bulk=longest(scene) / REFERENCE_SQUARES[cells],
        path=PATH * radius,
    )
    points = {"discretization.tip_quadrature_points": KERNEL_POINTS}
    return Simulation(vary(sizes.scene(scene, target), points))


def true_error(exact: Simulation, plan: Plan) -> float:
    """Return how far from its target a plan's release places on a tissue taken as exact, m."""
    placed = placed_on(exact, plan)
    return np.inf if placed is None else float(np.linalg.norm(placed - plan.target))


def placed_on(exact: Simulation, plan: Plan) -> Vector | None:
    """Return where a plan's release places in a tissue, shape (dim,), m; None: nowhere."""
    if plan.best is None:
        return None
    entry = exact.entry_through(plan.best.release_point)
    depth = float(exact.direction @ (plan.best.release_point - entry.point))
    beyond = depth + 3.0 * exact.scene.discretization.path_spacing
    found = exact.insert(entry, lambda state: state.depth > beyond)
    reach = InsertionReader(found, plan.target).at_depth(depth).reach
    return None if reach is None else reach.point


class ReferenceSolution:
    """Where releases near a target place on the exact tissue, from a few insertions there.

    The placement is smooth in the height: between three insertions at heights that span those of
    the releases it is interpolated. Beyond `SPAN` on either side, and deeper, a release has its own
    insertion.

    Parameters
    ----------
    scene : Scene
        On a box.
    target : array, shape (dim,), m

    Attributes
    ----------
    release : array, shape (dim,), m
        That hits the target there.
    """

    def __init__(self, scene: Scene, target: Vector) -> None:
        self._simulation, self._target = reference(scene, target), target
        self._planner = Planner(self._simulation, target)
        found = self._planner.plan("root")
        if found.best is None:
            raise SimulationError(f"no plan on the tissue taken as exact: {found.sentence}")
        self.release = found.best.release_point
        self._middle = found.solution.height

    @property
    def unknowns(self) -> int:
        """Unknowns of the tissue."""
        return len(self._simulation.model.free_dofs)

    def errors(self, plans: Sequence[Plan]) -> list[float]:
        """Return how far from the target plans place, m; infinite where nothing is placed."""
        return [self.error(made) for made in plans]

    def error(self, made: Plan) -> float:
        """Return how far from the target a plan places, m; infinite where nothing is placed."""
        if made.best is None:
            return np.inf
        apart = made.best.release_point - self._target
        height: Floats = self._planner.laterals @ apart
        if len(height) > 1 or abs(float(height[0] - self._middle[0])) > SPAN:
            return true_error(self._simulation, made)
        depth = float(self._simulation.direction @ made.best.release_point)
        heights = [self._middle + share * SPAN for share in (-1.0, 0.0, 1.0)]
        reached = [self._at(h, depth) for h in heights]
        place = float(height[0] - self._middle[0]) / SPAN
        shares = (0.5 * place * (place - 1.0), 1.0 - place**2, 0.5 * place * (place + 1.0))
        placed = np.zeros(len(self._target))
        for share, point in zip(shares, reached, strict=True):
            if point is None:
                return true_error(self._simulation, made)
            placed += share * point
        return float(np.linalg.norm(placed - self._target))

    def _at(self, height: Floats, depth: float) -> Vector | None:
        """Return what the tip reaches at a height when it is at a depth in the world.

        None: deeper than the insertions that a plan needs.
        """
        known = self._planner.read(height)
        entry = float(self._simulation.direction @ known.insertion.axis.entry)
        reach = known.at_depth(depth - entry).reach
        return None if reach is None else reach.point
