"""What the package must know of an element."""

import dataclasses
from collections.abc import Callable
from typing import Any

from needlefem._arrays import Floats
from needlefem.elements.quadrature import Rule
from needlefem.errors import CaseError

DISPLACEMENT, BBAR, MIXED = "plain", "mean", "pressure"


@dataclasses.dataclass(frozen=True, kw_only=True)
class ElementType:
    """One row of the catalogue.

    Parameters
    ----------
    name : str
        The word used in a case.
    cell : str
        Shape of the cells of its meshes: triangle, quadrilateral, tetrahedron or hexahedron.
    make : callable
        Returns the scalar scikit-fem element of a displacement component. Its shape functions
        are nodal: each is 1 at its own node and 0 at the others.
    degree : int
        Complete polynomial degree, the order of convergence of the strain.
    stiffness_rule, mass_rule : callable
        Return the quadratures of K and M on the reference cell.
    lumpings : tuple of str
        Mass lumpings that give positive masses with the right total.
    poissons_ratio_limit : float
        Above it the element locks: the scene is warned.
    stress_limit : float
        Poisson's ratio above which its stress may not be read.
    volume : str
        How a change of volume is resisted: ``"plain"`` at every quadrature point, ``"mean"`` by
        its mean over the cell (B-bar), ``"pressure"`` through a pressure of its own (mixed).
    volume_rule : callable, optional
        Quadrature of the volumetric part of a ``"mean"`` element: one point.
    pressure : callable, optional
        Returns the scikit-fem element of the pressure of a mixed element.
    """

    name: str
    cell: str
    make: Callable[[], Any]
    degree: int
    stiffness_rule: Rule
    mass_rule: Rule
    lumpings: tuple[str, ...]
    poissons_ratio_limit: float
    stress_limit: float = 0.49
    volume: str = DISPLACEMENT
    volume_rule: Rule | None = None
    pressure: Callable[[], Any] | None = None

    def __post_init__(self) -> None:
        if (self.volume == BBAR) != (self.volume_rule is not None):
            remedy = "give it with volume='mean', and only then"
            raise CaseError(f"element {self.name}", "volume_rule and volume disagree", remedy)
        if (self.volume == MIXED) != (self.pressure is not None):
            remedy = "give it with volume='pressure', and only then"
            raise CaseError(f"element {self.name}", "pressure and volume disagree", remedy)

    @property
    def definite(self) -> bool:
        """Whether its matrices are positive definite; those of mixed elements are not."""
        return self.volume != MIXED

    @property
    def nodes(self) -> Floats:
        """Places of the nodes in the reference cell, shape (n, dim)."""
        places: Floats = self.make().doflocs
        return places
