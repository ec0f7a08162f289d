"""Period and amplitude errors of the integrators."""

import numpy as np

from needlefem.checks import Problem, ProblemResult, Quantity, order, period_error, principal
from needlefem.dynamics import HHT, CentralDifference, GeneralizedAlpha, Newmark
from verification.support.generalized_alpha_theory import period

STEPS = (0.01, 0.02, 0.05, 0.1, 0.2)
"""Time step over period."""
SECOND_ORDER = {
    "Newmark": Newmark(),
    "HHT -0.1": HHT(alpha=-0.1),
    "generalised-alpha 0.8": GeneralizedAlpha(rho_inf=0.8),
    "central difference": CentralDifference(),
}


FAMILY = {
    "Newmark 0.3025, 0.6": (Newmark(beta=0.3025, gamma=0.6), (0.0, 0.0, 0.3025, 0.6)),
    "HHT -0.1": (HHT(alpha=-0.1), (0.0, 0.1, 0.3025, 0.6)),
    "HHT -0.3": (HHT(alpha=-0.3), (0.0, 0.3, 0.4225, 0.8)),
    "generalised-alpha 0.8": (GeneralizedAlpha(rho_inf=0.8), (1 / 3, 4 / 9, 25 / 81, 11 / 18)),
    "generalised-alpha 0.5": (GeneralizedAlpha(rho_inf=0.5), (0.0, 1 / 3, 4 / 9, 5 / 6)),
}
"""alpha_m, alpha_f, beta, gamma as published by the authors of each method."""


def periods() -> list[Quantity]:
    """Compare the periods of the alpha family with the roots of its characteristic polynomial."""
    return [
        Quantity(label=f"{name}, dt/T {share}: period",
               value=1.0 + period_error(integrator, 2.0 * np.pi * share),
               reference=period(*weights, step=2.0 * np.pi * share), tolerance=1e-8)
        for name, (integrator, weights) in FAMILY.items() for share in STEPS
    ]  # fmt: skip


def run(quick: bool) -> ProblemResult:
    """Compare periods with formulas, and compute orders of convergence."""
    answers = periods()
    formulas = {"Newmark": np.arctan, "central difference": np.arcsin}
    for name, inverse in formulas.items():
        for share in STEPS:
            step = 2.0 * np.pi * share
            exact = 0.5 * step / float(inverse(0.5 * step)) - 1.0
            found = period_error(SECOND_ORDER[name], step)
            answers.append(
                Quantity(label=f"{name}, dt/T {share}: period", value=1.0 + found,
                       reference=1.0 + exact, tolerance=1e-8)
            )  # fmt: skip
            kept = abs(abs(principal(SECOND_ORDER[name], step)) - 1.0)
            answers.append(
                Quantity(label=f"{name}, dt/T {share}: amplitude lost", value=kept, tolerance=1e-13,
                       recorded=False)
            )  # fmt: skip
    for name, integrator in SECOND_ORDER.items():
        for pushed in (False, True):
            label = f"{name}: order, {'pushed' if pushed else 'free'}"
            found = order(integrator, pushed=pushed)
            answers.append(
                Quantity(label=label, value=found, reference=2.0, tolerance=0.025, recorded=False)
            )
    return ProblemResult(quantities=answers)


PROBLEM = Problem(
    name="period",
    requirement="A free vibration has the period of the integrator's formula; errors decrease with "
    "the square of the step.",
    reference="exact: (O/2) / atan(O/2) for average acceleration, (O/2) / asin(O/2) for central "
    "differences, O = w dt; T. J. R. Hughes 2000; others by the roots of their characteristic "
    "polynomial",
    tolerance_rationale="round-off; orders within 0.05",
    run=run,
)
