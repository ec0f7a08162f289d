"""The element catalogue: one row an element, chosen by name."""

import dataclasses
from collections.abc import Callable
from typing import Any

import skfem

from needlefem.errors import CaseError, nearest


@dataclasses.dataclass(frozen=True, kw_only=True)
class ElementRow:
    """What needlefem must know of a scikit-fem element.

    Parameters
    ----------
    name : str
        The word used in a case.
    cell : str
        Cell shape of the meshes it lives on.
    make : callable
        Returns the scalar scikit-fem element.
    degree : int
        Complete polynomial degree, which is the order of convergence in L2 less one.
    stiffness_order, mass_order : int
        Polynomial degree that the quadratures of K and M integrate exactly.
    lumpings : tuple of str
        Mass lumpings that give a positive mass with the right total.
    poissons_ratio_limit : float
        Above it the element locks: the scene is warned.
    """

    name: str
    cell: str
    make: Callable[[], Any]
    degree: int
    stiffness_order: int
    mass_order: int
    lumpings: tuple[str, ...]
    poissons_ratio_limit: float


_ROWS = (
    ElementRow(
        name="P1",
        cell="triangle",
        make=skfem.ElementTriP1,
        degree=1,
        stiffness_order=0,
        mass_order=2,
        lumpings=("row-sum", "hrz"),
        poissons_ratio_limit=0.45,
    ),
    ElementRow(
        name="P2",
        cell="triangle",
        make=skfem.ElementTriP2,
        degree=2,
        stiffness_order=2,
        mass_order=4,
        lumpings=("hrz",),
        poissons_ratio_limit=0.49,
    ),
)

CATALOGUE: dict[str, ElementRow] = {row.name: row for row in _ROWS}


def element_row(name: str, key: str = "discretisation.element") -> ElementRow:
    """Return the catalogue's row for `name`, or raise a `CaseError` with the nearest name."""
    if name not in CATALOGUE:
        raise CaseError(key, f"no element '{name}'", nearest(name, CATALOGUE))
    return CATALOGUE[name]
