"""A needle that lies straight in undeformed tissue."""

import numpy as np

from needlefem.contact.condensed_contact import Contact
from needlefem.fem.compliance import Responses
from needlefem.needle.needle_interface import Instrument


def straight_path(instrument: Instrument, responses: Responses, count: int) -> Contact:
    """Return a contact with a path of equal pieces along the needle's line, without forces.

    Parameters
    ----------
    instrument : Instrument
    responses : Responses
        Of the tissue.
    count : int
        Pieces, from the entry on.
    """
    axis, spacing = instrument.axis, instrument.spacing
    contact = Contact(responses, axis.frame)
    hold = 1.0 / (instrument.lateral_stiffness * spacing)
    for number in range(count):
        ends = axis.tip((number + 1) * spacing), axis.tip(number * spacing)
        trial = contact.try_functionals(instrument.tip_and_piece(*ends))
        contact.adopt(trial, 1, 0.0, np.zeros(len(axis.laterals)), hold)
    return contact
