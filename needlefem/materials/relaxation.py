"""Memory of viscoelastic laws: Maxwell branches beside an elastic spring.

A branch is a spring and a dashpot in a row. The strain of its spring, ``q' + q / T = strain'``,
is all that the law remembers. For a strain that changes evenly over a step, ``q1 = decay q0 +
gain (strain1 - strain0)`` is exact however long the step (R. L. Taylor, K. S. Pister,
G. L. Goudreau 1970), and the step's stiffness depends on its duration alone.
"""

import dataclasses
from typing import Protocol, runtime_checkable

import numpy as np

from needlefem._arrays import Floats
from needlefem.errors import CaseError
from needlefem.materials import voigt

ROUND_OFF = 1e-9
"""Volumetric stress of a branch, relative to its stiffness, that is round-off of zero."""


@dataclasses.dataclass(frozen=True, eq=False)
class Branch:
    """A spring and a dashpot in a row.

    Parameters
    ----------
    time : float, s
        Relaxation time: viscosity over stiffness.
    stiffness : array, shape (6, 6) (a law's) or (3, 3) (in the plane), Pa
        Of the spring, in Voigt's notation.
    """

    time: float
    stiffness: Floats


@runtime_checkable
class HasBranches(Protocol):
    """A linear law with a memory."""

    def branches(self) -> tuple[Branch, ...]:
        """Return the branches beside the spring of the law's compliance."""
        ...


def relaxation_factor(step: float, time: float) -> float:
    """Return what is left of a branch's strain after a step."""
    return float(np.exp(-step / time))


def load_factor(step: float, time: float) -> float:
    """Return what a branch's spring keeps of a change of strain spread over a step.

    1 at once, 0 in an endless step.
    """
    share = step / time
    if share == 0.0:
        return 1.0
    return 0.0 if np.isinf(share) else float(-np.expm1(-share) / share)


def branches_of(material: object, dim: int, plane: str) -> tuple[Branch, ...]:
    """Return a law's branches in space or in the plane; none if it has no memory.

    Raises
    ------
    CaseError
        Plane stress, or a branch that resists a change of volume.
    """
    found = material.branches() if isinstance(material, HasBranches) else ()
    for branch in found:
        if not branch.time > 0.0:
            raise CaseError("material", f"a relaxation time of {branch.time:g} s", "above 0")
        pressed = branch.stiffness @ voigt.volumetric(3)
        if np.abs(pressed).max() > ROUND_OFF * np.abs(branch.stiffness).max():
            remedy = "let the branches resist changes of shape alone"
            raise CaseError("material", "its resistance to a change of volume relaxes", remedy)
    if dim == 3 or not found:
        return tuple(found)
    if plane == "stress":
        remedy = "use plane strain"
        raise CaseError("plane", "a memory in plane stress: the thickness has its own", remedy)
    rows = np.array(voigt.IN_PLANE)
    return tuple(Branch(b.time, b.stiffness[np.ix_(rows, rows)]) for b in found)
