"""Evaluation of an insertion for a target: the lateral error, or the reason why there is none.

An insertion of a plan ends when the tip has passed the target. It may end before: at the largest
depth, where the tip leaves the tissue, or without convergence. An insertion that ended early is no
evidence: its last point is not the nearest point that the needle could reach.
"""

from enum import StrEnum
from typing import NamedTuple

import numpy as np

from needlefem._arrays import Vector
from needlefem.insertion.cut_path import TipPoint, TipTrajectory
from needlefem.insertion.result import Insertion, Status
from needlefem.insertion.state import TipPhase

BROKEN = (Status.NOT_CONVERGED, Status.NO_NODE, Status.STICK_DETECTED)
"""How an insertion ends that could not be computed further."""
ROUND_OFF = 1e-9
"""Depths that differ by less count as equal, m."""


class Why(StrEnum):
    """Why an insertion does not say where a release ends."""

    BROKE_OFF = "broke_off"
    MAX_DEPTH = "max_depth"
    LEFT_TISSUE = "left_tissue"
    JUMPED = "jumped"


class Reading(NamedTuple):
    """A point that the tip reaches, or why there is none.

    Parameters
    ----------
    reach : TipPoint or None
    why : Why or None
        With a point, what keeps the needle from a better one.
    sentence : str
        The same for a reader.
    """

    reach: TipPoint | None
    why: Why | None = None
    sentence: str = ""


def broke_off(insertion: Insertion) -> bool:
    """Say whether an insertion could not be computed to its end."""
    return insertion.outcome.status in BROKEN


def limit_sentence(max_depth: float) -> str:
    """Name the largest depth of the motion."""
    return f"motion.max_depth = {100 * max_depth:.4g} cm"


class InsertionReader:
    """Reads an insertion for a target.

    Parameters
    ----------
    insertion : Insertion
        To beyond the target, or as far as it went.
    target : array, shape (dim,), m
    max_depth : float, m, optional
        The largest that a release may have; the motion's when left out.
    """

    def __init__(
        self, insertion: Insertion, target: Vector, max_depth: float | None = None
    ) -> None:
        self.insertion, self.target, self.path = insertion, target, TipTrajectory(insertion)
        self._max_depth = insertion.scene.motion.max_depth if max_depth is None else max_depth

    def level(self) -> Reading:
        """Return where the tip is level with the target along the needle."""
        if broke_off(self.insertion):
            return self._broken()
        reach = self.path.at_target_depth(self.target)
        if reach is None:
            return self._ended("the tip comes level with the target")
        if reach.depth > self._max_depth + ROUND_OFF:
            return self._too_deep("the tip comes level with the target")
        return Reading(reach)

    def nearest(self) -> Reading:
        """Return the point of the path that is nearest to the target.

        Where the largest depth ends the path before the target is passed, that is its end.
        """
        if broke_off(self.insertion):
            return self._broken()
        reach = self.path.closest(self.target)
        if reach is None:
            return self._ended("the skin is cut")
        if self._passed():
            if at_jump(self.insertion, reach.depth):
                return self._ended("")._replace(reach=reach)
            if reach.depth <= self._max_depth + ROUND_OFF:
                return Reading(reach)
        ended = self._ended("the nearest point is reached")
        if ended.why is not Why.MAX_DEPTH:
            return ended
        return ended._replace(reach=self.path.at_depth(min(reach.depth, self._max_depth)))

    def at_depth(self, depth: float) -> Reading:
        """Return what the tip has reached at a depth (m)."""
        if broke_off(self.insertion):
            return self._broken()
        if depth > self._max_depth + ROUND_OFF:
            return self._too_deep(f"a release at {100 * depth:.4g} cm is")
        last = float(self.insertion.depths.max(initial=0.0))
        reach = self.path.at_depth(depth) if depth <= last + ROUND_OFF else None
        if reach is None:
            return self._ended(f"a depth of {100 * depth:.4g} cm is reached")
        return Reading(reach)

    def _passed(self) -> bool:
        """Say whether the tip came level with the target, or went past it by a jump."""
        tips, axis = self.insertion.tips, self.insertion.axis
        return bool(
            np.max(axis.axial_coordinate(tips)) >= float(axis.axial_coordinate(self.target))
        )

    def _broken(self) -> Reading:
        deepest = 100.0 * float(self.insertion.depths.max(initial=0.0))
        why = self.insertion.outcome.sentence
        return Reading(None, Why.BROKE_OFF, f"its insertion broke off at {deepest:.3g} cm: {why}")

    def _too_deep(self, what: str) -> Reading:
        return Reading(None, Why.MAX_DEPTH, f"{what} deeper than {limit_sentence(self._max_depth)}")

    def _ended(self, what: str) -> Reading:
        """Say why an insertion that ended as it should does not reach a point."""
        if self._passed():
            jumps = ", ".join(f"{100 * depth:.3g} cm" for depth in _jumps(self.insertion))
            if not jumps:
                return Reading(None, Why.JUMPED, "the target lies on the skin")
            return Reading(None, Why.JUMPED, f"the tip jumps over that material (at {jumps})")
        if self.insertion.outcome.status is Status.LEFT_TISSUE:
            return Reading(None, Why.LEFT_TISSUE, self.insertion.outcome.sentence)
        return self._too_deep(what)


def at_jump(insertion: Insertion, depth: float) -> bool:
    """Say whether the tip jumps ahead at a depth (m): it is then at more than one point."""
    return any(abs(jump - depth) <= ROUND_OFF for jump in _jumps(insertion))


def _jumps(insertion: Insertion) -> list[float]:
    """Return the depths at which the tip jumps, m; the last jump may not have ended."""
    found = [snap.depth for snap in insertion.ruptures]
    if insertion.states[-1].tip_phase is TipPhase.RUPTURE:
        found.append(float(insertion.depths[-1]))
    return found


def state_at(insertion: Insertion, depth: float) -> int:
    """Return the number of the state at a depth (m), or the next one beyond it."""
    beyond = int(np.searchsorted(insertion.depths, depth - ROUND_OFF))
    return min(beyond, len(insertion.states) - 1)
