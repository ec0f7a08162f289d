"""D2: average acceleration keeps the energy of a free tissue."""

from needlefem.checks.energy import energy_drift
from needlefem.checks.modal import eigenfrequencies
from needlefem.checks.models import rectangle
from needlefem.checks.problem import Answer, Findings, Problem
from needlefem.elements import CATALOGUE
from needlefem.materials import Isotropic

STEPS = 100_000


def run(quick: bool) -> Findings:
    """Let a held square vibrate for 1e5 steps of a twentieth of its longest period."""
    answers = []
    for name in ("P1", "P2") if quick else CATALOGUE:
        element = CATALOGUE[name]
        material = Isotropic(youngs_modulus=1.0, poissons_ratio=0.3, density=1.0)
        model = rectangle(element, material, 4)
        period = 6.283185307179586 / eigenfrequencies(model, 1)[0]
        drift = energy_drift(model, period / 20.0, STEPS)
        label = f"{name}: largest drift over {STEPS} steps"
        answers.append(Answer(label=label, value=drift, tolerance=1e-9, recorded=False))
    return Findings(answers=answers)


PROBLEM = Problem(
    name="energy of free vibration",
    requirement="Average acceleration without damping neither gains nor loses energy.",
    reference="exact; T. Belytschko, D. F. Schoeberle 1975",
    why="round-off of 1e5 steps",
    run=run,
)
