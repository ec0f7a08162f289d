"""Elements; scikit-fem is met here and in `fem` only."""

from needlefem.elements.catalogue import (
    BBAR,
    CATALOGUE,
    DISPLACEMENT,
    MIXED,
    ElementType,
    element_row,
)

__all__ = ["BBAR", "CATALOGUE", "DISPLACEMENT", "MIXED", "ElementType", "element_row"]
