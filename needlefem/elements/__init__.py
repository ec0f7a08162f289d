"""Elements; scikit-fem is met here and in `fem` only."""

from needlefem.elements.catalogue import CATALOGUE, element_row
from needlefem.elements.element_type import MEAN, PLAIN, PRESSURE, ElementRow

__all__ = ["CATALOGUE", "MEAN", "PLAIN", "PRESSURE", "ElementRow", "element_row"]
