"""The MINI element's displacement (D. N. Arnold, F. Brezzi, M. Fortin 1984), nodal."""

from typing import Any

import numpy as np
from skfem.element.element_h1 import ElementH1
from skfem.refdom import RefTri

from needlefem._arrays import Floats


class TriangleBubble(ElementH1):  # type: ignore[misc]  # scikit-fem ships no types
    """Linear triangle with a cubic bubble.

    scikit-fem's own has the bubble on top of the linear functions, so that a field's value in
    the middle is no degree of freedom. Here it is: every function vanishes at the others' nodes.
    """

    nodal_dofs = 1
    interior_dofs = 1
    maxdeg = 3
    dofnames = ("u", "u")
    doflocs = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0 / 3.0, 1.0 / 3.0]])
    refdom = RefTri

    def lbasis(self, X: Any, i: int) -> tuple[Floats, Floats]:  # noqa: N803  (scikit-fem's name)
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
