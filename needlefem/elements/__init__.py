"""Finite elements: the catalogue of types, their shape functions and quadrature rules.

An element type is one row of the catalogue; a case names it. scikit-fem is imported in this
folder, in `needlefem.mesh` and in `needlefem.fem` only.
"""

from typing import TYPE_CHECKING

from needlefem._exports import lazy_exports

if TYPE_CHECKING:
    from needlefem.elements.catalogue import (
        BBAR,
        CATALOGUE,
        DISPLACEMENT,
        MIXED,
        ElementType,
        element_row,
    )
    from needlefem.elements.shape_functions import (
        Rule,
        ShapeTable,
        gauss,
        gauss_legendre,
        shape_table,
        simplex,
    )

__all__ = [
    "BBAR",
    "CATALOGUE",
    "DISPLACEMENT",
    "MIXED",
    "ElementType",
    "Rule",
    "ShapeTable",
    "element_row",
    "gauss",
    "gauss_legendre",
    "shape_table",
    "simplex",
]

if not TYPE_CHECKING:
    __getattr__, __dir__ = lazy_exports(
        __name__,
        catalogue="BBAR CATALOGUE DISPLACEMENT ElementType MIXED element_row",
        shape_functions="Rule ShapeTable gauss gauss_legendre shape_table simplex",
    )
