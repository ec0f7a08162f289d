"""Elements; scikit-fem is met here and in `fem` only."""

from needlefem.elements.catalogue import CATALOGUE, element_row
from needlefem.elements.element_type import BBAR, DISPLACEMENT, MIXED, ElementType

__all__ = ["BBAR", "CATALOGUE", "DISPLACEMENT", "MIXED", "ElementType", "element_row"]
