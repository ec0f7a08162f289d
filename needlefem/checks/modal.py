"""Eigenfrequencies of a tissue."""

import numpy as np

from needlefem._arrays import Floats
from needlefem.checks.models import rectangle
from needlefem.dynamics import TissueSystem
from needlefem.dynamics.modal import modes
from needlefem.elements import ElementType
from needlefem.fem.tissue_model import TissueModel
from needlefem.materials import Material
from needlefem.scene import Support


def eigenfrequencies(model: TissueModel, count: int) -> Floats:
    """Return the lowest angular frequencies of the supported tissue, shape (count,), 1/s."""
    return modes(TissueSystem(model), count)[0]


BOX = (1.5, 1.0)
"""Sides of the sliding box: no two of its lowest frequencies are alike."""


def sliding_box(
    element: ElementType, material: Material, divisions: int, plane: str = "strain"
) -> TissueModel:
    """Return a box whose sides slide without friction."""
    supports = {
        "across": Support(faces=("y_min", "y_max"), fixed=("y",)),
        "along": Support(faces=("z_min", "z_max"), fixed=("z",)),
    }
    return rectangle(element, material, divisions, BOX, supports, plane=plane)


def box_frequencies(stiffness: Floats, density: float, count: int) -> tuple[Floats, Floats]:
    """Return the lowest angular frequencies of the sliding box, 1/s, and wave numbers, 1/m.

    ``(A sin kx x cos ky y, B cos kx x sin ky y)`` fulfils all conditions when shear and normal
    strains don't mix: two waves for every pair of wave numbers (E. B. Christoffel 1877).
    """
    waves: list[tuple[float, float]] = []
    for i, j in np.ndindex(count + 1, count + 1):
        k, m = np.pi * i / BOX[0], np.pi * j / BOX[1]
        mixed = (stiffness[0, 1] + stiffness[2, 2]) * k * m
        first = stiffness[0, 0] * k**2 + stiffness[2, 2] * m**2
        second = stiffness[1, 1] * m**2 + stiffness[2, 2] * k**2
        if i and j:
            both = np.linalg.eigvalsh([[first, mixed], [mixed, second]])
            waves += [(float(square), float(np.hypot(k, m))) for square in both]
        elif i or j:  # a pressure wave along an axis; its shear twin does not fulfil the sides
            waves.append((float(first if i else second), float(np.hypot(k, m))))
    lowest = np.array(sorted(waves)[:count])
    return np.sqrt(lowest[:, 0] / density), lowest[:, 1]
