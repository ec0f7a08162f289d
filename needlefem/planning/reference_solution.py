"""The exact tissue, as nearly as it can be had: what errors of placement are measured against."""

from collections.abc import Sequence

import numpy as np

from needlefem._arrays import Floats, Vector
from needlefem.errors import SimulationError
from needlefem.insertion.simulation import Simulation
from needlefem.planning.adaptive import MeshSizes, longest
from needlefem.planning.planner import Planner
from needlefem.planning.reading import InsertionReader
from needlefem.planning.result import Plan
from needlefem.scene import Scene, vary
from needlefem.scene.resolve import cell_shape

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
    points = {"discretisation.kernel_points": KERNEL_POINTS}
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
    beyond = depth + 3.0 * exact.scene.discretisation.path_spacing
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
