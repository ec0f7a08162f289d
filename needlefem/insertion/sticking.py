"""Sticking between needle and tissue: rigid, or by a tangential penalty.

Rigid sticking prescribes the displacement of each contact segment. Segments that are much shorter
than the node distance have nearly the same displacement, so that the forces between them are not
determined: their compliance is singular up to round-off. A tangential penalty regularises it: a
sticking segment is attached to the needle by a spring, whose extension is the friction force over
the stiffness. The spring has no effect in forward slip, where friction is at its limit.
"""

import dataclasses
import math

import numpy as np

from needlefem.checks.result import CheckResult
from needlefem.contact.condensed_contact import straight_contact
from needlefem.contact.friction import SlipWeakeningFriction, stick_condition
from needlefem.errors import CaseError
from needlefem.fem.compliance import ComplianceOperator
from needlefem.needle.needle_interface import NeedleInterface
from needlefem.scene import Needle

STICK_CONDITION = 1e9
"""Condition of the response of what sticks from which on its forces are noise: round-off of the
responses, 1e-15, then shows in them at 1e-6."""
GIVES_WAY = 0.01
"""Extension of a chosen penalty at the friction limit, over the tip's radius."""


@dataclasses.dataclass(frozen=True)
class Sticking:
    """The tangential penalty of a scene's needle, and what it is good for.

    Parameters
    ----------
    stiffness : float, Pa (N/m^3 in 2D)
        Per length of path; 0: rigid.
    condition : float
        Of the response of a straight path that sticks, with it.
    rigid_condition : float
        Without.
    reason : str
        Why it was chosen; empty if it was not.
    """

    stiffness: float
    condition: float
    rigid_condition: float
    reason: str = ""


def sticking(
    needle: Needle, instrument: NeedleInterface, responses: ComplianceOperator, length: float
) -> Sticking:
    """Return how what sticks is held: as the scene says, or so that its forces are determined.

    Parameters
    ----------
    needle : Needle
        A `tangential_penalty` of 0 leaves the choice open.
    instrument : NeedleInterface
        On the line that is looked at.
    responses : ComplianceOperator
        Of the tissue.
    length : float, m
        Of the path: the deepest of the motion, as far as it is in the tissue.

    Raises
    ------
    CaseError
        The scene's own penalty is too stiff for the mesh.
    """
    spacing = instrument.spacing
    count = int(length / spacing)
    if count < 2:  # one segment has no neighbour that the mesh could take it for
        return Sticking(needle.tangential_penalty, 1.0, 1.0)
    compliance = straight_contact(instrument, responses, count).sliding().compliance
    lengths = np.full(count, spacing)
    softest = float(np.linalg.eigvalsh(compliance)[-1])
    if not softest * spacing > 0.0:
        problem = "the tissue along the needle does not move under its forces"
        raise CaseError("supports", problem, "hold less of it, or check the size of the mesh")

    def condition(stiffness: float) -> float:
        return stick_condition(
            compliance, SlipWeakeningFriction(stiffness=stiffness).slack(lengths)
        )

    given, rigid = needle.tangential_penalty, condition(0.0)
    stiffest = 0.5 * STICK_CONDITION / (softest * spacing)
    if given > 0.0:
        found = condition(given)
        if found > STICK_CONDITION:
            problem = (
                f"{given:g} is too stiff for the mesh to tell apart what sticks on segments of "
                f"{1e3 * spacing:.3g} mm (discretization.path_spacing)"
            )
            raise CaseError("needle.tangential_penalty", problem, f"write {_rounded(stiffest):g}")
        return Sticking(given, found, rigid)
    if rigid <= STICK_CONDITION:
        return Sticking(0.0, rigid, rigid)
    limit = float(instrument.shaft_friction.max()) * max(1.0, needle.static_friction_ratio)
    wanted = limit / (GIVES_WAY * needle.tip_radius)
    chosen = _rounded(min(wanted or stiffest, stiffest))
    unit = "N/m^3" if len(instrument.axis.frame) == 2 else "Pa"
    reason = (
        f"{chosen:g} {unit}, for the mesh can't tell apart what sticks on segments of "
        f"{1e3 * spacing:.3g} mm (discretization.path_spacing): sticking points move by up to "
        f"{1e3 * limit / chosen:.2g} mm"
    )
    return Sticking(chosen, condition(chosen), rigid, reason)


def sticking_pieces(found: Sticking) -> CheckResult:
    """Check that the forces on segments of the path are determined when all of them stick.

    The condition of their axial response counts, with the tangential penalty that is used.
    """
    return CheckResult(
        name="sticking pieces",
        requirement="segments of the path are long enough, or needle.tangential_penalty is small "
        "enough, for the mesh to tell their sticking apart",
        value=found.condition,
        bound=STICK_CONDITION,
        remedy="lengthen discretization.path_spacing",
    )


def _rounded(stiffness: float) -> float:
    """Return two digits of a number, not more than it."""
    unit = 10.0 ** (math.floor(math.log10(stiffness)) - 1)
    return math.floor(stiffness / unit * (1.0 + 1e-12)) * unit
