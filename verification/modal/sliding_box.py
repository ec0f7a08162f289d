"""Frequencies of a box whose sides slide without friction."""

import numpy as np

from needlefem.checks import Problem, ProblemResult, Quantity, sliding_box
from needlefem.dynamics import TissueSystem, modes
from needlefem.elements import CATALOGUE
from needlefem.materials import Isotropic

RATIO = 0.3
MODES = ("S11", "P10", "S21", "P01", "S12", "S31")
"""Shear or pressure wave, half waves along and across, by rising frequency."""
TOLERANCE = {1: 2.5e-2, 2: 2.5e-4}
LUMPED_TRIANGLE = 1e-3
"""Lumping keeps the order of quadrilaterals of degree 2, whose nodes are those of a sufficiently
exact rule; the order of triangles decreases to 2."""


def exact(mode: str) -> float:
    """Return the angular frequency ``c k`` of a mode in the box of 1.5 x 1 with mu = rho = 1."""
    speed = {"S": 1.0, "P": np.sqrt(2.0 * (1.0 - RATIO) / (1.0 - 2.0 * RATIO))}[mode[0]]
    return float(speed * np.pi * np.hypot(int(mode[1]) / 1.5, int(mode[2])))


def run(quick: bool) -> ProblemResult:
    """Compare the six lowest frequencies on 16 x 16 squares for each admissible mass matrix."""
    law = Isotropic(youngs_modulus=2.0 * (1.0 + RATIO), poissons_ratio=RATIO, density=1.0)
    answers = []
    for name, element in CATALOGUE.items():
        model = sliding_box(element, law, 16)
        for lumping in (None, *element.lumpings):
            if lumping and quick:
                continue
            found, _ = modes(TissueSystem(model, lumping=lumping), len(MODES))
            curved = lumping and element.degree == 2 and element.cell == "triangle"
            bound = LUMPED_TRIANGLE if curved else TOLERANCE[element.degree]
            label = f"{name}, {lumping}" if lumping else name
            answers += [
                Quantity(label=f"{label}: {mode}", value=float(value), reference=exact(mode),
                       tolerance=bound)
                for mode, value in zip(MODES, found, strict=True)
            ]  # fmt: skip
            if lumping is None:
                lowest = float(min(found / np.array([exact(mode) for mode in MODES])))
                answers.append(Quantity(label=f"{name}: below exact", value=max(0.0, 1.0 - lowest),
                                      tolerance=1e-12, recorded=False))  # fmt: skip
    return ProblemResult(quantities=answers)


PROBLEM = Problem(
    name="sliding box",
    requirement="The frequencies of waves in a box are correct, and are approached from above.",
    reference="exact; plane waves satisfy u.n = 0 and zero shear traction on the sides",
    tolerance_rationale="errors of order h^2 (P1) and h^4 (P2) at 16 x 16 squares; with consistent "
    "mass a frequency is never too low",
    run=run,
)
