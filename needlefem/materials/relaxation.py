"""Relaxation of viscoelastic laws: Maxwell branches parallel to an elastic spring.

A branch is a spring and a dashpot in series. Its internal variable is the strain of the spring,
``q' + q / T = strain'``. If the strain changes linearly over a step, ``q1 = decay q0 +
gain (strain1 - strain0)`` is exact for steps of any length (R. L. Taylor, K. S. Pister,
G. L. Goudreau 1970), and the stiffness of the step depends on its duration alone.
"""

import dataclasses
from typing import Protocol, runtime_checkable

import numpy as np

from needlefem._arrays import Floats
from needlefem.errors import CaseError
from needlefem.materials import voigt

ROUND_OFF = 1e-9
"""Volumetric stress of a branch, relative to its stiffness, that counts as zero."""


@dataclasses.dataclass(frozen=True, eq=False)
class Branch:
    """A spring and a dashpot in series.

    Parameters
    ----------
    time : float, s
        Relaxation time: viscosity over stiffness.
    stiffness : array, shape (6, 6) (a law's) or (3, 3) (in the plane), Pa
        Stiffness of the spring in Voigt notation.
    """

    time: float
    stiffness: Floats


@runtime_checkable
class HasBranches(Protocol):
    """A linear viscoelastic law."""

    def branches(self) -> tuple[Branch, ...]:
        """Return the branches parallel to the spring of the law's compliance."""
        ...


def relaxation_factor(step: float, time: float) -> float:
    """Return the fraction of a branch's strain that remains after a step."""
    return float(np.exp(-step / time))


def load_factor(step: float, time: float) -> float:
    """Return the fraction of a linear strain change that the spring has at the end of a step.

    It is 1 for a sudden change and 0 for an infinite duration.
    """
    share = step / time
    if share == 0.0:
        return 1.0
    return 0.0 if np.isinf(share) else float(-np.expm1(-share) / share)


def branches_of(material: object, dim: int, plane: str) -> tuple[Branch, ...]:
    """Return the branches of a law in space or in the plane; none for an elastic law.

    Raises
    ------
    CaseError
        Plane stress, or a branch whose volumetric stiffness relaxes.
    """
    found = material.branches() if isinstance(material, HasBranches) else ()
    for branch in found:
        if not branch.time > 0.0:
            raise CaseError("material", f"a relaxation time of {branch.time:g} s", "above 0")
        pressed = branch.stiffness @ voigt.volumetric(3)
        if np.abs(pressed).max() > ROUND_OFF * np.abs(branch.stiffness).max():
            remedy = "only the resistance to a change of shape may relax"
            raise CaseError("material", "its resistance to a change of volume relaxes", remedy)
    if dim == 3 or not found:
        return tuple(found)
    if plane == "stress":
        remedy = "use plane strain"
        raise CaseError("plane", "viscoelastic tissue is not possible in plane stress", remedy)
    rows = np.array(voigt.IN_PLANE)
    return tuple(Branch(b.time, b.stiffness[np.ix_(rows, rows)]) for b in found)
