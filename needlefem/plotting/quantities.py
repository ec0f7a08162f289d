"""Fields that pictures can show: names, units, values."""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np

from needlefem._arrays import Floats
from needlefem.errors import CaseError, nearest
from needlefem.fem.recovery import CellFields
from needlefem.insertion.postprocess import LARGE_STRAIN
from needlefem.plotting.panel import Scale

TOP = 99.5
"""Percentile of all values that the colour map ends at: one cell at the tip must not eat it."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class FieldQuantity:
    """A field to show.

    Parameters
    ----------
    label : str
        With its unit.
    factor : float
        From SI to that unit.
    values : callable
        Takes the reader of a model's cells and a displacement, shape (ndofs,), m; returns one
        value a vertex or a cell, NaN where a cell is turned over.
    nodal : bool
        Whether the values are those of vertices.
    signed : bool
        Whether the scale is symmetric about zero.
    note : str
        Written into the picture.
    """

    label: str
    factor: float
    values: Callable[[CellFields, Floats], Floats]
    nodal: bool = False
    signed: bool = False
    note: str = ""

    def of(self, cells: CellFields, u: Floats) -> Floats:
        """Return the values in the label's unit."""
        found: Floats = self.factor * self.values(cells, u)
        return found


def _displacement(cells: CellFields, u: Floats) -> Floats:
    moved = u[cells.model.basis.nodal_dofs]
    size: Floats = np.linalg.norm(moved, axis=0)
    return size


def _validity(cells: CellFields, u: Floats) -> Floats:
    """Return the strain relative to what small strain describes; NaN in cells turned over."""
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
        note="small strain holds up to 1; orange: folded cells",
    ),
}  # fmt: skip
"""The fields that a picture can show, by the names of ``--field``."""


def quantity(name: str) -> FieldQuantity:
    """Return a quantity by name.

    Raises
    ------
    CaseError
        There is none of that name.
    """
    if name not in QUANTITIES:
        raise CaseError("field", f"no field '{name}'", nearest(name, QUANTITIES))
    return QUANTITIES[name]


def scale_of(shown: FieldQuantity, values: Sequence[Floats]) -> Scale:
    """Return the scale that pictures of some values share."""
    finite = np.concatenate([found[np.isfinite(found)] for found in values])
    size = np.abs(finite) if finite.size else np.zeros(1)
    top = float(np.percentile(size, TOP)) or float(size.max()) or 1.0
    over = bool(finite.size and finite.max() > top * (1.0 + 1e-9))
    return Scale(label=shown.label, low=-top if shown.signed else 0.0, high=top, over=over)
