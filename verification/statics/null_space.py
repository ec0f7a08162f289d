"""The null space of an unsupported tissue consists of three rigid motions."""

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
    """Count the zero eigenvalues of K, and compute the force due to rigid motions."""
    answers = []
    for name, element in CATALOGUE.items():
        material = Isotropic(youngs_modulus=1.0, poissons_ratio=0.3)
        model = rectangle(element, material, 4)  # K without supports
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
    # on a regular mesh there is one more zero mode
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
    requirement="Two translations and one rotation cause no force; all other motions do.",
    reference="exact; linear elasticity is invariant under infinitesimal rigid motions",
    tolerance_rationale="the number is exact; forces are round-off",
    run=run,
)
