"""Central differences at the critical step, and a wave in a bar by all integrators."""

from collections.abc import Callable

import numpy as np
from scipy.sparse import diags_array

from needlefem.checks import (
    INTEGRATORS,
    WAVES,
    Problem,
    ProblemResult,
    Quantity,
    WorkPrecision,
    implicit_and_explicit,
    rectangle,
)
from needlefem.dynamics import (
    HHT,
    CentralDifference,
    GeneralizedAlpha,
    Integrator,
    MatrixSystem,
    Newmark,
    QuasiStatic,
    System,
    TissueSystem,
    constant,
    critical_step,
    iterate,
    record,
)
from needlefem.elements import CATALOGUE
from needlefem.errors import CaseError
from needlefem.materials import Isotropic

CELLS = 20
RMS = {20: 1.3e-2, 80: 3.2e-3, 320: 8.0e-4}
"""Error of the end with the average acceleration, two digits, by number of elements."""
RINGING = 2.59
"""Largest force at the fixed end with the average acceleration, within 0.03; exact: 2."""
IN_A_BAR: dict[str, Integrator] = {
    "Newmark": Newmark(),
    "HHT -0.05": HHT(alpha=-0.05),
    "HHT -0.3": HHT(alpha=-0.3),
    "generalised-alpha 0.8": GeneralizedAlpha(rho_inf=0.8),
    "generalised-alpha 0.5": GeneralizedAlpha(rho_inf=0.5),
    "central difference": CentralDifference(),
}


def bar(cells: int, *, lumped: bool = True) -> MatrixSystem:
    """Return a bar of unit length, stiffness and mass, fixed at one end."""
    h, beside = 1.0 / cells, np.ones(cells - 1)
    end = np.ones(cells)
    end[-1] = 0.5
    stiffness = diags_array([2.0 * end, -beside, -beside], offsets=[0, 1, -1]) / h
    share = 0.0 if lumped else 1.0 / 6.0
    mass = diags_array([(1.0 - 2.0 * share) * end, share * beside, share * beside],
                       offsets=[0, 1, -1]) * h  # fmt: skip
    return MatrixSystem(mass, stiffness)


def grown(system: System, share: float, steps: int = 5000) -> float:
    """Return the largest growth of a random motion over steps of a share of the critical step."""
    stepper = CentralDifference(refuse_unstable=False).stepper(
        system, share * critical_step(system)
    )
    u, v = np.random.default_rng(4).normal(size=(2, system.size))
    largest = 0.0
    with np.errstate(over="ignore"):
        for motion in iterate(stepper, stepper.start(u, v / stepper.step), None, steps):
            largest = max(largest, float(np.abs(motion.u).max()))
    return largest / float(np.abs(u).max())


def impact(
    integrator: Integrator, system: MatrixSystem, share: float, duration: float
) -> tuple[float, float]:
    """Return the rms error of the loaded end and the largest force at the fixed end.

    A unit force acts from time 0; the step is a share of the time of a wave through one cell.
    """
    cells = system.size
    step = share / cells
    force = np.zeros(cells)
    force[-1] = 1.0
    stepper = integrator.stepper(system, step)
    motion = stepper.start(np.zeros(cells), np.zeros(cells), force)
    count = round(duration / step)
    found = record(
        iterate(stepper, motion, constant(force), count), lambda m: np.array([m.u[-1], m.u[0]])
    )
    times = step * np.arange(1, count + 1)
    exact = 2.0 - np.abs(times % 4.0 - 2.0)  # d'Alembert: a triangle from 0 to 2 and back
    rms = float(np.sqrt(np.mean((found[:, 0] - exact) ** 2)))
    return rms, float(np.abs(found[:, 1]).max() * cells)


def refused() -> float:
    """Return 1 if a step above the critical one is refused, else 0."""
    system = bar(CELLS)
    try:
        CentralDifference().stepper(system, 1.001 * critical_step(system))
    except CaseError:
        return 1.0
    return 0.0


def limits() -> list[Quantity]:
    """Test a bar at and above the critical step."""
    exact = 1.0 / CELLS / np.sin(0.5 * np.pi * (1.0 - 0.5 / CELLS))
    system = bar(CELLS)
    at_limit, later = grown(system, 1.0), grown(system, 1.0, 10_000)
    return [
        Quantity(label="critical step", value=critical_step(system), reference=exact,
               tolerance=1e-8),
        Quantity(label="0.999 of the limit: growth", value=grown(system, 0.999), tolerance=30.0,
               recorded=False),
        Quantity(label="at the limit: growth", value=at_limit, reference=100.0, at_least=True,
               recorded=False),
        Quantity(label="at the limit: growth in twice the steps, over that", value=later / at_limit,
               reference=2.0, tolerance=2e-2, recorded=False),
        Quantity(label="1.001 of the limit: growth", value=min(grown(system, 1.001), 1e300),
               reference=1e100, at_least=True, recorded=False),
        Quantity(label="1.001 of the limit: refused", value=refused(), reference=1.0),
    ]  # fmt: skip


def of_tissues(quick: bool) -> list[Quantity]:
    """Test tissues of each element and mass matrix just below and above the critical step."""
    answers = []
    law = Isotropic(youngs_modulus=1.0, poissons_ratio=0.3, density=1.0)
    for name, element in CATALOGUE.items():
        for lumping in (None,) if quick else (None, *element.lumpings):
            system = TissueSystem(rectangle(element, law, 4), lumping=lumping)
            label = f"{name}, {lumping or 'consistent'} mass"
            answers += [
                Quantity(label=f"{label}, 0.999 of the limit: growth", tolerance=30.0,
                       value=grown(system, 0.999, 1000), recorded=False),
                Quantity(label=f"{label}, 1.001 of the limit: growth", reference=1e30,
                       value=grown(system, 1.001, 1000), at_least=True, recorded=False),
            ]  # fmt: skip
    return answers


def waves() -> list[Quantity]:
    """Compute a wave in the bar with each integrator and mass matrix."""
    exact = impact(CentralDifference(), bar(CELLS), 1.0, 20.0)[0]
    answers = [Quantity(label="central difference: end of the bar, 20 transits", value=exact,
                      tolerance=1e-12, recorded=False)]  # fmt: skip
    for cells, rms in RMS.items():
        found, ringing = impact(Newmark(), bar(cells, lumped=False), 0.5, 8.0)
        answers += [
            Quantity(label=f"Newmark, {cells} cells: end of the bar", value=found, reference=rms,
                   tolerance=4e-2),
            Quantity(label=f"Newmark, {cells} cells: force rings to", value=ringing,
                   reference=RINGING, tolerance=1.6e-2),
        ]  # fmt: skip
    for name, integrator in IN_A_BAR.items():
        for lumped in (False, True):
            coarse, _ = impact(integrator, bar(20, lumped=lumped), 0.5, 8.0)
            fine, ringing = impact(integrator, bar(80, lumped=lumped), 0.5, 8.0)
            label = f"{name}, {'lumped' if lumped else 'consistent'} mass, 80 cells"
            answers += [
                Quantity(label=f"{label}: end of the bar", value=fine, tolerance=5.5e-3),
                Quantity(label=f"{label}: better than 20 cells by", value=coarse / fine,
                       reference=3.5, at_least=True),
                Quantity(label=f"{label}: force rings to, no less", value=ringing, reference=2.4,
                       at_least=True),
            ]  # fmt: skip
    return answers


def damped_and_still() -> list[Quantity]:
    """Damp the oscillations by the integrator; compute the bar without inertia."""
    answers = []
    loudest = impact(Newmark(), bar(80, lumped=False), 0.5, 8.0)[1]
    for name in ("HHT -0.3", "generalised-alpha 0.5"):
        rings = impact(IN_A_BAR[name], bar(80, lumped=False), 0.5, 8.0)[1]
        label = f"{name}, 80 cells: rings less than Newmark by"
        answers.append(Quantity(label=label, value=loudest - rings, reference=0.02, at_least=True))
    rms, force = impact(QuasiStatic(), bar(80), 0.5, 8.0)
    return [
        *answers,
        Quantity(label="quasi-static: end of the bar", value=rms, reference=3.0**-0.5,
               tolerance=1e-4),
        Quantity(label="quasi-static: force", value=force, reference=1.0, tolerance=1e-10),
    ]  # fmt: skip


def run(quick: bool) -> ProblemResult:
    """Test the critical step, and compute a wave in the bar."""
    return ProblemResult(quantities=[*limits(), *of_tissues(quick), *waves(), *damped_and_still()])


CHOICES: dict[str, tuple[Integrator, bool]] = {
    "Newmark": (Newmark(), False),
    "Newmark, lumped": (Newmark(), True),
    "HHT -0.05": (HHT(alpha=-0.05), False),
    "generalised-alpha 0.8": (GeneralizedAlpha(rho_inf=0.8), False),
    "central diff.": (CentralDifference(), False),
    "central diff., lumped": (CentralDifference(), True),
}
"""Integrator, and whether the mass is lumped."""


def racing(integrator: Integrator, lumped: bool) -> Callable[[int], tuple[int, float]]:
    """Return an entrant; explicit ones use the critical step, others half a cell per step."""

    def go(level: int) -> tuple[int, float]:
        system = bar(20 * 2**level, lumped=lumped)
        share = 0.5
        if isinstance(integrator, CentralDifference):
            share = system.size * critical_step(system)
            share = 1.0 / np.ceil(1.0 / min(share, 1.0) - 1e-9)  # an integer number of steps
        return system.size, impact(integrator, system, share, 4.0)[0]

    return go


RACES = [
    WorkPrecision(
        title="step load on a bar",
        quantity="displacement of its end, rms",
        about=INTEGRATORS,
        entrants={name: racing(*choice) for name, choice in CHOICES.items()},
        levels=(0, 1, 2, 3),
        measure=lambda found: found,
        target=1e-2,
        group=WAVES[0],
        defaults=WAVES[1],
        rivals=implicit_and_explicit(CHOICES),
    )
]
PROBLEM = Problem(
    name="bar and critical step",
    requirement="At the critical step, explicit integration of a bar is exact and round-off grows "
    "linearly; above it the growth is unbounded, and such a step is refused. Other integrators "
    "oscillate at a wave front, and numerical damping reduces the oscillations. Without inertia "
    "there is no wave.",
    reference="exact: J. le Rond d'Alembert 1747; rms error and oscillation of the average "
    "acceleration by another program (consistent mass, half a cell per step, two periods)",
    tolerance_rationale="round-off; two digits of another program; the overshoot (Gibbs) does not "
    "decrease with the number of cells; a wave front reduces the order of all integrators: here "
    "errors decrease with the size of the cells",
    run=run,
    races=RACES,
)
