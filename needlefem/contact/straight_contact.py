"""A needle that lies straight in undeformed tissue."""

import numpy as np

from needlefem.contact.condensed_contact import CondensedContact
from needlefem.fem.compliance import ComplianceOperator
from needlefem.needle.needle_interface import NeedleInterface


def straight_contact(
    instrument: NeedleInterface, responses: ComplianceOperator, count: int
) -> CondensedContact:
    """Return a contact with a path of equal pieces along the needle's line, without forces.

    Parameters
    ----------
    instrument : NeedleInterface
    responses : ComplianceOperator
        Of the tissue.
    count : int
        Pieces, from the entry on.
    """
    axis, spacing = instrument.axis, instrument.spacing
    contact = CondensedContact(responses, axis.frame)
    hold = 1.0 / (instrument.lateral_stiffness * spacing)
    for number in range(count):
        ends = axis.tip_position((number + 1) * spacing), axis.tip_position(number * spacing)
        trial = contact.trial(instrument.tip_and_piece(*ends))
        contact.append_segment(trial, 1, 0.0, np.zeros(len(axis.lateral_directions)), hold)
    return contact
