"""Plan where to release so that the point ends on the target."""

import numpy as np

from needlefem.arrays import Floats, Vector
from needlefem.errors import CaseError
from needlefem.insertion.path import Path, Reach
from needlefem.insertion.result import Insertion
from needlefem.insertion.simulation import Simulation
from needlefem.insertion.state import State
from needlefem.planning.result import Plan, PlanStatus, Release
from needlefem.planning.search import (
    Found,
    Solution,
    golden_section,
    grid,
    sign_changes,
    signed_root,
)

BEYOND = 3
"""States computed beyond the target, so that interpolation there is central."""
SCAN = 9
"""Heights of the coarse scan for further solutions."""


class Planner:
    """Plans for one target in one simulation.

    Parameters
    ----------
    simulation : Simulation
    target : array, shape (dim,), m

    Raises
    ------
    CaseError
        The target lies outside the tissue.
    """

    def __init__(self, simulation: Simulation, target: Vector) -> None:
        self.simulation, self.target = simulation, target
        cells, _ = simulation.model.interpolation.locator.find(target[None])
        if cells[0] < 0:
            where = "(" + ", ".join(f"{100 * x:.4g}" for x in target) + ") cm"
            raise CaseError("target.point", f"{where} is outside the tissue", "move it inside")
        self.entry = simulation.entry_through(target)
        self.laterals = simulation.instrument(self.entry).axis.laterals
        self._level: Floats = np.zeros(len(self.laterals))
        self._known: dict[tuple[float, ...], tuple[Insertion, Path]] = {}

    def path(self, height: Floats) -> Path:
        """Return the cut path at a height (shape (dim - 1,), m, relative to the target's)."""
        return self._insert(height)[1]

    def _insert(self, height: Floats) -> tuple[Insertion, Path]:
        key = tuple(float(h) for h in height)
        if key not in self._known:
            entry = self.simulation.entry_through(self.target + height @ self.laterals)
            insertion = self.simulation.insert(entry, self._passed(entry.point))
            self._known[key] = insertion, Path(insertion)
        return self._known[key]

    def _passed(self, entry: Vector) -> "_Passed":
        direction = self.simulation.direction
        return _Passed(direction, float(direction @ self.target), float(direction @ entry))

    def miss(self, height: Floats) -> Floats | None:
        """Return the signed lateral miss at a height; see `search.Miss`."""
        reach = self.path(height).abeam(self.target)
        if reach is None:
            return None
        lateral: Floats = self.laterals @ (reach.point - self.target)
        return lateral

    def error(self, height: float) -> float:
        """Return the placement error at the best depth of a height; see `search.Error`."""
        reach = self.path(np.array([height])).closest(self.target)
        return np.inf if reach is None else float(np.linalg.norm(reach.point - self.target))

    def release(self, height: Floats, reach: Reach | None) -> Release | None:
        """Return the release in the world that ends at a reached point."""
        if reach is None:
            return None
        entry = self._insert(height)[0].axis.entry
        error = float(np.linalg.norm(reach.point - self.target))
        return Release(entry + reach.depth * self.simulation.direction, reach.point, error)

    def unplanned(self) -> Release | None:
        """Return the release with the tip at the target in the world, as if nothing moved."""
        path = self.path(self._level)
        depth = float(self.simulation.direction @ (self.target - path.entry))
        return self.release(self._level, path.at_depth(depth))

    def depth_only(self) -> Release | None:
        """Return the best release at the target's height."""
        return self.release(self._level, self.path(self._level).closest(self.target))

    def snapped(self) -> bool:
        """Say whether the tip jumped in any insertion so far."""
        return any(insertion.snaps for insertion, _ in self._known.values())

    def plan(
        self,
        search: str | None = None,
        *,
        all_solutions: bool = False,
        start: Floats | None = None,
    ) -> Plan:
        """Search the height, a root from `start`; see `needlefem.plan`."""
        before = self.simulation.insertions
        search = search or self.simulation.scene.planning.search
        solution = self._search(search, self._level if start is None else start)
        spent = self.simulation.insertions - before
        status, sentence = self._judge(solution)
        best = self._best_reach(solution)
        scanned = self.simulation.insertions
        others = self._others(solution) if all_solutions else None
        return Plan(
            status=status,
            sentence=sentence,
            target=self.target,
            best=self.release(solution.height, best),
            unplanned=self.unplanned(),
            depth_only=self.depth_only(),
            search=search,
            solution=solution,
            insertions=spent,
            insertion=self._insert(solution.height)[0],
            level=self._insert(self._level)[0],
            other_solutions=others,
            scan_insertions=self.simulation.insertions - scanned,
        )

    def _search(self, search: str, start: Floats) -> Solution:
        numbers = self.simulation.scene.planning
        low, high = numbers.height_range
        if search == "root":
            return self._root(start, (low, high))
        if len(self.laterals) != 1:
            raise CaseError("planning.search", f"'{search}' is for 2D scenes", "use 'root'")
        method = golden_section if search == "golden" else grid
        return method(self.error, low, high, numbers.golden_tolerance)

    def _best_reach(self, solution: Solution) -> Reach | None:
        path = self.path(solution.height)
        # a root is solved level with the target; elsewhere the nearest point counts
        level = path.abeam(self.target) if solution.found is Found.SOLVED else None
        return level if level is not None else path.closest(self.target)

    def _root(self, start: Floats, within: tuple[float, float]) -> Solution:
        numbers = self.simulation.scene.planning
        most = numbers.max_insertions
        return signed_root(self.miss, start, within, numbers.tolerance, most)

    def _others(self, solution: Solution) -> tuple[float, ...]:
        """Return further heights in the range that hit the target, from a coarse scan."""
        if len(self.laterals) != 1:
            raise CaseError("--all-solutions", "is for 2D scenes", "leave it out")
        low, high = self.simulation.scene.planning.height_range
        found = []
        for a, b in sign_changes(self.miss, low, high, SCAN):
            if not a <= float(solution.height[0]) <= b:
                root = self._root(np.array([0.5 * (a + b)]), (a, b))
                if root.found is Found.SOLVED:
                    found.append(float(root.height[0]))
        return tuple(found)

    def _judge(self, solution: Solution) -> tuple[PlanStatus, str]:
        """Put the end of the search into a status and a sentence."""
        low, high = self.simulation.scene.planning.height_range
        missed = f"the best height tried misses by {100 * solution.miss:.3g} cm"
        if solution.found is Found.SOLVED:
            return PlanStatus.PLANNED, f"misses by {100 * solution.miss:.2g} cm on this model"
        if solution.found is Found.OUTSIDE_RANGE:
            where = f"between {100 * low:+.3g} and {100 * high:+.3g} cm of the target's height"
            return PlanStatus.OUTSIDE_RANGE, f"no height {where} hits the target; {missed}"
        if solution.found is Found.UNREACHABLE:
            failed = [height for height, miss in solution.tried if miss is None]
            why = self._insert(failed[-1])[0].outcome.sentence
            sentence = f"the tip does not come level with the target: {why}"
            return PlanStatus.UNREACHABLE, sentence
        return PlanStatus.NOT_CONVERGED, f"the search did not converge; {missed}"


class _Passed:
    """Ends an insertion once the target, and the target's own depth, are well behind the tip."""

    def __init__(self, direction: Vector, target: float, entry: float) -> None:
        self._direction, self._target, self._depth = direction, target, target - entry
        self._beyond = 0

    def __call__(self, state: State) -> bool:
        passed = float(state.tip @ self._direction) > self._target and state.depth > self._depth
        self._beyond = self._beyond + 1 if passed else 0
        return self._beyond >= BEYOND
