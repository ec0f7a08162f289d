"""Heights at which a needle keeps away from the obstacles of a scene."""

from collections.abc import Callable
from typing import NamedTuple

from needlefem._arrays import Vector
from needlefem.needle.clearance import Interval, Passing, blocked, gaps, merged, passings
from needlefem.needle.insertion_axis import InsertionAxis
from needlefem.planning.result import Release
from needlefem.planning.search import SearchResult
from needlefem.scene import Scene

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
