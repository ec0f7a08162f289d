"""Rayleigh damping from two frequencies, and its change by the integrator."""

import numpy as np

from needlefem.checks import Problem, ProblemResult, Quantity, principal, rectangle
from needlefem.dynamics import Damping, Newmark, TissueSystem, iterate, modes, record
from needlefem.elements import CATALOGUE
from needlefem.materials import Isotropic

RATIO = 0.05


def discrete_ratio(share: float) -> float:
    """Return the damping ratio of average acceleration at a step of a share of the period.

    The period is that of the undamped motion.
    """
    value = principal(Newmark(), 2.0 * np.pi * share, RATIO)
    decay, turn = -np.log(abs(value)), abs(np.angle(value))
    return float(decay / np.hypot(decay, turn))


def ratio_of(trace: float, determinant: float) -> float:
    """Return the damping ratio of a motion ``x[n+1] = trace x[n] - determinant x[n-1]``."""
    decay = -0.5 * np.log(determinant)
    turn = np.arccos(0.5 * trace / np.sqrt(determinant))
    return float(decay / np.hypot(decay, turn))


def exact_ratio(step: float, ratio: float) -> float:
    """Return the damping ratio of average acceleration in closed form; `step` is ``w dt``."""
    size = 1.0 + ratio * step + 0.25 * step**2
    return ratio_of(2.0 * (1.0 - 0.25 * step**2) / size, (size - 2.0 * ratio * step) / size)


def of_tissue() -> list[Quantity]:
    """Compute the vibration of modes of a damped tissue one by one."""
    law = Isotropic(youngs_modulus=1.0, poissons_ratio=0.3, density=1.0)
    model = rectangle(CATALOGUE["P2"], law, 4)
    found, shapes = modes(TissueSystem(model), 3)
    hertz = found / (2.0 * np.pi)
    damping = Damping.from_ratios((float(hertz[0]), float(hertz[2])), (RATIO, RATIO))
    system = TissueSystem(model, damping)
    step = 0.3 / found[2]
    stepper = Newmark().stepper(system, step)
    answers = []
    for number, (omega, shape) in enumerate(zip(found, shapes.T, strict=True), 1):
        weights = system.mass_times(shape)
        motions = iterate(stepper, stepper.start(shape, 0.0 * shape), None, 13)
        a, b, c, d = record(motions, lambda m, w=weights: np.array([w @ m.u]))[-4:, 0]
        trace, determinant = np.linalg.solve([[b, -a], [c, -b]], [c, d])
        exact = exact_ratio(float(omega * step), damping.ratio(float(omega / (2.0 * np.pi))))
        value = ratio_of(float(trace), float(determinant))
        label = f"tissue, mode {number}: ratio"
        answers.append(Quantity(label=label, value=value, reference=exact, tolerance=1e-8))
    return answers


def run(quick: bool) -> ProblemResult:
    """Compare constants, damping ratios between the frequencies, and the average acceleration."""
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
        Quantity(label=label, value=float(value), reference=reference, tolerance=1e-6)
        for label, (value, reference) in values.items()
    ]
    answers += of_tissue()
    for share, reference in ((0.01, 0.04996721), (0.05, 0.04919665)):
        answers.append(
            Quantity(
                label=f"average acceleration, dt/T {share}: ratio",
                value=discrete_ratio(share),
                reference=reference,
                tolerance=2e-7,
            )
        )
        answers.append(
            Quantity(label=f"average acceleration, dt/T {share}: formula",
                   value=discrete_ratio(share), reference=exact_ratio(2.0 * np.pi * share, RATIO),
                   tolerance=1e-10)
        )  # fmt: skip
    return ProblemResult(quantities=answers)


PROBLEM = Problem(
    name="Rayleigh damping",
    requirement="The damping ratios at two frequencies are the prescribed ones; the integrator "
    "changes them by its formula.",
    reference="exact; Lord Rayleigh 1877",
    tolerance_rationale="the last digit given; round-off for the closed form of average "
    "acceleration",
    run=run,
)
