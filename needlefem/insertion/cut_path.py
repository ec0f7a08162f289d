"""The cut path of a needle in any motion: its pieces, and what each remembers of sliding."""

import numpy as np

from needlefem._arrays import Floats, Vector
from needlefem.needle.needle_interface import NeedleInterface


class CutPath:
    """Where the needle has cut, and how its surface has slid there.

    Piece 0 is the entry point, without length; piece j ends at `vertices[j]`; the last, number
    `count`, grows from the newest vertex to the crack front.
    """

    def __init__(self, instrument: NeedleInterface) -> None:
        self.instrument = instrument
        self.vertices: list[Vector] = [instrument.axis.entry]
        self.arcs: list[float] = [0.0]
        self.crack_front: Vector = instrument.axis.entry
        self.kinetic: list[float] = [0.0]
        """Friction limit of whole pieces, N (N/m in 2D)."""
        self.friction_force: Floats = np.zeros(2)
        """Friction force on every piece, the growing one included."""
        self.slip_since_stick: Floats = np.full(2, np.inf)
        """Slip of every piece since it last stuck, m; without end for freshly cut ones."""
        self.pace = self.slope = 1.0
        """Advance on the path per depth, and gap per advance, when the tip was last drawn back."""

    @property
    def count(self) -> int:
        """Number of whole pieces."""
        return len(self.vertices)

    @property
    def length(self) -> float:
        """Length of the cut path, m."""
        return self.arcs[-1] + float(np.linalg.norm(self.crack_front - self.vertices[-1]))

    def at(self, arc: float) -> tuple[int, Vector]:
        """Return the number of whole pieces behind a path length, and the material point there."""
        whole = min(max(int(np.searchsorted(self.arcs, arc, side="left")), 1), self.count)
        start, begin = self.vertices[whole - 1], self.arcs[whole - 1]
        end = self.crack_front if whole == self.count else self.vertices[whole]
        span = (self.length if whole == self.count else self.arcs[whole]) - begin
        share = (arc - begin) / span if span > 0.0 else 0.0
        return whole, start + share * (end - start)

    def extend(self, kinetic: float) -> None:
        """Make the growing piece a whole one, and begin the next."""
        self.arcs.append(self.length)
        self.vertices.append(self.crack_front)
        self.kinetic.append(kinetic)
        self.friction_force = np.append(self.friction_force, 0.0)
        self.slip_since_stick = np.append(self.slip_since_stick, np.inf)

    def store(self, pull: Floats, slipped: Floats) -> None:
        """Keep friction forces, and slip since sticking, of the pieces that the needle is in."""
        count = len(pull)
        self.friction_force = np.zeros(len(self.friction_force))
        self.friction_force[:count] = pull
        self.slip_since_stick = np.full(
            len(self.slip_since_stick), np.inf
        )  # caught again it slides at once
        self.slip_since_stick[:count] = slipped
