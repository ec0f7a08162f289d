"""Evaluation of an insertion for a target: the lateral error, or the reason why there is none.

An insertion of a plan ends when the tip has passed the target. It may end before: at the largest
depth, where the tip leaves the tissue, or without convergence. If it ended early without
convergence, its last point is not used, because the needle could reach points closer to the target.
"""

from enum import StrEnum
from typing import NamedTuple

import numpy as np

from needlefem._arrays import Vector
from needlefem.insertion.cut_path import TipPoint, TipTrajectory
from needlefem.insertion.result import Insertion, Status
from needlefem.insertion.state import TipPhase

BROKEN = (Status.NOT_CONVERGED, Status.NO_NODE, Status.STICK_DETECTED)
"""Status of insertions that ended early, because they could not be computed further."""
ROUND_OFF = 1e-9
"""Difference below which depths are treated as equal, m."""


class Why(StrEnum):
    """Why an insertion does not determine the final position of a release."""

    BROKE_OFF = "broke_off"
    MAX_DEPTH = "max_depth"
    LEFT_TISSUE = "left_tissue"
    JUMPED = "jumped"


class Reading(NamedTuple):
    """A point that the tip reaches, or the reason why there is none.

    Parameters
    ----------
    reach : TipPoint or None
    why : Why or None
        With a point: the reason why no closer point is reached.
    sentence : str
        The reason in words.
    """

    reach: TipPoint | None
    why: Why | None = None
    sentence: str = ""


def ended_early(insertion: Insertion) -> bool:
    """Say whether an insertion could not be computed to its end."""
    return insertion.outcome.status in BROKEN


def limit_sentence(max_depth: float) -> str:
    """Return the key and value of the largest depth of the motion."""
    return f"motion.max_depth = {100 * max_depth:.4g} cm"


class InsertionReader:
    """Evaluates an insertion for a target.

    Parameters
    ----------
    insertion : Insertion
        To beyond the target, or as far as it could be computed.
    target : array, shape (dim,), m
    max_depth : float, m, optional
        Largest depth of a release; that of the motion when left out.
    """

    def __init__(
        self, insertion: Insertion, target: Vector, max_depth: float | None = None
    ) -> None:
        self.insertion, self.target, self.path = insertion, target, TipTrajectory(insertion)
        self._max_depth = insertion.scene.motion.max_depth if max_depth is None else max_depth

    def level(self) -> Reading:
        """Return where the tip has the axial coordinate of the target."""
        if ended_early(self.insertion):
            return self._broken()
        reach = self.path.at_target_depth(self.target)
        if reach is None:
            return self._ended("the depth of the target is reached")
        if reach.depth > self._max_depth + ROUND_OFF:
            return self._too_deep("the depth of the target is reached")
        return Reading(reach)

    def nearest(self) -> Reading:
        """Return the point of the path that is closest to the target.

        If the path ends at the largest depth before the target, this is the end of the path.
        """
        if ended_early(self.insertion):
            return self._broken()
        reach = self.path.closest(self.target)
        if reach is None:
            return self._ended("the skin is cut")
        if self._beyond_target():
            if at_rupture(self.insertion, reach.depth):
                return self._ended("")._replace(reach=reach)
            if reach.depth <= self._max_depth + ROUND_OFF:
                return Reading(reach)
        ended = self._ended("the closest point is reached")
        if ended.why is not Why.MAX_DEPTH:
            return ended
        return ended._replace(reach=self.path.at_depth(min(reach.depth, self._max_depth)))

    def at_depth(self, depth: float) -> Reading:
        """Return the material point at the tip at a depth (m)."""
        if ended_early(self.insertion):
            return self._broken()
        if depth > self._max_depth + ROUND_OFF:
            return self._too_deep(f"a release at {100 * depth:.4g} cm is")
        last = float(self.insertion.depths.max(initial=0.0))
        reach = self.path.at_depth(depth) if depth <= last + ROUND_OFF else None
        if reach is None:
            return self._ended(f"a depth of {100 * depth:.4g} cm is reached")
        return Reading(reach)

    def _beyond_target(self) -> bool:
        """Say whether the tip has passed the axial coordinate of the target, also in a rupture."""
        tips, axis = self.insertion.tips, self.insertion.axis
        return bool(
            np.max(axis.axial_coordinate(tips)) >= float(axis.axial_coordinate(self.target))
        )

    def _broken(self) -> Reading:
        deepest = 100.0 * float(self.insertion.depths.max(initial=0.0))
        why = self.insertion.outcome.sentence
        return Reading(None, Why.BROKE_OFF, f"the insertion ended early at {deepest:.3g} cm: {why}")

    def _too_deep(self, what: str) -> Reading:
        return Reading(None, Why.MAX_DEPTH, f"{what} beyond {limit_sentence(self._max_depth)}")

    def _ended(self, what: str) -> Reading:
        """Return why an insertion that was computed to its end does not reach a point."""
        if self._beyond_target():
            depths = ", ".join(f"{100 * depth:.3g} cm" for depth in _rupture_depths(self.insertion))
            if not depths:
                return Reading(None, Why.JUMPED, "the target is on the skin")
            return Reading(None, Why.JUMPED, f"the tip passes it in a rupture (depth {depths})")
        if self.insertion.outcome.status is Status.LEFT_TISSUE:
            return Reading(None, Why.LEFT_TISSUE, self.insertion.outcome.sentence)
        return self._too_deep(what)


def at_rupture(insertion: Insertion, depth: float) -> bool:
    """Say whether a rupture occurs at a depth (m): the tip then passes several material points."""
    return any(abs(other - depth) <= ROUND_OFF for other in _rupture_depths(insertion))


def _rupture_depths(insertion: Insertion) -> list[float]:
    """Return the depths at which ruptures occur, m; the last rupture may be incomplete."""
    found = [rupture.depth for rupture in insertion.ruptures]
    if insertion.states[-1].tip_phase is TipPhase.RUPTURE:
        found.append(float(insertion.depths[-1]))
    return found


def state_at(insertion: Insertion, depth: float) -> int:
    """Return the number of the state at a depth (m), or of the next one beyond it."""
    beyond = int(np.searchsorted(insertion.depths, depth - ROUND_OFF))
    return min(beyond, len(insertion.states) - 1)
