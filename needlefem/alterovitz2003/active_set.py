"""Forces within limits: what is held, and what gives way.

Every row is a functional of the displacement with a force on it. Within its limits a row is held
at its target; at a limit it gives way in the direction in which the force pushes. A node on a
shaft is attached or slides in this way; a tip holds or cuts; a constraint has no limits.
"""

import dataclasses

import numpy as np
from scipy.linalg.lapack import dposv

from needlefem._arrays import Bools, Floats
from needlefem.errors import SimulationError

TIE = 1e-12
"""Margin, relative, by which a force must exceed its limit, or a displacement its target, to count:
what lies at the limit stays as it is, whatever the round-off."""
FREELY, MOST_ROUNDS = 10, 60
"""Rounds after which what once gave way in a step is not held again, and the most rounds."""


@dataclasses.dataclass(frozen=True, eq=False)
class ForceLimits:
    """Limits of the forces.

    Parameters
    ----------
    low, high : arrays, shape (n,), N (N/m in 2D)
        Equal ones prescribe a force; infinite ones hold always.
    grip : float
        What a held row bears, over the limit of one that gives way (static over kinetic).
    """

    low: Floats
    high: Floats
    grip: float = 1.0


@dataclasses.dataclass(frozen=True, eq=False)
class ActiveSetSolution:
    """Forces, displacements, and which rows are held; arrays of shape (n,)."""

    forces: Floats
    moved: Floats
    held: Bools


def solve_active_set(
    compliance: Floats, free: Floats, target: Floats, limits: ForceLimits, before: ActiveSetSolution
) -> ActiveSetSolution:
    """Find forces for which whatever is within its limits is at its target.

    An active-set iteration on the rows, starting from what was held before.

    Parameters
    ----------
    compliance : array, shape (n, n), m/N
        Symmetric, positive definite.
    free : array, shape (n,), m
        Displacements without the forces.
    target : array, shape (n,), m
    limits : ForceLimits
    before : ActiveSetSolution
        Which rows are tried to be held first; signs of forces say at which limit the others are.

    Raises
    ------
    SimulationError
        No consistent state was found.
    """
    may = limits.low < limits.high
    held = may & (before.held | np.isinf(limits.high))
    forces = np.where(before.forces >= 0.0, limits.high, limits.low)
    forces[held] = 0.0
    for number in range(MOST_ROUNDS):
        loose = np.where(held, 0.0, forces)
        rest = target - free - compliance @ loose
        forces = loose
        rows = np.flatnonzero(held)
        if rows.size:
            _, solved, singular = dposv(compliance[rows[:, None], rows], rest[rows])
            if singular:
                raise SimulationError("two nodes on the needle hold the same material")
            forces[rows] = solved
        moved = free + compliance @ forces
        margin = TIE * float(np.abs(forces).max(initial=0.0))
        over = held & (forces > limits.grip * limits.high + margin)
        under = held & (forces < limits.grip * limits.low - margin)
        back = may & ~held & _against(forces, moved - target, limits, free)
        if number >= FREELY:
            back[:] = False
        if not (over.any() or under.any() or back.any()):
            return ActiveSetSolution(forces, moved, held)
        forces[over], forces[under] = limits.high[over], limits.low[under]
        held = (held & ~over & ~under) | back
    raise SimulationError("what sticks to the needle and what slides was not found")


def _against(forces: Floats, beyond: Floats, limits: ForceLimits, free: Floats) -> Bools:
    """Return which rows at a limit would move against their force."""
    margin = TIE * float(np.abs(free).max(initial=0.0) + np.abs(beyond).max(initial=0.0))
    return np.where(forces >= limits.high, beyond > margin, beyond < -margin)
