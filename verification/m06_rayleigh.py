"""M6: Rayleigh damping from two frequencies, and what the integrator makes of it."""

import numpy as np

from needlefem.checks.integration import principal
from needlefem.checks.problem import Answer, Findings, Problem
from needlefem.dynamics import Damping, Newmark

RATIO = 0.05


def discrete_ratio(share: float) -> float:
    """Return the damping ratio of average acceleration at a step of a share of the period.

    The period is that of the undamped motion.
    """
    value = principal(Newmark(), 2.0 * np.pi * share, RATIO)
    decay, turn = -np.log(abs(value)), abs(np.angle(value))
    return float(decay / np.hypot(decay, turn))


def run(quick: bool) -> Findings:
    """Compare constants, ratios in between, and the damping of average acceleration."""
    damping = Damping.from_ratios((2.0, 10.0), (RATIO, RATIO))
    lowest = np.sqrt(2.0 * 10.0)
    values = {
        "mass rate": (damping.mass_rate, 1.0471975512),
        "stiffness time": (damping.stiffness_time, 0.001326291192),
        "ratio at 5 Hz": (damping.ratio(5.0), 0.0375),
        "least ratio": (damping.ratio(lowest), 0.0372678),
        "log decrement": (2.0 * np.pi * RATIO / np.sqrt(1.0 - RATIO**2), 0.3145527),
    }
    answers = [
        Answer(label=label, value=float(value), reference=reference, tolerance=1e-6)
        for label, (value, reference) in values.items()
    ]
    for share, reference in ((0.01, 0.04996721), (0.05, 0.04919665)):
        answers.append(
            Answer(label=f"average acceleration, dt/T {share}: ratio", value=discrete_ratio(share),
                   reference=reference, tolerance=2e-7)
        )  # fmt: skip
    return Findings(answers=answers)


PROBLEM = Problem(
    name="Rayleigh damping",
    requirement="Damping has the ratios asked for at two frequencies; the integrator changes them "
    "by its formula.",
    reference="exact; Lord Rayleigh 1877",
    why="the last digit given",
    run=run,
)
