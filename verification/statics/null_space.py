"""S3: an unsupported tissue has exactly three motions that cost nothing."""

import dataclasses

import numpy as np

from needlefem.checks import (
    Problem,
    ProblemResult,
    Quantity,
    distorted_mesh,
    rectangle,
    rigid_motion,
    spectrum,
    zero_modes,
)
from needlefem.elements import CATALOGUE, gauss
from needlefem.fem import BoundaryValueProblem
from needlefem.materials import Isotropic


def run(quick: bool) -> ProblemResult:
    """Count zero eigenvalues of K, and measure the force that rigid motions cost."""
    answers = []
    for name, element in CATALOGUE.items():
        material = Isotropic(youngs_modulus=1.0, poissons_ratio=0.3)
        model = rectangle(element, material, 4)  # K itself knows of no supports
        modes = Quantity(
            label=f"{name}: zero modes", value=zero_modes(model), reference=3.0, tolerance=0.0
        )
        force = Quantity(
            label=f"{name}: force of rigid motions",
            value=rigid_motion(model).value,
            tolerance=1e-12,
            recorded=False,
        )
        gap = Quantity(
            label=f"{name}: smallest other eigenvalue",
            value=float(spectrum(model.stiffness)[3]),
            reference=1e-3,
            at_least=True,
        )
        answers += [modes, gap, force]
    # on a regular mesh one more motion is blind
    blind = dataclasses.replace(CATALOGUE["Q1"], name="X", stiffness_rule=gauss(1))
    law = Isotropic(youngs_modulus=1.0, poissons_ratio=0.3)
    values = spectrum(BoundaryValueProblem(distorted_mesh(blind, 4), blind, law).stiffness)
    answers.append(
        Quantity(label="Q1 with one point: zero modes, two of them hourglasses",
               value=int(np.sum(np.abs(values) < 1e-12)), reference=5.0)
    )  # fmt: skip
    return ProblemResult(quantities=answers)


PROBLEM = Problem(
    name="null space",
    requirement="Two translations and one rotation cost no force, and nothing else.",
    reference="exact; linear elasticity is indifferent to infinitesimal rigid motions",
    tolerance_rationale="a count is exact; forces are round-off",
    run=run,
)
