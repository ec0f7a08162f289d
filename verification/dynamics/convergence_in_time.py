"""Convergence in time: free vibration of a square, and a supported square under a slow load."""

from collections.abc import Callable
from functools import cache

import numpy as np
from scipy.sparse.linalg import spsolve

from needlefem.checks import (
    INTEGRATORS,
    WAVES,
    Problem,
    ProblemResult,
    Quantity,
    WorkPrecision,
    implicit_and_explicit,
    rectangle,
    square_mesh,
    tissue,
)
from needlefem.dynamics import (
    HHT,
    CentralDifference,
    Damping,
    GeneralizedAlpha,
    Integrator,
    Newmark,
    QuasiStatic,
    TissueSystem,
    critical_step,
    iterate,
    last,
)
from needlefem.elements import CATALOGUE
from needlefem.materials import Isotropic

LAW = Isotropic(youngs_modulus=2.6, poissons_ratio=0.3, density=1.0)
OMEGA = np.sqrt(2.0) * np.pi
"""Angular frequency of the free square's first Lame mode (G. Lame 1852)."""
CYCLES = 1.125
"""Number of periods; after many periods an error of the phase appears in the displacement."""
SLOW = 0.05
"""Angular frequency of the load; the lowest one of the supported square is about 1.3."""
DAMPING = Damping(mass_rate=0.02, stiffness_time=0.005)
LIMITS = {1: 4e-2, 2: 3e-3}
"""Largest error of the vibration by degree, on 32 and on 16 divisions."""
CHOICES: dict[str, tuple[Integrator, bool]] = {
    "Newmark": (Newmark(), False),
    "Newmark, lumped": (Newmark(), True),
    "HHT -0.05": (HHT(alpha=-0.05), False),
    "generalised-alpha 0.8": (GeneralizedAlpha(rho_inf=0.8), False),
    "central diff.": (CentralDifference(), False),
    "central diff., lumped": (CentralDifference(), True),
}
"""Integrator, and whether the mass is lumped."""


def lame(points: np.ndarray) -> np.ndarray:
    """Return the shape of Lame's mode."""
    x, y = np.pi * points.T
    return np.stack([-np.cos(x) * np.sin(y), np.sin(x) * np.cos(y)], axis=1)


def vibration(
    name: str, lumping: str | None, integrator: Integrator, divisions: int, steps: int
) -> tuple[int, float]:
    """Release the free square in Lame's mode; return unknowns and relative error at the end.

    `steps` is the number per period; it is larger where the integrator requires it.
    """
    element = CATALOGUE[name]
    system = TissueSystem(tissue(square_mesh(element, divisions), element, LAW), lumping=lumping)
    duration = CYCLES * 2.0 * np.pi / OMEGA
    count = int(np.ceil(CYCLES * steps))
    if isinstance(integrator, CentralDifference):
        count = max(count, int(np.ceil(duration / (0.9 * critical_step(system)))))
    stepper = integrator.stepper(system, duration / count)
    start = system.unknowns(lame)
    found = last(iterate(stepper, stepper.start(start, 0.0 * start), None, count))
    phase = OMEGA * duration
    off = found.u - np.cos(phase) * start
    return system.size, float(np.linalg.norm(off) / np.linalg.norm(start))


def pushed_square(lumping: str | None) -> tuple[TissueSystem, np.ndarray]:
    """Return a square that is fixed on one side, and a force that shears the opposite side."""
    system = TissueSystem(rectangle(CATALOGUE["Q2"], LAW, 12), DAMPING, lumping)
    return system, system.traction("y_max", lambda p: np.tile([0.3, 1.0], (len(p), 1)))


@cache
def steady(lumping: str | None) -> np.ndarray:
    """Return the complex amplitude under the slow load, computed without time steps."""
    system, force = pushed_square(lumping)
    stiffness = system.model.free_block(system.model.stiffness.matrix.tocsr())
    drag = DAMPING.mass_rate * system.mass + DAMPING.stiffness_time * stiffness
    matrix = stiffness + 1j * SLOW * drag - SLOW**2 * system.mass
    return spsolve(matrix.tocsc(), force.astype(complex))


def slow_push(lumping: str | None, integrator: Integrator, steps: int) -> tuple[int, float]:
    """Follow the slow load over one period of steady motion; return unknowns and error."""
    system, force = pushed_square(lumping)
    amplitude = steady(lumping)
    duration, count = 2.0 * np.pi / SLOW, steps
    if isinstance(integrator, CentralDifference):
        count = max(count, int(np.ceil(duration / (0.9 * critical_step(system)))))
    stepper = integrator.stepper(system, duration / count)

    def load(time: float) -> np.ndarray:
        return np.cos(SLOW * time) * force

    start = stepper.start(amplitude.real, (1j * SLOW * amplitude).real, load(0.0))
    worst = 0.0
    for number, motion in enumerate(iterate(stepper, start, load, count), 1):
        if number * 8 % count < 8:  # eight times a period
            exact = (amplitude * np.exp(2j * np.pi * number / count)).real
            worst = max(worst, float(np.linalg.norm(motion.u - exact)))
    return system.size, worst / float(np.linalg.norm(amplitude))


def orders(quick: bool) -> list[Quantity]:
    """Halve element size and time step together."""
    answers = []
    for name, element in CATALOGUE.items():
        if quick and element.degree > 1:
            continue
        fine = 32 if element.degree == 1 else 16
        for lumping in (None,) if quick else (None, *element.lumpings):
            coarse, error = (
                vibration(name, lumping, Newmark(), n, 10 * n)[1] for n in (fine // 2, fine)
            )
            label = f"{name}, {lumping or 'consistent'} mass"
            answers += [
                Quantity(label=f"vibration, {label}: error", value=error, tolerance=LIMITS[
                    element.degree]),
                Quantity(label=f"vibration, {label}: order, no less",
                       value=float(np.log2(coarse / error)), reference=1.9, at_least=True,
                       recorded=False),
            ]  # fmt: skip
    return answers


def run(quick: bool) -> ProblemResult:
    """Compare both motions with the exact ones."""
    answers = orders(quick)
    for name, (integrator, lumped) in CHOICES.items():
        if isinstance(integrator, CentralDifference) and quick:
            continue
        error = slow_push("row-sum" if lumped else None, integrator, 100)[1]
        answers.append(Quantity(label=f"slow push, {name}: error", value=error, tolerance=3e-6))
    error = slow_push(None, QuasiStatic(), 100)[1]
    answers.append(Quantity(label="slow push, without inertia: error", value=error, tolerance=5e-3))
    return ProblemResult(quantities=answers)


def _vibrating(integrator: Integrator, lumped: bool) -> Callable[[int], tuple[int, float]]:
    lumping = "row-sum" if lumped else None
    return lambda level: vibration("Q2", lumping, integrator, 2 << level, 10 * 4**level)


def _pushed(integrator: Integrator, lumped: bool) -> Callable[[int], tuple[int, float]]:
    lumping = "row-sum" if lumped else None
    return lambda level: slow_push(lumping, integrator, 16 << level)


RACES = [
    WorkPrecision(
        title="free vibration, Q2",
        quantity="displacement",
        about=INTEGRATORS,
        entrants={name: _vibrating(*choice) for name, choice in CHOICES.items()},
        levels=(0, 1, 2, 3),
        measure=lambda found: found,
        target=1e-2,
        group=WAVES[0],
        defaults=WAVES[1],
        rivals=implicit_and_explicit(CHOICES),
    ),
    WorkPrecision(
        title="slow push, Q2",
        quantity="displacement",
        about=INTEGRATORS,
        entrants={
            **{name: _pushed(*choice) for name, choice in CHOICES.items()},
            "quasi-static": _pushed(QuasiStatic(), False),
        },
        levels=(0, 1, 2, 3, 4),
        measure=lambda found: found,
        target=3e-3,
        group="slow motion",
        defaults=("generalised-alpha 0.8", "quasi-static"),
        rivals=(tuple(CHOICES), ("quasi-static",)),
    ),
]
PROBLEM = Problem(
    name="square in time",
    requirement="A free square vibrates in Lame's mode, in space and in time. A supported square "
    "follows a slow load.",
    reference="exact: G. Lame 1852; the slow load by its complex amplitude, without time steps",
    tolerance_rationale="second order in the time step and in the size of linear elements; slow "
    "load with 100 steps per period; the error without inertia is (w / w1)^2",
    run=run,
    races=RACES,
)
