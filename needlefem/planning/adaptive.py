"""Plans on one discretization or on a sequence of refined ones, and reference solutions."""

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
    """Seconds between calls of `lap`, summed by name."""

    def __init__(self) -> None:
        self.laps: dict[str, float] = {}
        self._last = time.perf_counter()

    def lap(self, name: str) -> None:
        """Add the time since the last call to a name."""
        now = time.perf_counter()
        self.laps[name] = self.laps.get(name, 0.0) + now - self._last
        self._last = now


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class PlanRequest:
    """Target and options of a plan.

    Parameters
    ----------
    target : array, shape (dim,), m
    search : str or None
        See `needlefem.plan`.
    all_solutions : bool
        Whether to search further lateral offsets that reach the target.
    clock : Stopwatch
    """

    target: Vector
    search: str | None = None
    all_solutions: bool = False
    clock: Stopwatch = dataclasses.field(default_factory=Stopwatch)


class PlanAttempt(NamedTuple):
    """A plan on one discretization, with the estimate of its error or the reason for none."""

    simulation: Simulation
    entry: Entry
    checks: tuple[CheckResult, ...]
    plan: Plan
    estimate: ErrorEstimate | None
    not_estimated: str = ""


def attempt_plan(
    simulation: Simulation, request: PlanRequest, start: Floats | None = None, *, path: bool = False
) -> PlanAttempt:
    """Check the discretization, plan, and estimate the error of the discretization.

    Parameters
    ----------
    simulation : Simulation
    request : PlanRequest
    start : array, shape (dim - 1,), m, optional
        Initial lateral offset.
    path : bool
        Whether the error is estimated whatever the scene prescribes, including that of the path
        spacing.

    Raises
    ------
    CheckFailedError
        The discretization fails a check.
    """
    clock = request.clock
    if simulation.scene.motion.entry:
        simulation.entry_of_case()  # raises an error if the entry of the case is not valid
    planner = Planner(simulation, request.target)
    clock.lap("model")
    checks = simulation.check(planner.entry)
    clock.lap("preflight")
    found = planner.plan(request.search, all_solutions=request.all_solutions, start=start)
    clock.lap("search")
    error, why = None, ""
    if path or simulation.scene.planning.estimate:
        doing("estimating the placement error due to the mesh")
        try:
            error = estimate(simulation, found, path=path)
        except NoEstimateError as reason:
            why = str(reason)
        clock.lap("estimate")
    return PlanAttempt(simulation, planner.entry, checks, found, error, why)


# Element sizes and path spacing, chosen for an accuracy of the placement.


SQUARES = 9
"""Squares along the longest side of the box in the first discretization."""
CORRIDOR_RADII = 4.0
"""Default width of the corridor, over the tip radius."""
CELLS_ACROSS = 8
"""Smallest number of cells of the size at contours across the smallest region."""
MARGIN = 0.8
"""Share of the accuracy for which sizes are chosen."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class MeshSizes:
    """Element sizes and path spacing that are refined to reach an accuracy, m.

    Parameters
    ----------
    corridor, contour, bulk : float
        Element sizes along the needle and at the contours of regions; side of the squares
        elsewhere.
    path : float
        Path spacing.
    """

    corridor: float
    contour: float
    bulk: float
    path: float

    @classmethod
    def first(cls, scene: Scene) -> "MeshSizes":
        """Return the coarsest sizes, with which refinement begins."""
        radius = scene.needle.tip_radius
        spans = [float(np.ptp(r.contour.points, axis=0).min()) for r in scene.regions.values()]
        return cls(
            corridor=0.5 * radius,
            contour=min([radius, *(span / CELLS_ACROSS for span in spans)]),
            bulk=longest(scene) / SQUARES,
            path=0.4 * radius,
        )

    def halved(self, *names: str) -> "MeshSizes":
        """Return the sizes with those of some names halved."""
        return dataclasses.replace(self, **{name: 0.5 * getattr(self, name) for name in names})

    def scene(self, scene: Scene, target: Vector) -> Scene:
        """Return the scene with these sizes, refined along the axis through a target."""
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
    """Return the longest side of the box of a scene, m."""
    return max(_box(scene).size)


def _box(scene: Scene) -> BoxMesh:
    if not isinstance(scene.mesh, BoxMesh):
        problem = "a mesh from a file has fixed element sizes"
        remedy = "omit planning.accuracy and read the estimate, or use a box"
        raise CaseError("planning.accuracy", problem, remedy)
    return scene.mesh


def finer(
    sizes: MeshSizes, scene: Scene, simulation: Simulation, plan: Plan, share: float
) -> MeshSizes:
    """Return sizes for which the error is reduced to a share of its value.

    Each size is halved at most once. The effect of each size on the placement is computed by
    halving it alone. Halving a size is assumed to halve its effect.
    """
    parts = {"path": path_error(simulation, plan)}
    chosen: list[str] = []
    for name in ("corridor", "contour", "bulk") if scene.regions else ("corridor", "bulk"):
        other = Simulation(sizes.halved(name).scene(scene, plan.target))
        try:
            parts[name] = HALVED * float(np.linalg.norm(displacement_on(other, simulation, plan)))
        except NoEstimateError:
            chosen.append(name)  # without an estimate, the size is halved
    request = MARGIN * share * sum(parts.values())
    for name in sorted(parts, key=lambda name: -parts[name]):
        if sum(parts.values()) <= request:
            break
        parts[name] *= 0.5
        chosen.append(name)
    return sizes.halved(*chosen)


# Refinement until the stated error is at most the requested accuracy.


def make_accurate(
    scene: Scene, request: PlanRequest, watch: Watch | None = None
) -> tuple[PlanAttempt, tuple[RefinementStep, ...]]:
    """Return the first plan whose stated error is within the accuracy, and all attempts.

    Each refinement halves the sizes with the largest effect, and starts at the lateral offset of
    the plan before.

    Raises
    ------
    CaseError
        The mesh is from a file.
    CheckFailedError
        A discretization fails a check.
    """
    accuracy, most = scene.planning.accuracy, scene.planning.max_unknowns
    sizes, history = MeshSizes.first(scene), list[RefinementStep]()
    attempt = attempt_plan(
        Simulation(sizes.scene(scene, request.target), watch=watch), request, path=True
    )
    while attempt.plan.status is PlanStatus.PLANNED and attempt.estimate is not None:
        error = attempt.estimate
        history.append(_attempt(attempt, sizes, error))
        if error.at_most <= accuracy:
            break
        sizes = finer(sizes, scene, attempt.simulation, attempt.plan, accuracy / error.at_most)
        request.clock.lap("estimate")
        simulation = Simulation(sizes.scene(scene, request.target), watch=watch)
        if len(simulation.model.free_dofs) > most:
            attempt = attempt._replace(plan=_not_affordable(attempt.plan, error, accuracy, most))
            break
        attempt = attempt_plan(simulation, request, attempt.plan.solution.height, path=True)
    if attempt.plan.status is PlanStatus.PLANNED and attempt.estimate is None:
        unverified = _without_estimate(attempt.plan, attempt.not_estimated, accuracy)
        attempt = attempt._replace(plan=unverified)
    return attempt, tuple(history)


def _without_estimate(plan: Plan, why: str, accuracy: float) -> Plan:
    sentence = (
        f"the accuracy {1e3 * accuracy:.3g} mm cannot be verified, because the error cannot be "
        f"estimated: {why}; omit planning.accuracy to plan without it"
    )
    return dataclasses.replace(plan, status=PlanStatus.NOT_ACCURATE, sentence=sentence)


def _attempt(attempt: PlanAttempt, sizes: MeshSizes, error: ErrorEstimate) -> RefinementStep:
    return RefinementStep(
        element=attempt.simulation.model.element.name,
        corridor=sizes.corridor,
        contour=sizes.contour,
        bulk=sizes.bulk,
        path=sizes.path,
        unknowns=len(attempt.simulation.model.free_dofs),
        insertions=attempt.plan.insertions,
        error=error.error,
        at_most=error.at_most,
    )


def _not_affordable(plan: Plan, error: ErrorEstimate, accuracy: float, most: int) -> Plan:
    sentence = (
        f"the accuracy {1e3 * accuracy:.3g} mm needs more than {most:,} unknowns; the stated error "
        f"is {1e3 * error.at_most:.2g} mm; increase planning.accuracy or planning.max_unknowns"
    )
    return dataclasses.replace(plan, status=PlanStatus.NOT_ACCURATE, sentence=sentence)


# Reference solutions on a much finer mesh, for the true placement error.


KERNEL_POINTS = 1600
REFERENCE_SQUARES = {"triangle": 36, "quadrilateral": 18}
"""Squares along the longest side of the box.

Each is divided into two triangles or six quadrilaterals.
"""
CORRIDOR, CONTOUR, PATH = 0.25, 0.5, 0.25
"""Element sizes along the needle and at contours, and path spacing, over the tip radius."""
SPAN = 1e-4
"""Distance from the lateral offset of the exact plan up to which placements are interpolated, m."""


def reference(scene: Scene, target: Vector, cells: str = "triangle") -> Simulation:
    """Return a simulation of a scene on the finest affordable discretization.

    Parameters
    ----------
    scene : Scene
        On a box.
    target : array, shape (dim,), m
        The needle axis passes near it.
    cells : str
        ``"triangle"`` or ``"quadrilateral"``, so that two references can be compared. The elements
        are the quadratic ones that suit the tissue.
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
    """Return the placement error of a plan on tissue that is taken as exact, m."""
    placed = placed_on(exact, plan)
    return np.inf if placed is None else float(np.linalg.norm(placed - plan.target))


def placed_on(exact: Simulation, plan: Plan) -> Vector | None:
    """Return the final position of a plan's release in a tissue, shape (dim,), m, or None."""
    if plan.best is None:
        return None
    entry = exact.entry_through(plan.best.release_point)
    depth = float(exact.direction @ (plan.best.release_point - entry.point))
    beyond = depth + 3.0 * exact.scene.discretization.path_spacing
    found = exact.insert(entry, lambda state: state.depth > beyond)
    reach = InsertionReader(found, plan.target).at_depth(depth).reach
    return None if reach is None else reach.point


class ReferenceSolution:
    """Final positions of releases near a target in tissue that is taken as exact.

    The final position is a smooth function of the lateral offset. It is interpolated between three
    insertions. A release further than `SPAN` from the exact one, or a deeper one, has its own
    insertion.

    Parameters
    ----------
    scene : Scene
        On a box.
    target : array, shape (dim,), m

    Attributes
    ----------
    release : array, shape (dim,), m
        Release point whose final position in this tissue is the target.
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
        """Number of unknowns of the reference."""
        return len(self._simulation.model.free_dofs)

    def errors(self, plans: Sequence[Plan]) -> list[float]:
        """Return the placement errors of plans, m; infinite if nothing is placed."""
        return [self.error(attempt) for attempt in plans]

    def error(self, attempt: Plan) -> float:
        """Return the placement error of a plan, m; infinite if nothing is placed."""
        if attempt.best is None:
            return np.inf
        apart = attempt.best.release_point - self._target
        height: Floats = self._planner.laterals @ apart
        if len(height) > 1 or abs(float(height[0] - self._middle[0])) > SPAN:
            return true_error(self._simulation, attempt)
        depth = float(self._simulation.direction @ attempt.best.release_point)
        heights = [self._middle + share * SPAN for share in (-1.0, 0.0, 1.0)]
        reached = [self._at(h, depth) for h in heights]
        place = float(height[0] - self._middle[0]) / SPAN
        shares = (0.5 * place * (place - 1.0), 1.0 - place**2, 0.5 * place * (place + 1.0))
        placed = np.zeros(len(self._target))
        for share, point in zip(shares, reached, strict=True):
            if point is None:
                return true_error(self._simulation, attempt)
            placed += share * point
        return float(np.linalg.norm(placed - self._target))

    def _at(self, height: Floats, depth: float) -> Vector | None:
        """Return the material point at the tip for a lateral offset and a depth.

        The depth is an axial coordinate in space, m. None if it is deeper than the insertion for a
        plan.
        """
        known = self._planner.read(height)
        entry = float(self._simulation.direction @ known.insertion.axis.entry)
        reach = known.at_depth(depth - entry).reach
        return None if reach is None else reach.point
