"""Contact of the needle with the tissue.

The tissue's equations are condensed on the forces at the needle, segment by segment. Friction
limits the force along the shaft; the solvers here find which segments stick and which slip.
"""

from typing import TYPE_CHECKING

from needlefem._exports import lazy_exports

if TYPE_CHECKING:
    from needlefem.contact.condensed_contact import (
        AxialCompliance,
        CondensedContact,
        ContactSegment,
        ContactTrial,
        ShaftEquations,
        straight_contact,
    )
    from needlefem.contact.friction import FrictionStep, SlipWeakeningFriction, solve_bound_qp

__all__ = [
    "AxialCompliance",
    "CondensedContact",
    "ContactSegment",
    "ContactTrial",
    "FrictionStep",
    "ShaftEquations",
    "SlipWeakeningFriction",
    "solve_bound_qp",
    "straight_contact",
]

if not TYPE_CHECKING:
    __getattr__, __dir__ = lazy_exports(
        __name__,
        condensed_contact=(
            "AxialCompliance CondensedContact ContactSegment ContactTrial ShaftEquations "
            "straight_contact"
        ),
        friction="FrictionStep SlipWeakeningFriction solve_bound_qp",
    )
