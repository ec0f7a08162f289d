"""Internal variables of viscoelastic tissue over steps of one duration.

What a Maxwell branch remembers is a strain, and the strain of a displacement of its own: the
branches with one relaxation time need one vector of unknowns between them, not numbers at every
quadrature point.
"""

from collections.abc import Sequence

import numpy as np

from needlefem._arrays import Floats, Sparse
from needlefem.materials.relaxation import load_factor, relaxation_factor


class MaxwellUpdate:
    """Branches of a system, ready for one step.

    Parameters
    ----------
    branches : sequence of (float, sparse matrix)
        Relaxation times, s, and stiffnesses on the unknowns.
    step : float, s

    Attributes
    ----------
    gains : list of float
        Share of every branch's stiffness in the step's operator.
    """

    def __init__(self, branches: Sequence[tuple[float, Sparse]], step: float) -> None:
        self._stiffness = [stiffness for _, stiffness in branches]
        self._decays = [relaxation_factor(step, time) for time, _ in branches]
        self.gains = [load_factor(step, time) for time, _ in branches]

    def __bool__(self) -> bool:
        """Whether there is anything to remember."""
        return bool(self.gains)

    def carried(self, parts: Floats, u: Floats, before: float = 0.0) -> Floats:
        """Return the branches' force in a step, without what the new displacement adds.

        Weighted by `before` at the step's start and the rest at its end; shape (n,), N.
        """
        total = np.zeros_like(u)
        for part, stiffness, left, kept in zip(
            parts, self._stiffness, self._decays, self.gains, strict=True
        ):
            ends = (1.0 - before) * (left * part - kept * u)
            total += stiffness @ (ends + before * part if before else ends)
        return total

    def force(self, parts: Floats) -> Floats:
        """Return the branches' force, shape (n,), N."""
        total = np.zeros(parts.shape[1])
        for part, stiffness in zip(parts, self._stiffness, strict=True):
            total += stiffness @ part
        return total

    def advance(self, parts: Floats, change: Floats) -> Floats:
        """Return the branches' displacements after a step in which `u` changed."""
        pairs = zip(parts, self._decays, self.gains, strict=True)
        return np.array([left * part + kept * change for part, left, kept in pairs])

    def energy(self, parts: Floats) -> float:
        """Return the energy stored in the branches, J."""
        pairs = zip(parts, self._stiffness, strict=True)
        return 0.5 * float(sum(part @ (stiffness @ part) for part, stiffness in pairs))

    def lost(self, before: Floats, after: Floats, *, at_once: bool = False) -> float:
        """Return what the dashpots take in a step, J.

        Mean force times change of displacement, less the change of energy, from both ends'
        displacements alone; for short steps ``step / T`` times twice the mean energy. `at_once`
        is a change from one end of the same step to another, in which nothing decays.
        """
        total = 0.0
        zipped = zip(before, after, self._stiffness, self._decays, self.gains, strict=True)
        for old, new, stiffness, decayed, kept in zipped:
            left = 1.0 if at_once else decayed
            slipped = (1.0 / kept - 1.0) * new + (1.0 - left / kept) * old
            total += 0.5 * float((old + new) @ (stiffness @ slipped))
        return total
