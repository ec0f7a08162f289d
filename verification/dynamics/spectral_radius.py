"""Numerical damping of frequencies that the step does not resolve."""

from needlefem.checks import Problem, ProblemResult, Quantity, spectral_radius
from needlefem.dynamics import HHT, GeneralizedAlpha, Integrator, Newmark
from verification.support import generalized_alpha_theory as family

HHT_RADII = {
    -0.05: (0.996490, 0.913168), -0.1: (0.993847, 0.837803), -0.3: (0.989384, 0.684611),
    -1.0 / 3.0: (0.989313, 0.682528),
}  # fmt: skip
ALPHA_RADII = {
    0.9: (0.999942, 0.983763), 0.8: (0.999475, 0.929792), 0.5: (0.989313, 0.682528),
    0.0: (0.906563, 0.242536),
}  # fmt: skip
"""Spectral radius at w dt = 1 and 10 by alpha, and by rho_inf."""
FAR = 1e6
STEPS = (0.1, 1.0, 3.0, 10.0, 100.0)
"""Products w dt for the comparison with the formula."""
FAMILY: dict[str, tuple[Integrator, tuple[float, ...]]] = {
    "Newmark": (Newmark(), (0.0, 0.0, 0.25, 0.5)),
    "Newmark 0.5, 0.5": (Newmark(beta=0.5), (0.0, 0.0, 0.5, 0.5)),
    "Newmark 0.3025, 0.6": (Newmark(beta=0.3025, gamma=0.6), (0.0, 0.0, 0.3025, 0.6)),
    "HHT -0.05": (HHT(alpha=-0.05), (0.0, 0.05, 0.275625, 0.55)),
    "HHT -0.3": (HHT(alpha=-0.3), (0.0, 0.3, 0.4225, 0.8)),
    "generalised-alpha 0.8": (GeneralizedAlpha(rho_inf=0.8), (1 / 3, 4 / 9, 25 / 81, 11 / 18)),
    "generalised-alpha 0": (GeneralizedAlpha(rho_inf=0.0), (-1.0, 0.0, 1.0, 1.5)),
}
"""alpha_m, alpha_f, beta, gamma as published by the authors of each method."""


def run(quick: bool) -> ProblemResult:
    """Compare radii at moderate steps with tables, and at a large step with the design value."""
    answers = []
    for alpha, radii in HHT_RADII.items():
        integrator = HHT(alpha=alpha)
        limit = (1.0 + alpha) / (1.0 - alpha)
        answers += _compare(f"HHT {alpha:.4g}", integrator, radii, limit)
    for rho, radii in ALPHA_RADII.items():
        answers += _compare(f"generalised-alpha {rho}", GeneralizedAlpha(rho_inf=rho), radii, rho)
    answers += [
        Quantity(label=f"{name}: formula at w dt {step:g}", value=spectral_radius(integrator, step),
               reference=family.radius(*weights, step=step), tolerance=1e-8)
        for name, (integrator, weights) in FAMILY.items() for step in STEPS
    ]  # fmt: skip
    return ProblemResult(quantities=answers)


def _compare(
    name: str, integrator: HHT | GeneralizedAlpha, radii: tuple[float, ...], limit: float
) -> list[Quantity]:
    answers = [
        Quantity(label=f"{name}: at w dt {step:g}", value=spectral_radius(integrator, step),
               reference=radius, tolerance=1e-6 / radius)
        for step, radius in zip((1.0, 10.0), radii, strict=True)
    ]  # fmt: skip
    off = abs(spectral_radius(integrator, FAR) - limit)
    return [
        *answers,
        Quantity(label=f"{name}: far off", value=off, tolerance=1.1e-4, recorded=False),
    ]


PROBLEM = Problem(
    name="spectral radius",
    requirement="Integrators with numerical damping reduce frequencies that the step does not "
    "resolve by the factor of their parameter, and low frequencies only slightly.",
    reference="H. M. Hilber, T. J. R. Hughes, R. L. Taylor 1977; J. Chung, G. M. Hulbert 1993; the "
    "roots of the characteristic polynomial",
    tolerance_rationale="the last digit given; 1e-8 of the formula; at w dt = 1e6 coinciding "
    "eigenvalues still differ by up to 1e-4 from their limit",
    run=run,
)
