"""The tissue's displacement at one moment of a motion, found where it is asked for."""

import numpy as np

from needlefem._arrays import Floats
from needlefem.contact.condensed_contact import CondensedContact
from needlefem.contact.functionals import ContactTrial
from needlefem.fem.interpolation import LinearFunctionals


class ZeroField:
    """No displacement; see `Field`."""

    def __init__(self, dim: int) -> None:
        self._dim = dim

    def means(self, weights: LinearFunctionals) -> Floats:
        """See `Field`."""
        return np.zeros((len(weights.rows), self._dim))


class ContactField:
    """Displacement under the needle's forces of one moment; see `Field`.

    Parameters
    ----------
    contact : CondensedContact
    path : array, shape (n,), N (N/m in 2D)
        Forces on the first pieces, needle's frame, piece-major.
    trial : ContactTrial, optional
        Functionals on which there are forces as well.
    forces : array, shape (rows,), N (N/m in 2D)
        Forces on them.
    """

    def __init__(
        self, contact: CondensedContact, path: Floats, trial: ContactTrial | None, forces: Floats
    ) -> None:
        self._contact, self._path, self._trial, self._forces = contact, path, trial, forces
        self._background = contact.background

    def means(self, weights: LinearFunctionals) -> Floats:
        """See `Field`."""
        moved = self._contact.field_at(weights.nodes, self._path, self._trial, self._forces)
        if self._background is not None:
            moved = moved + self._background[weights.nodes]
        found: Floats = weights.rows @ moved @ self._contact.frame.T
        return found
