"""D4 and D5: central differences at their limit, and a wave in a bar through every integrator."""

from collections.abc import Callable

import numpy as np
from scipy.sparse import diags_array

from needlefem.checks.problem import Answer, Findings, Problem
from needlefem.checks.race import INTEGRATORS, Race
from needlefem.dynamics import (
    HHT,
    CentralDifference,
    GeneralizedAlpha,
    Integrator,
    MatrixSystem,
    Newmark,
    critical_step,
)
from needlefem.dynamics.histories import constant, iterate, last, record
from needlefem.errors import CaseError

CELLS = 20
RMS = {20: 1.3e-2, 80: 3.2e-3, 320: 8.0e-4}
"""Error of the end under average acceleration, two digits, by number of elements."""
RINGING = 2.59
"""Largest force at the fixed end under average acceleration, within 0.03; 2 is exact."""


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


def grown(share: float) -> float:
    """Return how much a random motion has grown after 5000 steps of a share of the limit."""
    system = bar(CELLS)
    stepper = CentralDifference(refuse_unstable=False).stepper(
        system, share * critical_step(system)
    )
    start = np.random.default_rng(4).normal(size=CELLS)
    motion = stepper.start(start, np.zeros(CELLS))
    with np.errstate(over="ignore"):
        found = last(iterate(stepper, motion, None, 5000))
    return float(np.abs(found.u).max() / np.abs(start).max())


def impact(
    integrator: Integrator, system: MatrixSystem, share: float, duration: float
) -> tuple[float, float]:
    """Return the rms error of the loaded end and the largest force at the fixed one.

    A unit force pulls from time 0; the step is a share of a wave's time through a cell.
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
    exact = 2.0 - np.abs(times % 4.0 - 2.0)  # d'Alembert's: a triangle from 0 to 2 and back
    rms = float(np.sqrt(np.mean((found[:, 0] - exact) ** 2)))
    return rms, float(np.abs(found[:, 1]).max() * cells)


def refused() -> float:
    """Return whether a step above the limit is refused."""
    system = bar(CELLS)
    try:
        CentralDifference().stepper(system, 1.001 * critical_step(system))
    except CaseError:
        return 1.0
    return 0.0


def run(quick: bool) -> Findings:
    """Go to the limit and beyond, then send a wave through the bar."""
    exact = 1.0 / CELLS / np.sin(0.5 * np.pi * (1.0 - 0.5 / CELLS))
    answers = [
        Answer(label="critical step", value=critical_step(bar(CELLS)), reference=exact,
               tolerance=1e-8),
        Answer(label="0.999 of the limit: growth", value=grown(0.999), tolerance=30.0,
               recorded=False),
        Answer(label="1.001 of the limit: growth", value=min(grown(1.001), 1e300), reference=1e100,
               at_least=True, recorded=False),
        Answer(label="1.001 of the limit: refused", value=refused(), reference=1.0),
        Answer(label="central difference: end of the bar, 20 transits",
               value=impact(CentralDifference(), bar(CELLS), 1.0, 20.0)[0], tolerance=1e-12,
               recorded=False),
    ]  # fmt: skip
    for cells, rms in RMS.items():
        found, ringing = impact(Newmark(), bar(cells, lumped=False), 0.5, 8.0)
        answers += [
            Answer(label=f"Newmark, {cells} cells: end of the bar", value=found, reference=rms,
                   tolerance=4e-2),
            Answer(label=f"Newmark, {cells} cells: force rings to", value=ringing,
                   reference=RINGING, tolerance=1.6e-2),
        ]  # fmt: skip
    loudest = impact(Newmark(), bar(80, lumped=False), 0.5, 8.0)[1]
    for name, integrator in (("HHT -0.3", HHT(alpha=-0.3)),
                             ("generalised-alpha 0.5", GeneralizedAlpha(rho_inf=0.5))):  # fmt: skip
        rings = impact(integrator, bar(80, lumped=False), 0.5, 8.0)[1]
        label = f"{name}, 80 cells: rings less than Newmark by"
        answers.append(Answer(label=label, value=loudest - rings, reference=0.02, at_least=True))
    return Findings(answers=answers)


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
    """Return an entrant: explicit ones at their limit, others with half a cell a step."""

    def go(level: int) -> tuple[int, float]:
        system = bar(20 * 2**level, lumped=lumped)
        share = 0.5
        if isinstance(integrator, CentralDifference):
            share = system.size * critical_step(system)
            share = 1.0 / np.ceil(1.0 / min(share, 1.0) - 1e-9)  # a whole number of steps
        return system.size, impact(integrator, system, share, 4.0)[0]

    return go


RACES = [
    Race(
        title="step load on a bar",
        quantity="displacement of its end, rms",
        about=INTEGRATORS,
        entrants={name: racing(*choice) for name, choice in CHOICES.items()},
        levels=(0, 1, 2, 3),
        measure=lambda found: found,
        target=1e-2,
    )
]
PROBLEM = Problem(
    name="bar and critical step",
    requirement="Explicit integration is exact at its limit in a bar, grows without bound above "
    "it, and such a step is refused; implicit integration of a wave rings, and numerical damping "
    "quietens it.",
    reference="exact: J. le Rond d'Alembert 1747; rms and ringing of average acceleration by "
    "another code (consistent mass, half a cell a step, two periods)",
    why="round-off; two digits of another code; ringing (Gibbs) does not go away with cells",
    run=run,
    races=RACES,
)
