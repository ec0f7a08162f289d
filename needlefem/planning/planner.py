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
"""By how much releases are taken for deeper than they were, once they proved too deep, m."""

Find = Callable[[Interval], "Candidate"]
"""Searches an interval of heights (m, relative to the target's)."""


class Candidate(NamedTuple):
    """What a search ended with: a height and the release there, None if out of reach."""

    solution: SearchResult
    release: Release | None


class Obstacles:
    """The obstacles of a scene for needles of one direction.

    Parameters
    ----------
    scene : Scene
    level : InsertionAxis
        The needle's line at height 0.
    """

    def __init__(self, scene: Scene, level: InsertionAxis) -> None:
        self._scene, self._level = scene, level

    def passings(self, release_point: Vector) -> tuple[Passing, ...]:
        """Return how a needle with its tip at a point passes every obstacle."""
        return passings(
            self._scene.obstacles, InsertionAxis(release_point, self._level.direction), 0.0
        )

    def barrier(self, release: Release | None) -> Passing | None:
        """Return the obstacle to which a release comes nearest of those it is too near."""
        if release is None:
            return None
        near = [found for found in self.passings(release.release_point) if not found.allowed]
        return min(near, key=lambda found: found.distance - found.clearance, default=None)

    def allowed(self, depth: float, within: Interval) -> list[Interval]:
        """Return the heights in an interval at which no tip down to a depth comes too near."""
        taken = [
            interval
            for obstacle in self._scene.obstacles.values()
            for interval in blocked(self._level, depth, obstacle.contour, obstacle.clearance)
        ]
        return gaps(*within, merged(taken))

    def best(self, find: Find, within: Interval, without: Release) -> Candidate | None:
        """Return the best candidate that keeps away; None if there is none.

        Every interval of allowed heights is searched. How deep their releases are is known only
        then: where one is too near because it is deeper than the intervals were made for, they are
        made anew.

        Parameters
        ----------
        find : callable
        within : (float, float), m
            Feasible heights.
        without : Release
            The best one without obstacles.
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
"""States computed beyond the target, so that interpolation there is central."""
SCAN = 9
"""Heights of the coarse scan for further solutions."""
RESOLVED = 2.0
"""Error that golden section and grid may leave, over the tolerance of their heights: it grows
about one for one with the height."""
ROOM = 1.05
"""Largest depth that is proposed over the depth of a release: other heights are a little deeper."""


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
        axis = simulation.instrument(self.entry).axis
        self.laterals = axis.lateral_directions
        self.obstacles = Obstacles(simulation.scene, axis)
        self._level: Floats = np.zeros(len(self.laterals))
        self._known: dict[tuple[float, ...], InsertionReader] = {}
        self._max_depth = simulation.scene.motion.max_depth

    def path(self, height: Floats) -> TipTrajectory:
        """Return the cut path at a height (shape (dim - 1,), m, relative to the target's)."""
        return self.read(height).path

    def insertion(self, height: Floats) -> Insertion:
        """Return the insertion at a height, to just beyond the target; see `path`."""
        return self.read(height).insertion

    def read(self, height: Floats) -> InsertionReader:
        """Return what reads the insertion at a height; see `path`."""
        key = tuple(float(h) for h in height)
        if key not in self._known:
            entry = self.simulation.entry_through(self.target + height @ self.laterals)
            insertion = self.simulation.insert(entry, self._passed(entry.point))
            self._known[key] = InsertionReader(insertion, self.target)
        return self._known[key]

    def _passed(self, entry: Vector) -> "_Passed":
        direction = self.simulation.direction
        return _Passed(direction, float(direction @ self.target), float(direction @ entry))

    def lateral_error(self, height: Floats) -> Floats | None:
        """Return the signed lateral miss at a height; see `search.Miss`."""
        reach = self.read(height).level().reach
        if reach is None:
            return None
        lateral: Floats = self.laterals @ (reach.point - self.target)
        return lateral

    def error(self, height: float) -> float:
        """Return the placement error at the best depth of a height; see `search.Error`.

        It is infinite where the insertion broke off: what it reached is not the best depth.
        """
        reach = self.read(np.array([height])).nearest().reach
        return np.inf if reach is None else float(np.linalg.norm(reach.point - self.target))

    def release(self, height: Floats, reading: Reading) -> Release | None:
        """Return the release in the world that ends at a reached point."""
        reach = reading.reach
        if reach is None:
            return None
        entry = self.insertion(height).axis.entry
        error = float(np.linalg.norm(reach.point - self.target))
        released = entry + reach.depth * self.simulation.direction
        return Release(released, reach.point, error, reading.sentence)

    def unplanned(self) -> Release | None:
        """Return the release with the tip at the target in the world, as if nothing moved."""
        return self.release(self._level, self._at_target())

    def depth_only(self) -> Release | None:
        """Return the best release at the target's height."""
        return self.release(self._level, self.read(self._level).nearest())

    def _at_target(self) -> Reading:
        depth = float(self.simulation.direction @ (self.target - self.entry.point))
        return self.read(self._level).at_depth(depth)

    def snapped(self) -> bool:
        """Say whether the tip jumped in any insertion so far."""
        return any(known.insertion.ruptures for known in self._known.values())

    def plan(
        self,
        search: str | None = None,
        *,
        all_solutions: bool = False,
        start: Floats | None = None,
    ) -> Plan:
        """Search the height, a root from `start`; see `needlefem.plan`."""
        before = self.simulation.insertions
        numbers = self.simulation.scene.planning
        search = search or numbers.search
        begin = self._level if start is None else start
        free = self._candidate(search, begin, numbers.offset_range)
        chosen, barred = self._around(search, free)
        spent = self.simulation.insertions - before
        status, sentence = self._judge(search, free.solution)
        if barred is not None:
            status, sentence = self._judge_barred(chosen, barred)
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
            insertions=spent,
            insertion=self.insertion(solution.height),
            level=self.insertion(self._level),
            other_solutions=others,
            scan_insertions=self.simulation.insertions - scanned,
            passings=() if best is None else self.obstacles.passings(best.release_point),
            blocked=barred,
        )

    def _candidate(self, search: str, start: Floats, within: Interval) -> Candidate:
        solution = self._search(search, start, within)
        return Candidate(solution, self.release(solution.height, self._best(solution)))

    def _around(
        self, search: str, free: Candidate
    ) -> tuple[Candidate | None, BlockedRelease | None]:
        """Return the best candidate that keeps away from obstacles, and what they barred."""
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
        # a root is solved level with the target; elsewhere the nearest point counts
        level = known.level()
        if solution.found is SearchStatus.SOLVED and level.reach is not None:
            return level
        return known.nearest()

    def _root(self, start: Floats, within: Interval) -> SearchResult:
        numbers = self.simulation.scene.planning
        most = numbers.max_insertions
        return signed_root(self.lateral_error, start, within, numbers.tolerance, most)

    def _others(self, solution: SearchResult) -> tuple[float, ...]:
        """Return further heights in the range that hit the target, from a coarse scan."""
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
        """Put the end of the search into a status and a sentence."""
        numbers = self.simulation.scene.planning
        low, high = numbers.offset_range
        missed = f"the best height tried misses by {100 * solution.miss:.3g} cm"
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
            left = f"the search leaves {100 * solution.miss:.2g} cm on this model"
            return PlanStatus.PLANNED, left
        if solution.found is SearchStatus.OUTSIDE_RANGE:
            where = f"between {100 * low:+.3g} and {100 * high:+.3g} cm of the target's height"
            return PlanStatus.OUTSIDE_RANGE, (
                f"no height {where} hits the target; {missed}; widen planning.offset_range"
            )
        return PlanStatus.NOT_CONVERGED, f"the search did not converge; {missed}"

    def _out_of_reach(self, height: Floats, reading: Reading) -> tuple[PlanStatus, str]:
        """Put what keeps the tip from the target at a height into a status and a sentence."""
        if reading.why is Why.BROKE_OFF:
            where = ", ".join(f"{100 * float(h):+.3g} cm" for h in height)
            return PlanStatus.NOT_CONVERGED, f"at a height of {where}, {reading.sentence}"
        if reading.why is not Why.MAX_DEPTH:
            why = reading.sentence
            return PlanStatus.UNREACHABLE, f"the tip does not come level with the target: {why}"
        limit = limit_sentence(self._max_depth)
        needed = self._depth_needed(height)
        if needed.reach is None:
            return PlanStatus.UNREACHABLE, (
                f"the target lies beyond {limit}, and a deeper needle does not reach it either: "
                f"{needed.sentence}"
            )
        depth = needed.reach.depth
        return PlanStatus.BEYOND_MAX_DEPTH, (
            f"the release is {100 * depth:.3g} cm deep, beyond {limit}; "
            f'set motion.max_depth to "{_rounded_up(100.0 * ROOM * depth)} cm" or more'
        )

    def _depth_needed(self, height: Floats) -> Reading:
        """Return where the tip comes level with the target if the motion may go deeper."""
        entry = self.simulation.entry_through(self.target + height @ self.laterals)
        size = float(np.linalg.norm(np.ptp(self.simulation.model.nodes, axis=0)))
        deeper = self.simulation.insert(entry, self._passed(entry.point), max_depth=size)
        return InsertionReader(deeper, self.target, size).level()

    def _judge_barred(
        self, chosen: Candidate | None, barred: BlockedRelease
    ) -> tuple[PlanStatus, str]:
        """Put what obstacles left of the heights into a status and a sentence."""
        without = barred.sentence
        if chosen is None or chosen.release is None:
            return PlanStatus.UNREACHABLE, f"no height is allowed; {without}"
        best = self._best(chosen.solution)
        if best.why is not None:
            status, sentence = self._out_of_reach(chosen.solution.height, best)
            return status, f"{sentence}; {without}"
        error, least = chosen.release.placement_error, barred.release.placement_error
        missed = f"misses by {100 * error:.2g} cm"
        close = error <= least + self.simulation.scene.planning.interval_tolerance
        if chosen.solution.found is SearchStatus.SOLVED and close:
            return PlanStatus.PLANNED, f"{missed} on this model; {without}"
        return PlanStatus.BLOCKED, f"the best height allowed {missed}; {without}"


class _Passed:
    """Ends an insertion once the target, and the target's own depth, are well behind the tip."""

    def __init__(self, direction: Vector, target: float, entry: float) -> None:
        self._direction, self._target, self._depth = direction, target, target - entry
        self._beyond = 0

    def __call__(self, state: State) -> bool:
        passed = float(state.tip @ self._direction) > self._target and state.depth > self._depth
        self._beyond = self._beyond + 1 if passed else 0
        return self._beyond >= BEYOND


def _rounded_up(value: float) -> str:
    """Return a positive number with two digits, not less."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return f"{math.ceil(value / unit - ROUND_OFF) * unit:.2g}"


# Functions of the studies.


def planner_of(scene: Scene) -> Planner:
    """Return a planner for the scene's own target."""
    if scene.target is None:
        raise CaseError("target.point", "missing", "the study needs a target")
    return Planner(Simulation(scene), np.array(scene.target))


def carry_out(scene: Scene, plan: Plan) -> TipPoint | None:
    """Return where a planned release ends in another scene; None if it is not reached there.

    Nor is it where the insertion breaks off, or is deeper than the scene's motion may go.
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
