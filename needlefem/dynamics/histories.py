"""Running a stepper under a load: a generator, and collectors that decide what is kept."""

from collections.abc import Callable, Iterator

import numpy as np

from needlefem._arrays import Floats
from needlefem.dynamics.steppers import KinematicState, Stepper

Load = Callable[[float], Floats]
"""Force on all unknowns at a time (s), shape (n,), N."""


def iterate(
    stepper: Stepper, motion: KinematicState, load: Load | None, count: int
) -> Iterator[KinematicState]:
    """Yield the motion after every one of `count` steps from time 0.

    Without a load nothing pushes. Only the last motion is held: memory does not grow.
    """
    zero = np.zeros(stepper.system.size)
    before = zero if load is None else load(0.0)
    for number in range(1, count + 1):
        after = zero if load is None else load(number * stepper.step)
        motion = stepper.advance_under(motion, before, after)
        before = after
        yield motion


def last(motions: Iterator[KinematicState]) -> KinematicState:
    """Return the last motion of a run."""
    for motion in motions:
        found = motion
    return found


def record(motions: Iterator[KinematicState], watch: Callable[[KinematicState], Floats]) -> Floats:
    """Return what `watch` makes of every motion, one row a step."""
    return np.array([watch(motion) for motion in motions])


def ramp(force: Floats, duration: float) -> Load:
    """Return a load that rises evenly to `force` and stays."""
    return lambda time: min(time / duration, 1.0) * force


def constant(force: Floats) -> Load:
    """Return a load that is there from the start."""
    return lambda _: force


def switched(force: Floats, on: float, off: float = np.inf) -> Load:
    """Return a load that comes at once at a time, s, and goes at once at another."""
    return lambda time: (1.0 if on <= time < off else 0.0) * force


def table(times: Floats, factors: Floats, force: Floats) -> Load:
    """Return `force` times a factor read from a table, linear in between."""
    return lambda time: float(np.interp(time, times, factors)) * force


def together(*loads: Load) -> Load:
    """Return the sum of loads."""
    return lambda time: np.sum([load(time) for load in loads], axis=0)
