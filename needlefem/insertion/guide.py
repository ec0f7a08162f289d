"""What one march learns from the one before it: where the tip goes next.

A search over heights pushes needles in one beside the other. Their tips turn alike, step by step,
and so do the derivatives that a step is solved with. Both are guesses only: a step is solved to
the same tolerance whatever it began from.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from needlefem._arrays import Floats, Vector

Learnt = tuple[Floats, Floats]
"""Direction of the tip across the axis, shape (dim - 1,), in a step, and the derivative of the
tip's distance from the axis to it, shape (dim - 1, dim - 1)."""


class WarmStart:
    """Guesses for a march, step by step.

    Parameters
    ----------
    entry : array, shape (dim,), m
        Where the needle enters the skin.
    expected : sequence of (direction, derivative)
        Of its steps; may be empty.

    Attributes
    ----------
    learnt : list of (direction, derivative)
        Steps made so far.
    last : LastStep or None
        The step that ended at the requested depth.
    """

    def __init__(
        self,
        entry: Vector,
        expected: Sequence[Learnt] = (),
        expected_last: "LastStep | None" = None,
    ) -> None:
        self.entry, self.learnt = entry, list[Learnt]()
        self._expected = expected
        self.last: LastStep | None = None
        self._expected_last = expected_last

    def for_entry(self, entry: Vector, near: float) -> "WarmStart":
        """Return the guide of the next march: of no use unless its entry is near (m)."""
        apart = float(np.linalg.norm(entry - self.entry))
        return WarmStart(entry, self.learnt, self.last) if apart <= near else WarmStart(entry)

    def guess(self, slope: Floats, jacobian: Floats) -> Learnt:
        """Return direction and derivative to begin the next step with, from those of the last."""
        number = len(self.learnt)
        if not 0 < number < len(self._expected):
            return slope, jacobian
        (then, _), (now, known) = self._expected[number - 1 : number + 1]
        return slope + now - then, known

    def guess_last(self) -> "LastStep | None":
        """Return what the last step of the march nearby was, if the next one is its equal."""
        last = self._expected_last
        if last is None or len(self.learnt) != last.number or last.number == 0:
            return None
        return last


@dataclasses.dataclass(frozen=True, eq=False)
class LastStep:
    """A step that ended at the requested depth.

    Parameters
    ----------
    number : int
        Number of steps before it.
    length : float, m
    turned : array, shape (dim - 1,)
        Its direction less that of the step before.
    derivatives : array, shape (dim, dim)
        Of depth and lateral distance, m, to length, m, and direction.
    """

    number: int
    length: float
    turned: Floats
    derivatives: Floats
