"""The prescribed motion of a needle: depth over time, in straight stages, and the time steps."""

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

from needlefem.errors import CaseError
from needlefem.scene import Motion, Stage

EVEN = 1e-9
"""Round-off, in steps or pitches of a train, that is none."""
HALVINGS = 6
"""First step after the needle stopped or turned back, in which the penalty springs extend."""


class MotionStage(NamedTuple):
    """Even motion between two depths (m) that takes a time (s); what is released at its end."""

    start: float
    end: float
    duration: float
    releases: tuple[str, ...] = ()


class TimeStep(NamedTuple):
    """A time (s) and the depth (m) then; the duration of the step to it (s); what is released."""

    time: float
    depth: float
    duration: float
    releases: tuple[str, ...] = ()

    def time_at(self, depth: float, start: tuple[float, float]) -> float:
        """Return the time of a depth in an even motion from a time and a depth to this tick's."""
        travel = self.depth - start[1]
        share = (depth - start[1]) / travel if depth != self.depth and travel != 0.0 else 1.0
        return start[0] + share * (self.time - start[0])


def motion_stages(motion: Motion) -> tuple[MotionStage, ...]:
    """Return the legs of a motion; what is released without a motion belongs to the one before.

    Raises
    ------
    CaseError
        A stage says too little or too much.
    """
    if motion.times:
        return _table(motion)
    if not motion.stages:
        return (MotionStage(0.0, motion.max_depth, motion.max_depth / motion.speed),)
    found: list[MotionStage] = []
    depth = 0.0
    for number, stage in enumerate(motion.stages):
        for leg in _stage(stage, depth, motion, f"motion.stages[{number}]"):
            if found and leg.duration == 0.0 and leg.start == leg.end:
                found[-1] = found[-1]._replace(releases=found[-1].releases + leg.releases)
            else:
                found.append(leg)
        depth = found[-1].end
    return tuple(found)


def deepest(motion: Motion) -> float:
    """Return the largest depth of a motion, m."""
    return max(leg.end for leg in motion_stages(motion))


def _stage(stage: Stage, depth: float, motion: Motion, key: str) -> list[MotionStage]:
    releases = () if stage.release is None else (stage.release,)
    if stage.dwell is not None:
        return [MotionStage(depth, depth, stage.dwell, releases)]
    end, speed = stage.depth, stage.speed or motion.speed
    assert end is not None
    if end > motion.max_depth:
        problem = f"{end:g} m is beyond motion.max_depth, {motion.max_depth:g} m"
        raise CaseError(f"{key}.depth", problem, "choose a smaller depth or raise max_depth")
    if stage.seed_count is None:
        return [MotionStage(depth, end, abs(end - depth) / speed, releases)]
    return _train(stage, depth, end, speed, key)


def _train(stage: Stage, depth: float, end: float, speed: float, key: str) -> list[MotionStage]:
    """Return the legs between the seeds of a train, the first of which stays at the start."""
    count, pitch = stage.seed_count or 0, stage.seed_spacing
    if pitch is None or end >= depth or depth - end < (count - 1) * pitch * (1.0 - EVEN):
        problem = f"no room for {count} seeds on the way from {depth:g} to {end:g} m"
        raise CaseError(
            f"{key}.seed_count", problem, "give 'seed_spacing', and retract over all of the train"
        )
    name = stage.release or "seed"
    found = [MotionStage(depth, depth, 0.0, (f"{name} 1",))]
    for number in range(1, count):
        below = max(depth - number * pitch, end)
        if below - end <= EVEN * pitch:  # the train ends with the stage
            below = end
        start = found[-1].end
        found.append(MotionStage(start, below, (start - below) / speed, (f"{name} {number + 1}",)))
    last = found[-1].end
    return found if last == end else [*found, MotionStage(last, end, (last - end) / speed)]


def _table(motion: Motion) -> tuple[MotionStage, ...]:
    times, depths = motion.times, motion.depths
    if motion.stages:
        raise CaseError("motion.times", "stages are there as well", "keep one of the two")
    if len(times) != len(depths) or len(times) < 2:
        problem = f"{len(times)} times and {len(depths)} depths"
        raise CaseError("motion.times", problem, "give as many of both, two at least")
    for key, values, unit in (("times", times, "s"), ("depths", depths, "m")):
        if values[0] != 0.0:
            problem = f"the table begins at {values[0]:g} {unit}, not at 0"
            raise CaseError(f"motion.{key}", problem, f"let it begin with '0 {unit}'")
    if max(depths) > motion.max_depth:
        problem = f"{max(depths):g} m is beyond motion.max_depth, {motion.max_depth:g} m"
        raise CaseError("motion.depths", problem, "choose smaller depths or raise max_depth")
    if any(b <= a for a, b in pairwise(times)):
        late = next(i for i in range(1, len(times)) if times[i] <= times[i - 1])
        problem = f"{times[late]:g} s comes after {times[late - 1]:g} s"
        raise CaseError("motion.times", problem, "let every time be later than the one before it")
    return tuple(
        MotionStage(depths[i], depths[i + 1], times[i + 1] - times[i])
        for i in range(len(times) - 1)
    )


def time_steps(
    motion: Motion, time_step: float, longest: float, *, timeless: bool
) -> Iterator[TimeStep]:
    """Yield the steps of a motion, of equal duration within a leg.

    Where nothing depends on time, the first step after the needle stopped or turned back grows
    from a short one: sticking ends there, over a travel that is short in stiff tissue.

    Parameters
    ----------
    motion : Motion
    time_step : float, s
        Longest step.
    longest : float, m
        Longest travel of the needle in a step.
    timeless : bool
        Nothing happens while the needle rests: a hold is one step.
    """
    time, stopped, parts = 0.0, False, motion_stages(motion)
    travels = [leg.end - leg.start for leg in parts]
    for number, (leg, travel) in enumerate(zip(parts, travels, strict=True)):
        needed = max(leg.duration / time_step, abs(travel) / longest)
        count = 1 if timeless and travel == 0.0 else max(1, math.ceil(needed - EVEN))
        shares = [n / count for n in range(1, count + 1)]
        if timeless and stopped and travel != 0.0:
            shares = [shares[0] * 0.5**n for n in range(HALVINGS, 0, -1)] + shares
        begin = 0.0
        for share in shares:
            end = share == 1.0
            depth = leg.end if end else leg.start + share * travel
            duration = (share - begin) * leg.duration if timeless else leg.duration / count
            releases = leg.releases if end else ()
            yield TimeStep(time + share * leg.duration, depth, duration, releases)
            begin = share
        time += leg.duration
        following = travels[number + 1] if number + 1 < len(travels) else 0.0
        stopped = travel * following <= 0.0
