"""The element catalogue: one row an element, chosen by name."""

import skfem

from needlefem import _plugin
from needlefem.elements.element_type import BBAR, MIXED, ElementType
from needlefem.elements.mini import TriangleBubble
from needlefem.elements.quadrature import gauss, simplex
from needlefem.errors import CaseError, matching, nearest, short

_ROWS = (
    ElementType(
        name="P1", cell="triangle", make=skfem.ElementTriP1, degree=1,
        stiffness_rule=simplex(1), mass_rule=simplex(2), lumpings=("row-sum", "hrz"),
        poissons_ratio_limit=0.45,
    ),
    ElementType(
        name="P2", cell="triangle", make=skfem.ElementTriP2, degree=2,
        stiffness_rule=simplex(2), mass_rule=simplex(4), lumpings=("hrz",),
        poissons_ratio_limit=0.49,
    ),
    ElementType(
        name="Q1", cell="quadrilateral", make=skfem.ElementQuad1, degree=1,
        stiffness_rule=gauss(2), mass_rule=gauss(2), lumpings=("row-sum", "hrz"),
        poissons_ratio_limit=0.45,
    ),
    ElementType(
        name="Q2", cell="quadrilateral", make=skfem.ElementQuad2, degree=2,
        stiffness_rule=gauss(3), mass_rule=gauss(3), lumpings=("row-sum", "hrz"),
        poissons_ratio_limit=0.49,
    ),
    ElementType(
        name="Q1-Bbar", cell="quadrilateral", make=skfem.ElementQuad1, degree=1,
        stiffness_rule=gauss(2), mass_rule=gauss(2), lumpings=("row-sum", "hrz"),
        poissons_ratio_limit=0.49999, stress_limit=0.49999, volume=BBAR, volume_rule=gauss(1),
    ),
    ElementType(
        name="MINI", cell="triangle", make=TriangleBubble, degree=1,
        stiffness_rule=simplex(4), mass_rule=simplex(6), lumpings=("row-sum", "hrz"),
        poissons_ratio_limit=0.5, stress_limit=0.5, volume=MIXED, pressure=skfem.ElementTriP1,
    ),
    ElementType(
        name="P2-P1", cell="triangle", make=skfem.ElementTriP2, degree=2,
        stiffness_rule=simplex(2), mass_rule=simplex(4), lumpings=("hrz",),
        poissons_ratio_limit=0.5, stress_limit=0.5, volume=MIXED, pressure=skfem.ElementTriP1,
    ),
    ElementType(
        name="Q2-Q1", cell="quadrilateral", make=skfem.ElementQuad2, degree=2,
        stiffness_rule=gauss(3), mass_rule=gauss(3), lumpings=("row-sum", "hrz"),
        poissons_ratio_limit=0.5, stress_limit=0.5, volume=MIXED, pressure=skfem.ElementQuad1,
    ),
)  # fmt: skip

CATALOGUE: dict[str, ElementType] = {row.name: row for row in _ROWS}


def element_row(name: str, key: str = "discretisation.element") -> ElementType:
    """Return an element's row: of the catalogue, or of the user's (``module:Name``).

    Raises
    ------
    CaseError
        There is none of that name (the nearest is named), or it is no `ElementType`.
    """
    if not _plugin.is_foreign(name):
        known = matching(name, CATALOGUE)
        if known is None:
            raise CaseError(key, f"no element {short(name)}", nearest(name, CATALOGUE))
        return CATALOGUE[known]
    found = _plugin.load(name, key)
    if not isinstance(found, ElementType):
        raise CaseError(key, f"'{name}' is no ElementType", "see docs/how-to/own-element.md")
    return found
