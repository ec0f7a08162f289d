"""The average acceleration conserves the energy of a free vibration."""

from needlefem.checks import (
    Problem,
    ProblemResult,
    Quantity,
    eigenfrequencies,
    energy_drift,
    rectangle,
)
from needlefem.elements import CATALOGUE
from needlefem.materials import Isotropic

STEPS = 100_000
QUICK_STEPS = 10_000
STRESSES = (("P2", 0.4999, 0.05), ("P2-P1", 0.4999, 0.05), ("P2", 0.3, 5.0))
"""Element, Poisson's ratio, step over the longest period: the combinations with most round-off."""


def drift(
    name: str, ratio: float, share: float, lumping: str | None = None, steps: int = STEPS
) -> Quantity:
    """Return the drift of energy of a supported square in many steps of a share of its period."""
    law = Isotropic(youngs_modulus=1.0, poissons_ratio=ratio, density=1.0)
    model = rectangle(CATALOGUE[name], law, 4)
    period = 6.283185307179586 / eigenfrequencies(model, 1)[0]
    found = energy_drift(model, share * period, steps, lumping)
    about = "" if (ratio, share) == (0.3, 0.05) else f", nu {ratio}, step {share:g} T"
    mass = f", {lumping} mass" if lumping else ""
    label = f"{name}{mass}{about}: largest drift over {steps} steps"
    return Quantity(label=label, value=found, tolerance=1e-9, recorded=False)


def run(quick: bool) -> ProblemResult:
    """Run free vibrations of each element with consistent and lumped mass, then under stress."""
    answers = [drift(name, 0.3, 0.05, steps=QUICK_STEPS) for name in ("P1", "P2")]
    if quick:
        return ProblemResult(quantities=answers)
    answers += [drift(name, 0.3, 0.05) for name in CATALOGUE]
    answers += [drift(name, 0.3, 0.05, row.lumpings[0]) for name, row in CATALOGUE.items()]
    return ProblemResult(quantities=answers + [drift(*stress) for stress in STRESSES])


PROBLEM = Problem(
    name="energy of free vibration",
    requirement="Average acceleration without damping neither gains nor loses energy.",
    reference="exact; T. Belytschko, D. F. Schoeberle 1975",
    tolerance_rationale="round-off of 1e5 steps",
    run=run,
)
