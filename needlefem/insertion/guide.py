"""What one march learns from the one before it: where the tip goes next.

A search over heights pushes needles in one beside the other. Their tips turn alike, step by step,
and so do the derivatives that a step is solved with. Both are guesses only: a step is solved to
the same tolerance whatever it began from.
"""

from collections.abc import Sequence

import numpy as np

from needlefem.arrays import Floats, Vector

Learnt = tuple[Floats, Floats]
"""Direction of the tip across the axis, shape (dim - 1,), in a step, and the derivative of the
tip's distance from the axis to it, shape (dim - 1, dim - 1)."""


class Guide:
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
    """

    def __init__(self, entry: Vector, expected: Sequence[Learnt] = ()) -> None:
        self.entry, self.learnt = entry, list[Learnt]()
        self._expected = expected

    def beside(self, entry: Vector, near: float) -> "Guide":
        """Return the guide of the next march: of no use unless its entry is near (m)."""
        apart = float(np.linalg.norm(entry - self.entry))
        return Guide(entry, self.learnt if apart <= near else ())

    def guess(self, slope: Floats, jacobian: Floats) -> Learnt:
        """Return direction and derivative to begin the next step with, from those of the last."""
        number = len(self.learnt)
        if not 0 < number < len(self._expected):
            return slope, jacobian
        (then, _), (now, known) = self._expected[number - 1 : number + 1]
        return slope + now - then, known
