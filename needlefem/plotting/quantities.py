"""Fields that pictures can show: names, units, values and colour scales."""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np

from needlefem._arrays import Floats
from needlefem.errors import CaseError, nearest
from needlefem.fem.recovery import CellFields
from needlefem.insertion.strain_check import LARGE_STRAIN
from needlefem.plotting.panel import Scale

TOP = 99.5
"""Percentile of the values at the end of the colour scale; few cells at the tip exceed it."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class FieldQuantity:
    """A field that a picture can show.

    Parameters
    ----------
    label : str
        Name of the quantity with its unit.
    factor : float
        Factor from SI to this unit.
    values : callable
        Takes the cell fields of a model and a displacement, shape (ndofs,), m; returns one value
        per vertex or cell, NaN in inverted cells.
    nodal : bool
        Whether the values belong to vertices.
    signed : bool
        Whether the scale is symmetric about zero.
    note : str
        Note in the picture.
    """

    label: str
    factor: float
    values: Callable[[CellFields, Floats], Floats]
    nodal: bool = False
    signed: bool = False
    note: str = ""

    def of(self, cells: CellFields, u: Floats) -> Floats:
        """Return the values of a displacement in the unit of the label."""
        found: Floats = self.factor * self.values(cells, u)
        return found


def _displacement(cells: CellFields, u: Floats) -> Floats:
    moved = u[cells.model.basis.nodal_dofs]
    size: Floats = np.linalg.norm(moved, axis=0)
    return size


def _validity(cells: CellFields, u: Floats) -> Floats:
    """Return the strain relative to the limit of small strain; NaN in inverted cells."""
    share: Floats = cells.largest_strain(u) / LARGE_STRAIN
    return np.where(cells.volume_ratio(u) > 0.0, share, np.nan)


QUANTITIES = {
    "displacement": FieldQuantity(
        label="displacement (mm)", factor=1e3, values=_displacement, nodal=True
    ),
    "strain": FieldQuantity(
        label="largest strain (%)", factor=1e2, values=lambda cells, u: cells.largest_strain(u)
    ),
    "von-mises": FieldQuantity(
        label="von Mises stress (kPa)", factor=1e-3, values=lambda cells, u: cells.von_mises(u)
    ),
    "pressure": FieldQuantity(
        label="pressure (kPa)", factor=1e-3, values=lambda c, u: c.pressure(u), signed=True
    ),
    "validity": FieldQuantity(
        label=f"strain / {LARGE_STRAIN:g} (1)", factor=1.0, values=_validity,
        note="small strain is valid up to 1; orange: inverted cells",
    ),
}  # fmt: skip
"""The fields that a picture can show, by the names of ``--field``."""


def quantity(name: str) -> FieldQuantity:
    """Return a quantity by name.

    Raises
    ------
    CaseError
        The field does not exist.
    """
    if name not in QUANTITIES:
        raise CaseError("field", f"no field '{name}'", nearest(name, QUANTITIES))
    return QUANTITIES[name]


def scale_of(shown: FieldQuantity, values: Sequence[Floats]) -> Scale:
    """Return a common colour scale for several pictures."""
    finite = np.concatenate([found[np.isfinite(found)] for found in values])
    size = np.abs(finite) if finite.size else np.zeros(1)
    top = float(np.percentile(size, TOP)) or float(size.max()) or 1.0
    over = bool(finite.size and finite.max() > top * (1.0 + 1e-9))
    return Scale(label=shown.label, low=-top if shown.signed else 0.0, high=top, over=over)
