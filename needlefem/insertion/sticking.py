"""Sticking between needle and tissue: rigid, or with a tangential penalty.

Rigid sticking prescribes the displacement of each contact segment. Segments that are much shorter
than the distance of the nodes have nearly the same displacement, so that the forces on them are not
determined: their compliance matrix is singular up to round-off. A tangential penalty regularizes
it: a sticking segment is attached to the needle by a spring, whose extension is the friction force
over the stiffness. The spring has no effect during forward slip, where friction is at its limit.
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
"""Condition number of the compliance of sticking segments above which their forces are not
determined. Round-off of the compliances, 1e-15, then causes errors of 1e-6 in the forces."""
GIVES_WAY = 0.01
"""Spring extension at the friction limit, over the tip radius, for a penalty that is chosen."""


@dataclasses.dataclass(frozen=True)
class Sticking:
    """The tangential penalty of a needle, and the condition number of the compliance.

    Parameters
    ----------
    stiffness : float, Pa (N/m^3 in 2D)
        Stiffness per length of path; 0: rigid sticking.
    condition : float
        Condition number of the compliance of a straight path that sticks, with this stiffness.
    rigid_condition : float
        Condition number for rigid sticking.
    reason : str
        Why the stiffness was chosen; empty if the scene prescribes it or sticking is rigid.
    """

    stiffness: float
    condition: float
    rigid_condition: float
    reason: str = ""


def sticking(
    needle: Needle, instrument: NeedleInterface, responses: ComplianceOperator, length: float
) -> Sticking:
    """Return the tangential penalty of a needle: that of the scene, or a chosen one.

    It is chosen where the forces of rigid sticking are not determined.

    Parameters
    ----------
    needle : Needle
        A `tangential_penalty` of 0 leaves the choice open.
    instrument : NeedleInterface
        The needle on the axis for which the condition number is computed.
    responses : ComplianceOperator
        Compliances of the tissue.
    length : float, m
        Length of the path: the largest depth of the motion, as far as it is in the tissue.

    Raises
    ------
    CaseError
        The penalty of the scene is too stiff for the mesh.
    """
    spacing = instrument.spacing
    count = int(length / spacing)
    if count < 2:  # a single segment has no neighbor with nearly the same displacement
        return Sticking(needle.tangential_penalty, 1.0, 1.0)
    compliance = straight_contact(instrument, responses, count).sliding().compliance
    lengths = np.full(count, spacing)
    softest = float(np.linalg.eigvalsh(compliance)[-1])
    if not softest * spacing > 0.0:
        problem = "the tissue along the needle is not displaced by the needle's forces"
        raise CaseError("supports", problem, "support less of it, or check the size of the mesh")

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
                f"{given:g} is so stiff that the mesh does not resolve sticking on segments of "
                f"{1e3 * spacing:.3g} mm (discretization.path_spacing)"
            )
            raise CaseError("needle.tangential_penalty", problem, f"write {_rounded(stiffest):g}")
        return Sticking(given, found, rigid)
    if rigid <= STICK_CONDITION:
        return Sticking(0.0, rigid, rigid)
    limit = float(instrument.shaft_friction.max()) * max(1.0, needle.static_friction_ratio)
    suggested = limit / (GIVES_WAY * needle.tip_radius)
    chosen = _rounded(min(suggested or stiffest, stiffest))
    unit = "N/m^3" if len(instrument.axis.frame) == 2 else "Pa"
    reason = (
        f"{chosen:g} {unit}, because the mesh does not resolve rigid sticking on segments of "
        f"{1e3 * spacing:.3g} mm (discretization.path_spacing): sticking points move by up to "
        f"{1e3 * limit / chosen:.2g} mm"
    )
    return Sticking(chosen, condition(chosen), rigid, reason)


def sticking_segments(found: Sticking) -> CheckResult:
    """Check that the forces on contact segments are determined when all of them stick.

    The value is the condition number of their axial compliance with the tangential penalty in use.
    """
    return CheckResult(
        name="sticking segments",
        requirement="contact segments are so long, or needle.tangential_penalty is so small, that "
        "the mesh resolves sticking",
        value=found.condition,
        bound=STICK_CONDITION,
        remedy="lengthen discretization.path_spacing",
    )


def _rounded(stiffness: float) -> float:
    """Round a positive number down to two digits."""
    unit = 10.0 ** (math.floor(math.log10(stiffness)) - 1)
    return math.floor(stiffness / unit * (1.0 + 1e-12)) * unit
