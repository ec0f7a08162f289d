"""M2: frequencies of a box whose sides slide without friction."""

import numpy as np

from needlefem.checks.modal import eigenfrequencies
from needlefem.checks.models import rectangle
from needlefem.checks.problem import Answer, Findings, Problem
from needlefem.elements import CATALOGUE
from needlefem.materials import Isotropic
from needlefem.scene import Support

RATIO = 0.3
MODES = ("S11", "P10", "S21", "P01", "S12", "S31")
"""Shear or pressure wave, half waves along and across, by rising frequency."""
TOLERANCE = {1: 2.5e-2, 2: 2.5e-4}


def exact(mode: str) -> float:
    """Return the angular frequency ``c k`` of a mode in the box of 1.5 x 1 with mu = rho = 1."""
    speed = {"S": 1.0, "P": np.sqrt(2.0 * (1.0 - RATIO) / (1.0 - 2.0 * RATIO))}[mode[0]]
    return float(speed * np.pi * np.hypot(int(mode[1]) / 1.5, int(mode[2])))


def run(quick: bool) -> Findings:
    """Compare the six lowest frequencies on 16 x 16 squares."""
    answers = []
    for name, element in CATALOGUE.items():
        material = Isotropic(youngs_modulus=2.0 * (1.0 + RATIO), poissons_ratio=RATIO, density=1.0)
        supports = {
            "across": Support(faces=("y_min", "y_max"), fixed=("y",)),
            "along": Support(faces=("z_min", "z_max"), fixed=("z",)),
        }
        model = rectangle(element, material, 16, (1.5, 1.0), supports)
        found = eigenfrequencies(model, len(MODES))
        for mode, value in zip(MODES, found, strict=True):
            answers.append(
                Answer(
                    label=f"{name}: {mode}",
                    value=value,
                    reference=exact(mode),
                    tolerance=TOLERANCE[element.degree],
                )
            )
        lowest = min(np.asarray(found) / np.array([exact(mode) for mode in MODES]))
        below = max(0.0, 1.0 - float(lowest))
        answers.append(
            Answer(label=f"{name}: below exact", value=below, tolerance=1e-12, recorded=False)
        )
    return Findings(answers=answers)


PROBLEM = Problem(
    name="sliding box",
    requirement="Waves in a box have the right frequencies, approached from above.",
    reference="exact; plane waves fulfil u.n = 0 and zero shear traction on the sides",
    why="errors of order h^2 (P1) and h^4 (P2) at 16 x 16 squares; consistent mass is never below",
    run=run,
)
