"""Prescribed motion of a needle: stages of constant speed, and the time steps."""

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from needlefem.errors import CaseError
from needlefem.scene import Motion, Stage

EVEN = 1e-9
"""Relative round-off that is accepted when step counts and seed spacings are rounded."""
HALVINGS = 6
"""Number of shorter steps after the needle has rested or turned back, each half of the next one."""


class MotionStage(NamedTuple):
    """Motion at constant speed between two depths (m) in a duration (s).

    The seeds `releases` are released at its end. `stage_end` is the last time step of the stage, if
    a step of path following may go on up to it.
    """

    start: float
    end: float
    duration: float
    releases: tuple[str, ...] = ()


class TimeStep(NamedTuple):
    """End of a time step: time (s) and depth (m); and the duration of the step (s).

    The seeds `releases` are released at its end.
    """

    time: float
    depth: float
    duration: float
    releases: tuple[str, ...] = ()
    stage_end: "TimeStep | None" = None

    def time_at(self, depth: float, start: tuple[float, float]) -> float:
        """Return the time at a depth in this step, given time and depth at its start."""
        travel = self.depth - start[1]
        share = (depth - start[1]) / travel if depth != self.depth and travel != 0.0 else 1.0
        return start[0] + share * (self.time - start[0])


def motion_stages(motion: Motion) -> tuple[MotionStage, ...]:
    """Return the stages of a motion.

    A seed that is released without a motion belongs to the stage before.

    Raises
    ------
    CaseError
        The data of a stage are incomplete or contradict each other.
    """
    if motion.times:
        return _table(motion)
    if not motion.stages:
        return (MotionStage(0.0, motion.max_depth, motion.max_depth / motion.speed),)
    found: list[MotionStage] = []
    depth = 0.0
    for number, stage in enumerate(motion.stages):
        for part in _stage(stage, depth, motion, f"motion.stages[{number}]"):
            if found and part.duration == 0.0 and part.start == part.end:
                found[-1] = found[-1]._replace(releases=found[-1].releases + part.releases)
            else:
                found.append(part)
        depth = found[-1].end
    return tuple(found)


def deepest(motion: Motion) -> float:
    """Return the largest depth of a motion, m."""
    return max(stage.end for stage in motion_stages(motion))


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
    """Return the stages between the seeds of a train; the first seed is released at the start."""
    count, pitch = stage.seed_count or 0, stage.seed_spacing
    if pitch is None or end >= depth or depth - end < (count - 1) * pitch * (1.0 - EVEN):
        problem = f"there is no space for {count} seeds from {depth:g} to {end:g} m"
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
    motion: Motion, time_step: float, longest: float, *, rate_independent: bool
) -> Iterator[TimeStep]:
    """Yield the time steps of a motion, of equal duration within a stage.

    In tissue that does not depend on time, steps of path following may replace the time steps of an
    advance, unless their duration is prescribed. The first step after the needle has rested or
    turned back is divided there, with a short step first: sticking ends after a travel that is
    short in stiff tissue.

    Parameters
    ----------
    motion : Motion
    time_step : float, s
        Longest duration of a step.
    longest : float, m
        Longest travel of the needle in a step.
    rate_independent : bool
        Whether the response of the tissue is independent of time. Then a dwell is one step.
    """
    time, stopped, stages = 0.0, False, motion_stages(motion)
    travels = [stage.end - stage.start for stage in stages]
    for number, (stage, travel) in enumerate(zip(stages, travels, strict=True)):
        needed = max(stage.duration / time_step, abs(travel) / longest)
        count = 1 if rate_independent and travel == 0.0 else max(1, math.ceil(needed - EVEN))
        shares = [n / count for n in range(1, count + 1)]
        if rate_independent and stopped and travel != 0.0:
            shares = [shares[0] * 0.5**n for n in range(HALVINGS, 0, -1)] + shares
        durations = (
            np.diff(shares, prepend=0.0) * stage.duration
            if rate_independent
            else np.full(count, stage.duration / count)
        )
        last = TimeStep(time + stage.duration, stage.end, float(durations[-1]), stage.releases)
        path_steps = rate_independent and travel > 0.0 and math.isinf(time_step)
        reachable = last if path_steps else None
        for share, duration in zip(shares[:-1], durations.tolist(), strict=False):
            depth = stage.start + share * travel
            yield TimeStep(time + share * stage.duration, depth, duration, (), reachable)
        yield last
        time += stage.duration
        following = travels[number + 1] if number + 1 < len(travels) else 0.0
        stopped = travel * following <= 0.0
