"""A tip that presses on uncut skin."""

import dataclasses

import numpy as np

from needlefem._arrays import Floats
from needlefem.contact.condensed_contact import CondensedContact
from needlefem.contact.functionals import ContactTrial
from needlefem.fem.interpolation import LinearFunctionals

NEGLIGIBLE_FORCE = 1e-9
"""Force at a step's end, to this part of that at its other end, that is none."""


@dataclasses.dataclass(frozen=True, eq=False)
class SkinContact:
    """The forces (N, N/m in 2D) of a tip that holds the entry point at a depth (m)."""

    trial: ContactTrial
    depth: float
    forces: Floats
    punctured: bool


def press_skin(
    contact: CondensedContact, weights: LinearFunctionals, limit: float, depths: tuple[float, float]
) -> SkinContact:
    """Press on the entry point, to a depth, or until the skin is cut, left or met.

    Parameters
    ----------
    contact : CondensedContact
        Without a path.
    weights : LinearFunctionals
        The tip's kernel at the entry point.
    limit : float, N (N/m in 2D)
        Force at which it cuts.
    depths : (float, float), m
        At the step's start, where the force is lower, and at its end; the same: the step can't
        be cut where the skin is.
    """
    trial, (start, depth) = contact.trial(weights), depths
    forces = holding(contact, trial, depth)
    if depth != start:
        first = holding(contact, trial, start)
        per_depth = (forces[0] - first[0]) / (depth - start)
        small = NEGLIGIBLE_FORCE * max(abs(forces[0]), abs(first[0]))
        if forces[0] > limit:
            depth -= float((forces[0] - limit) / per_depth)
            forces = holding(contact, trial, depth)
            forces[0] = limit
        elif first[0] * forces[0] < 0.0 and min(abs(first[0]), abs(forces[0])) > small:
            depth -= float(forces[0] / per_depth)
            forces = np.zeros_like(forces)
    return SkinContact(trial, depth, forces, bool(forces[0] >= limit))


def holding(contact: CondensedContact, trial: ContactTrial, depth: float) -> Floats:
    """Return the forces that hold the material of a trial at the tip, pulling or pushing.

    Shape (dim,), N (N/m in 2D).
    """
    wanted = np.zeros(contact.dim)
    wanted[0] = depth
    found: Floats = np.linalg.solve(trial.bare, wanted - trial.displacement).astype(float)
    return found
