"""The catalogue of elements: one `ElementType` for each name in a case."""

import dataclasses
from collections.abc import Callable

import numpy as np
import skfem
from skfem.element.element_h1 import ElementH1
from skfem.refdom import RefTri

from needlefem import _plugin
from needlefem._arrays import Floats, SkfemElement
from needlefem.elements.shape_functions import Rule, gauss, simplex
from needlefem.errors import CaseError, matching, nearest, short

DISPLACEMENT, BBAR, MIXED = "plain", "mean", "pressure"
"""How an element treats volume changes: by displacements alone, by their mean in a cell (B-bar
method), or by a pressure of its own (mixed method); values of `ElementType.volume`."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class ElementType:
    """An element of the catalogue.

    Parameters
    ----------
    name : str
        Name of the element in a case.
    cell : str
        Shape of the cells of its meshes: triangle, quadrilateral, tetrahedron or hexahedron.
    skfem_element : callable
        Returns the scalar scikit-fem element of one displacement component. Its basis must be
        nodal: each shape function is 1 at its own node and 0 at all others.
    degree : int
        Complete polynomial degree, which is the order of convergence of the strain.
    stiffness_rule, mass_rule : callable
        Return the quadrature rules of K and M on the reference cell.
    lumpings : tuple of str
        Lumping schemes that give positive masses with the correct sum.
    poissons_ratio_limit : float
        Poisson's ratio above which the element locks and a warning is given.
    stress_limit : float
        Poisson's ratio above which the stress of the element is not accurate.
    volume : str
        Treatment of a change of volume: ``"plain"`` at each quadrature point, ``"mean"`` by its
        mean over the cell (B-bar), ``"pressure"`` by a pressure field (mixed element).
    volume_rule : callable, optional
        Quadrature of the volumetric part of a ``"mean"`` element: one point.
    pressure : callable, optional
        Returns the scikit-fem element of the pressure of a mixed element.
    """

    name: str
    cell: str
    skfem_element: Callable[[], SkfemElement]
    degree: int
    stiffness_rule: Rule
    mass_rule: Rule
    lumpings: tuple[str, ...]
    poissons_ratio_limit: float
    stress_limit: float = 0.49
    volume: str = DISPLACEMENT
    volume_rule: Rule | None = None
    pressure: Callable[[], SkfemElement] | None = None

    def __post_init__(self) -> None:
        if (self.volume == BBAR) != (self.volume_rule is not None):
            remedy = "set it together with volume='mean' and in no other case"
            raise CaseError(f"element {self.name}", "volume_rule and volume disagree", remedy)
        if (self.volume == MIXED) != (self.pressure is not None):
            remedy = "set it together with volume='pressure' and in no other case"
            raise CaseError(f"element {self.name}", "pressure and volume disagree", remedy)

    @property
    def definite(self) -> bool:
        """Whether the matrices are positive definite; for mixed elements they are indefinite."""
        return self.volume != MIXED

    @property
    def nodes(self) -> Floats:
        """Positions of the nodes in the reference cell, shape (n, dim)."""
        places: Floats = self.skfem_element().doflocs
        return places


# Displacement of the MINI element (D. N. Arnold, F. Brezzi, M. Fortin 1984) with a nodal basis.


class TriangleBubble(ElementH1):  # type: ignore[misc]  # scikit-fem ships no types
    """Linear triangle with a cubic bubble and a nodal basis.

    In scikit-fem's own element the bubble is added to the linear functions, so that the value at
    the centre is no degree of freedom. Here every function is zero at the nodes of the others.
    """

    nodal_dofs = 1
    interior_dofs = 1
    maxdeg = 3
    dofnames = ("u", "u")
    doflocs = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0 / 3.0, 1.0 / 3.0]])
    refdom = RefTri

    def lbasis(self, X: Floats, i: int) -> tuple[Floats, Floats]:  # noqa: N803  (scikit-fem's name)
        """Return shape function `i` and its gradient at reference points."""
        x, y = X
        bubble = 27.0 * x * y * (1.0 - x - y)
        slope = 27.0 * np.stack([y * (1.0 - 2.0 * x - y), x * (1.0 - x - 2.0 * y)])
        if i == 3:
            return bubble, slope
        linear = (1.0 - x - y, x, y)[i]
        gradient = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]][i])
        shape = (2, *[1] * x.ndim)
        return linear - bubble / 3.0, gradient.reshape(shape) - slope / 3.0


# The catalogue: one entry per element.


_ROWS = (
    ElementType(
        name="P1", cell="triangle", skfem_element=skfem.ElementTriP1, degree=1,
        stiffness_rule=simplex(1), mass_rule=simplex(2), lumpings=("row-sum", "hrz"),
        poissons_ratio_limit=0.45,
    ),
    ElementType(
        name="P2", cell="triangle", skfem_element=skfem.ElementTriP2, degree=2,
        stiffness_rule=simplex(2), mass_rule=simplex(4), lumpings=("hrz",),
        poissons_ratio_limit=0.49,
    ),
    ElementType(
        name="Q1", cell="quadrilateral", skfem_element=skfem.ElementQuad1, degree=1,
        stiffness_rule=gauss(2), mass_rule=gauss(2), lumpings=("row-sum", "hrz"),
        poissons_ratio_limit=0.45,
    ),
    ElementType(
        name="Q2", cell="quadrilateral", skfem_element=skfem.ElementQuad2, degree=2,
        stiffness_rule=gauss(3), mass_rule=gauss(3), lumpings=("row-sum", "hrz"),
        poissons_ratio_limit=0.49,
    ),
    ElementType(
        name="Q1-Bbar", cell="quadrilateral", skfem_element=skfem.ElementQuad1, degree=1,
        stiffness_rule=gauss(2), mass_rule=gauss(2), lumpings=("row-sum", "hrz"),
        poissons_ratio_limit=0.49999, stress_limit=0.49999, volume=BBAR, volume_rule=gauss(1),
    ),
    ElementType(
        name="MINI", cell="triangle", skfem_element=TriangleBubble, degree=1,
        stiffness_rule=simplex(4), mass_rule=simplex(6), lumpings=("row-sum", "hrz"),
        poissons_ratio_limit=0.5, stress_limit=0.5, volume=MIXED, pressure=skfem.ElementTriP1,
    ),
    ElementType(
        name="P2-P1", cell="triangle", skfem_element=skfem.ElementTriP2, degree=2,
        stiffness_rule=simplex(2), mass_rule=simplex(4), lumpings=("hrz",),
        poissons_ratio_limit=0.5, stress_limit=0.5, volume=MIXED, pressure=skfem.ElementTriP1,
    ),
    ElementType(
        name="Q2-Q1", cell="quadrilateral", skfem_element=skfem.ElementQuad2, degree=2,
        stiffness_rule=gauss(3), mass_rule=gauss(3), lumpings=("row-sum", "hrz"),
        poissons_ratio_limit=0.5, stress_limit=0.5, volume=MIXED, pressure=skfem.ElementQuad1,
    ),
)  # fmt: skip

CATALOGUE: dict[str, ElementType] = {row.name: row for row in _ROWS}
"""The elements that a case can name, by their names."""


def element_row(name: str, key: str = "discretization.element") -> ElementType:
    """Return an element of the catalogue, or an element of the user (``module:Name``).

    Raises
    ------
    CaseError
        The element does not exist (the most similar name is given), or is no `ElementType`.
    """
    if not _plugin.is_foreign(name):
        known = matching(name, CATALOGUE)
        if known is None:
            raise CaseError(key, f"no element {short(name)}", nearest(name, CATALOGUE))
        return CATALOGUE[known]
    found = _plugin.load(name, key)
    if not isinstance(found, ElementType):
        raise CaseError(key, f"'{name}' is not an ElementType", "see docs/how-to/own-element.md")
    return found
