"""Patch test: a constant strain is reproduced exactly on any mesh."""

from needlefem.checks import (
    Problem,
    ProblemResult,
    Quantity,
    distorted_mesh,
    patch_error,
    traction_patch_error,
)
from needlefem.elements import CATALOGUE
from needlefem.materials import Isotropic

PULLED = 100.0
"""Factor on the round-off of a patch with only three fixed displacements."""


def run(quick: bool) -> ProblemResult:
    """Prescribe a linear field or constant tractions on the boundary; measure the error."""
    answers = []
    for name, element in CATALOGUE.items():
        for ratio, bound in ((0.3, 1e-12), (0.4999, 1e-11)):
            material = Isotropic(youngs_modulus=1.0, poissons_ratio=ratio)
            worst = patch_error(distorted_mesh(element, 4), element, material)
            label = f"{name}, nu {ratio}: largest error"
            answers.append(Quantity(label=label, value=worst, tolerance=bound, recorded=False))
            pulled = traction_patch_error(distorted_mesh(element, 4), element, material)
            label = f"{name}, nu {ratio}: largest error, by tractions"
            answers.append(
                Quantity(label=label, value=pulled, tolerance=PULLED * bound, recorded=False)
            )
    return ProblemResult(quantities=answers)


PROBLEM = Problem(
    name="patch",
    requirement="A linear displacement on the boundary gives the same linear displacement inside.",
    reference="exact; B. M. Irons, A. Razzaque 1972",
    tolerance_rationale="round-off times the condition of the system, which grows as nu nears 1/2",
    run=run,
)
