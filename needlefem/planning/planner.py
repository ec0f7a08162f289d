"""Search for the release point of one needle direction, with obstacles."""

import dataclasses
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from needlefem._arrays import Floats, Vector
from needlefem.errors import CaseError
from needlefem.insertion.cut_path import TipPoint, TipTrajectory
from needlefem.insertion.result import Insertion
from needlefem.insertion.simulation import Simulation
from needlefem.insertion.state import State
from needlefem.needle.clearance import Interval, Passing, blocked, gaps, merged, passings
from needlefem.needle.needle_interface import InsertionAxis
from needlefem.planning.reading import ROUND_OFF, InsertionReader, Reading, Why, limit_sentence
from needlefem.planning.result import BlockedRelease, Plan, PlanStatus, Release
from needlefem.planning.search import (
    SearchResult,
    SearchStatus,
    golden_section,
    grid,
    sign_changes,
    signed_root,
)
from needlefem.scene import Scene, vary

DEEPER = 1e-4
"""Increment of the depth for which obstacles are checked, if a release proved to be deeper, m."""

Find = Callable[[Interval], "Candidate"]
"""Searches an interval of lateral offsets relative to the target, m."""


class Candidate(NamedTuple):
    """Result of a search: a lateral offset and the release there, or None without a release."""

    solution: SearchResult
    release: Release | None


class Obstacles:
    """The obstacles of a scene for needles of one direction.

    Parameters
    ----------
    scene : Scene
    level : InsertionAxis
        The needle axis at the lateral offset 0.
    """

    def __init__(self, scene: Scene, level: InsertionAxis) -> None:
        self._scene, self._level = scene, level

    def passings(self, release_point: Vector) -> tuple[Passing, ...]:
        """Return the distances of a needle with its tip at a point from all obstacles."""
        return passings(
            self._scene.obstacles, InsertionAxis(release_point, self._level.direction), 0.0
        )

    def barrier(self, release: Release | None) -> Passing | None:
        """Return the obstacle with the smallest clearance of those too close to a release."""
        if release is None:
            return None
        near = [found for found in self.passings(release.release_point) if not found.allowed]
        return min(near, key=lambda found: found.distance - found.clearance, default=None)

    def allowed(self, depth: float, within: Interval) -> list[Interval]:
        """Return the lateral offsets at which a needle of a depth is far enough from obstacles."""
        not_allowed = [
            interval
            for obstacle in self._scene.obstacles.values()
            for interval in blocked(self._level, depth, obstacle.contour, obstacle.clearance)
        ]
        return gaps(*within, merged(not_allowed))

    def best(self, find: Find, within: Interval, without: Release) -> Candidate | None:
        """Return the best candidate that keeps its distance from obstacles; None without one.

        All intervals of allowed lateral offsets are searched. The depth of a release is only known
        after the search. If it is larger than assumed and the needle comes too close, the intervals
        are computed again with the larger depth.

        Parameters
        ----------
        find : callable
        within : (float, float), m
            Feasible lateral offsets.
        without : Release
            The best release without obstacles.
        """
        depth = float(self._level.axial_coordinate(without.release_point))
        while True:
            found = [find(interval) for interval in self.allowed(depth, within)]
            reached = [one for one in found if one.release is not None]
            best = min(reached, key=_error, default=None)
            if best is None or best.release is None or self.barrier(best.release) is None:
                return best
            depth = (
                max(depth, float(self._level.axial_coordinate(best.release.release_point))) + DEEPER
            )


def _error(candidate: Candidate) -> float:
    assert candidate.release is not None
    return candidate.release.placement_error


# Release point whose final position is the target.


BEYOND = 3
"""Number of states computed beyond the target, so that the interpolation there is central."""
SCAN = 9
"""Number of lateral offsets in the coarse scan for further solutions."""
RESOLVED = 2.0
"""Largest error of golden section and grid search that counts as solved, over the tolerance of the
lateral offset. The error grows about as fast as the offset."""
ROOM = 1.05
"""Proposed largest depth over the depth of a release; other offsets may be slightly deeper."""


class Planner:
    """Plans for one target in one simulation.

    Parameters
    ----------
    simulation : Simulation
    target : array, shape (dim,), m

    Raises
    ------
    CaseError
        The target is outside the tissue.
    """

    def __init__(self, simulation: Simulation, target: Vector) -> None:
        self.simulation, self.target = simulation, target
        cells, _ = simulation.model.interpolation.locator.find(target[None])
        if cells[0] < 0:
            where = "(" + ", ".join(f"{100 * x:.4g}" for x in target) + ") cm"
            raise CaseError("target.point", f"{where} is outside the tissue", "move it inside")
        self.entry = simulation.entry_through(target)
        axis = simulation.instrument(self.entry).axis
        self.laterals = axis.lateral_directions
        self.obstacles = Obstacles(simulation.scene, axis)
        self._level: Floats = np.zeros(len(self.laterals))
        self._known: dict[tuple[float, ...], InsertionReader] = {}
        self._max_depth = simulation.scene.motion.max_depth

    def path(self, height: Floats) -> TipTrajectory:
        """Return the trajectory of the tip at a lateral offset.

        Parameters
        ----------
        height : array, shape (dim - 1,), m
            Lateral offset relative to the target.
        """
        return self.read(height).path

    def insertion(self, height: Floats) -> Insertion:
        """Return the insertion at a lateral offset, to just beyond the target; see `path`."""
        return self.read(height).insertion

    def read(self, height: Floats) -> InsertionReader:
        """Return the evaluation of the insertion at a lateral offset; see `path`."""
        key = tuple(float(h) for h in height)
        if key not in self._known:
            entry = self.simulation.entry_through(self.target + height @ self.laterals)
            insertion = self.simulation.insert(entry, self._beyond_target(entry.point))
            self._known[key] = InsertionReader(insertion, self.target)
        return self._known[key]

    def _beyond_target(self, entry: Vector) -> "_BeyondTarget":
        direction = self.simulation.direction
        return _BeyondTarget(direction, float(direction @ self.target), float(direction @ entry))

    def lateral_error(self, height: Floats) -> Floats | None:
        """Return the signed lateral error at a lateral offset; see `search.Miss`."""
        reach = self.read(height).level().reach
        if reach is None:
            return None
        lateral: Floats = self.laterals @ (reach.point - self.target)
        return lateral

    def error(self, height: float) -> float:
        """Return the placement error at the best depth of a lateral offset; see `search.Error`.

        It is infinite if the insertion ended early, because its last point is not the best depth.
        """
        reach = self.read(np.array([height])).nearest().reach
        return np.inf if reach is None else float(np.linalg.norm(reach.point - self.target))

    def release(self, height: Floats, reading: Reading) -> Release | None:
        """Return the release in space whose final position is a point of the trajectory."""
        reach = reading.reach
        if reach is None:
            return None
        entry = self.insertion(height).axis.entry
        error = float(np.linalg.norm(reach.point - self.target))
        released = entry + reach.depth * self.simulation.direction
        return Release(released, reach.point, error, reading.sentence)

    def unplanned(self) -> Release | None:
        """Return the release with the tip at the target in space, as if the tissue were rigid."""
        return self.release(self._level, self._at_target())

    def depth_only(self) -> Release | None:
        """Return the best release at the lateral offset of the target."""
        return self.release(self._level, self.read(self._level).nearest())

    def _at_target(self) -> Reading:
        depth = float(self.simulation.direction @ (self.target - self.entry.point))
        return self.read(self._level).at_depth(depth)

    def has_ruptures(self) -> bool:
        """Say whether a rupture occurred in any insertion so far."""
        return any(known.insertion.ruptures for known in self._known.values())

    def plan(
        self,
        search: str | None = None,
        *,
        all_solutions: bool = False,
        start: Floats | None = None,
    ) -> Plan:
        """Search the lateral offset, a root from `start`; see `needlefem.plan`."""
        before = self.simulation.insertions
        numbers = self.simulation.scene.planning
        search = search or numbers.search
        begin = self._level if start is None else start
        free = self._candidate(search, begin, numbers.offset_range)
        chosen, blocked_release = self._around(search, free)
        insertions = self.simulation.insertions - before
        status, sentence = self._judge(search, free.solution)
        if blocked_release is not None:
            status, sentence = self._judge_blocked(chosen, blocked_release)
        solution = free.solution if chosen is None else chosen.solution
        best = None if chosen is None else chosen.release
        scanned = self.simulation.insertions
        others = self._others(solution) if all_solutions else None
        level = {"unplanned": self._at_target(), "depth_only": self.read(self._level).nearest()}
        return Plan(
            status=status,
            sentence=sentence,
            target=self.target,
            best=best,
            unplanned=self.release(self._level, level["unplanned"]),
            depth_only=self.release(self._level, level["depth_only"]),
            missing={name: read.sentence for name, read in level.items() if read.reach is None},
            search=search,
            solution=solution,
            insertions=insertions,
            insertion=self.insertion(solution.height),
            level=self.insertion(self._level),
            other_solutions=others,
            scan_insertions=self.simulation.insertions - scanned,
            passings=() if best is None else self.obstacles.passings(best.release_point),
            blocked=blocked_release,
        )

    def _candidate(self, search: str, start: Floats, within: Interval) -> Candidate:
        solution = self._search(search, start, within)
        return Candidate(solution, self.release(solution.height, self._best(solution)))

    def _around(
        self, search: str, free: Candidate
    ) -> tuple[Candidate | None, BlockedRelease | None]:
        """Return the best candidate that keeps its distance from obstacles, and what is blocked."""
        barrier = self.obstacles.barrier(free.release)
        if barrier is None or free.release is None:
            return free, None
        within = self.simulation.scene.planning.offset_range
        best = self.obstacles.best(
            lambda interval: self._candidate(search, self._level, interval), within, free.release
        )
        return best, BlockedRelease(free.release, barrier)

    def _search(self, search: str, start: Floats, within: Interval) -> SearchResult:
        numbers = self.simulation.scene.planning
        if search == "root":
            return self._root(start, within)
        if len(self.laterals) != 1:
            raise CaseError("planning.search", f"'{search}' is for 2D scenes", "use 'root'")
        method = golden_section if search == "golden" else grid
        return method(self.error, *within, numbers.interval_tolerance)

    def _best(self, solution: SearchResult) -> Reading:
        known = self.read(solution.height)
        # a root is evaluated at the depth of the target, any other result at the closest point
        level = known.level()
        if solution.found is SearchStatus.SOLVED and level.reach is not None:
            return level
        return known.nearest()

    def _root(self, start: Floats, within: Interval) -> SearchResult:
        numbers = self.simulation.scene.planning
        most = numbers.max_insertions
        return signed_root(self.lateral_error, start, within, numbers.tolerance, most)

    def _others(self, solution: SearchResult) -> tuple[float, ...]:
        """Return further lateral offsets in the range that reach the target, from a coarse scan."""
        if len(self.laterals) != 1:
            raise CaseError("--all-solutions", "is for 2D scenes", "leave it out")
        low, high = self.simulation.scene.planning.offset_range
        found = []
        for a, b in sign_changes(self.lateral_error, low, high, SCAN):
            if not a <= float(solution.height[0]) <= b:
                root = self._root(np.array([0.5 * (a + b)]), (a, b))
                release = self.release(root.height, self._best(root))
                if root.found is SearchStatus.SOLVED and self.obstacles.barrier(release) is None:
                    found.append(float(root.height[0]))
        return tuple(found)

    def _judge(self, search: str, solution: SearchResult) -> tuple[PlanStatus, str]:
        """Return status and sentence for the end of the search."""
        numbers = self.simulation.scene.planning
        low, high = numbers.offset_range
        missed = f"the smallest error of all offsets tried is {100 * solution.miss:.3g} cm"
        if solution.found is SearchStatus.UNREACHABLE:
            failed = [height for height, miss in solution.tried if miss is None or np.isinf(miss)]
            return self._out_of_reach(failed[-1], self.read(failed[-1]).level())
        if solution.found is SearchStatus.SOLVED and search != "root":
            best = self._best(solution)
            if best.why is not None:
                return self._out_of_reach(solution.height, best)
            if solution.miss > RESOLVED * numbers.interval_tolerance:
                level = self.read(solution.height).level()
                if level.why is not None:
                    return self._out_of_reach(solution.height, level)
                height = float(solution.height[0])
                inside = min(height - low, high - height) > numbers.interval_tolerance
                found = SearchStatus.NOT_CONVERGED if inside else SearchStatus.OUTSIDE_RANGE
                solution = dataclasses.replace(solution, found=found)
        if solution.found is SearchStatus.SOLVED:
            left = f"the residual of the search is {100 * solution.miss:.2g} cm on this model"
            return PlanStatus.PLANNED, left
        if solution.found is SearchStatus.OUTSIDE_RANGE:
            where = f"between {100 * low:+.3g} and {100 * high:+.3g} cm from the target"
            return PlanStatus.OUTSIDE_RANGE, (
                f"no lateral offset {where} reaches it; {missed}; widen planning.offset_range"
            )
        return PlanStatus.NOT_CONVERGED, f"the search did not converge; {missed}"

    def _out_of_reach(self, height: Floats, reading: Reading) -> tuple[PlanStatus, str]:
        """Return status and sentence if the tip does not reach the target at a lateral offset."""
        if reading.why is Why.BROKE_OFF:
            where = ", ".join(f"{100 * float(h):+.3g} cm" for h in height)
            return PlanStatus.NOT_CONVERGED, f"at a lateral offset of {where}, {reading.sentence}"
        if reading.why is not Why.MAX_DEPTH:
            why = reading.sentence
            return PlanStatus.UNREACHABLE, f"the tip does not reach the depth of the target: {why}"
        limit = limit_sentence(self._max_depth)
        needed = self._depth_needed(height)
        if needed.reach is None:
            return PlanStatus.UNREACHABLE, (
                f"the target is beyond {limit}, and a deeper needle does not reach it either: "
                f"{needed.sentence}"
            )
        depth = needed.reach.depth
        return PlanStatus.BEYOND_MAX_DEPTH, (
            f"the release is {100 * depth:.3g} cm deep, beyond {limit}; "
            f'set motion.max_depth to "{_rounded_up(100.0 * ROOM * depth)} cm" or more'
        )

    def _depth_needed(self, height: Floats) -> Reading:
        """Return where the tip is at the depth of the target if the motion may be deeper."""
        entry = self.simulation.entry_through(self.target + height @ self.laterals)
        size = float(np.linalg.norm(np.ptp(self.simulation.model.nodes, axis=0)))
        deeper = self.simulation.insert(entry, self._beyond_target(entry.point), max_depth=size)
        return InsertionReader(deeper, self.target, size).level()

    def _judge_blocked(
        self, chosen: Candidate | None, blocked_release: BlockedRelease
    ) -> tuple[PlanStatus, str]:
        """Return status and sentence for a search between obstacles."""
        without = blocked_release.sentence
        if chosen is None or chosen.release is None:
            return PlanStatus.UNREACHABLE, f"no lateral offset is allowed; {without}"
        best = self._best(chosen.solution)
        if best.why is not None:
            status, sentence = self._out_of_reach(chosen.solution.height, best)
            return status, f"{sentence}; {without}"
        error, least = chosen.release.placement_error, blocked_release.release.placement_error
        missed = f"has an error of {100 * error:.2g} cm"
        close = error <= least + self.simulation.scene.planning.interval_tolerance
        if chosen.solution.found is SearchStatus.SOLVED and close:
            return PlanStatus.PLANNED, f"the plan {missed} on this model; {without}"
        return PlanStatus.BLOCKED, f"the best allowed lateral offset {missed}; {without}"


class _BeyondTarget:
    """Ends an insertion a few states after tip and depth have passed the target."""

    def __init__(self, direction: Vector, target: float, entry: float) -> None:
        self._direction, self._target, self._depth = direction, target, target - entry
        self._beyond = 0

    def __call__(self, state: State) -> bool:
        passed = float(state.tip @ self._direction) > self._target and state.depth > self._depth
        self._beyond = self._beyond + 1 if passed else 0
        return self._beyond >= BEYOND


def _rounded_up(value: float) -> str:
    """Round a positive number up to two digits."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return f"{math.ceil(value / unit - ROUND_OFF) * unit:.2g}"


# Functions of the studies.


def planner_of(scene: Scene) -> Planner:
    """Return a planner for the target of a scene."""
    if scene.target is None:
        raise CaseError("target.point", "missing", "the study needs a target")
    return Planner(Simulation(scene), np.array(scene.target))


def carry_out(scene: Scene, plan: Plan) -> TipPoint | None:
    """Return the final position of a planned release in another scene, or None.

    None if the release is not reached: the insertion ends early, or the release is deeper than the
    largest depth of the motion.
    """
    if plan.best is None:
        return None
    direction = tuple(plan.insertion.axis.direction.tolist())
    simulation = Simulation(vary(scene, {"motion.direction": direction}))
    release = plan.best.release_point
    entry = simulation.entry_through(release)
    depth = float(simulation.direction @ (release - entry.point))
    insertion = simulation.insert(entry, lambda state: state.depth > depth + 3e-3)
    return InsertionReader(insertion, plan.target).at_depth(depth).reach
