"""A tip that presses on uncut skin."""

import dataclasses

import numpy as np

from needlefem.arrays import Floats
from needlefem.fem.interpolation import Weights
from needlefem.needle.contact import Contact
from needlefem.needle.functionals import Trial


@dataclasses.dataclass(frozen=True, eq=False)
class Touch:
    """The forces (N, N/m in 2D) of a tip that holds the entry point at a depth (m)."""

    trial: Trial
    depth: float
    forces: Floats
    punctured: bool


def touch(contact: Contact, weights: Weights, limit: float, depths: tuple[float, float]) -> Touch:
    """Press on the entry point, to a depth or until the skin is cut.

    Parameters
    ----------
    contact : Contact
        Without a path.
    weights : Weights
        The tip's kernel at the entry point.
    limit : float, N (N/m in 2D)
        Force at which it cuts.
    depths : (float, float), m
        At the step's start, where the force is lower, and at its end; the same: the step can't
        be cut where the skin is.
    """
    trial, (start, depth) = contact.try_functionals(weights), depths
    forces = _holding(contact, trial, depth)
    if depth != start and forces[0] > limit:
        per_depth = (forces[0] - _holding(contact, trial, start)[0]) / (depth - start)
        depth -= float((forces[0] - limit) / per_depth)
        forces = _holding(contact, trial, depth)
        forces[0] = limit
    return Touch(trial, depth, forces, bool(forces[0] >= limit))


def _holding(contact: Contact, trial: Trial, depth: float) -> Floats:
    wanted = np.zeros(contact.dim)
    wanted[0] = depth
    found: Floats = np.linalg.solve(trial.bare, wanted - trial.displacement).astype(float)
    return found
