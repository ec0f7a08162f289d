"""Energy balance of forced motion with viscous damping and dry friction."""

import numpy as np

from needlefem.checks import Problem, ProblemResult, Quantity, eigenfrequencies, rectangle
from needlefem.dynamics import (
    HHT,
    CentralDifference,
    Damping,
    GeneralizedAlpha,
    Integrator,
    MatrixSystem,
    Newmark,
    TissueEnergyBalance,
    TissueSystem,
    critical_step,
)
from needlefem.elements import CATALOGUE
from needlefem.materials import Isotropic

INTEGRATORS: dict[str, Integrator] = {
    "Newmark": Newmark(),
    "HHT -0.1": HHT(alpha=-0.1),
    "generalised-alpha 0.8": GeneralizedAlpha(rho_inf=0.8),
    "central difference": CentralDifference(),
}


def forced(
    name: str, lumping: str | None, integrator: Integrator, share: float
) -> TissueEnergyBalance:
    """Return the energy balance of 500 steps of a share of the longest period under a load.

    The step of an explicit integrator is 0.9 of the critical step.
    """
    law = Isotropic(youngs_modulus=1.0, poissons_ratio=0.3, density=1.0)
    model = rectangle(CATALOGUE[name], law, 4)
    first = eigenfrequencies(model, 1)[0]
    step = share * 2.0 * np.pi / first
    damped = isinstance(integrator, CentralDifference) or share < 0.1
    damping = Damping(mass_rate=0.1 * first) if damped else None
    system = TissueSystem(model, damping, lumping)
    if isinstance(integrator, CentralDifference):
        step = 0.9 * critical_step(system)
    stepper = integrator.stepper(system, step)
    force = np.sin(np.arange(system.size))
    balance, motion = TissueEnergyBalance(stepper), stepper.start(0.0 * force, 0.0 * force)
    for number in range(500):
        before, after = (np.sin(0.7 * first * step * n) * force for n in (number, number + 1))
        old, motion = motion, stepper.step_under_load(motion, before, after)
        balance.add(old, motion, before, after)
    return balance


def with_friction(steps: int, *, mean: bool) -> float:
    """Return the energy residual, relative to the work, of a mass pushed over a rough floor.

    The friction at the end of each step stops the mass, up to its limit. The dissipation is the
    force at the end of the step times the slip, or the mean of both ends' forces times the slip.
    """
    one, limit, step = np.ones((1, 1)), 0.4, 20.0 / steps
    stepper = Newmark().stepper(MatrixSystem(one, one), step)
    motion, friction = stepper.at_rest(), np.zeros(1)
    taken = work = 0.0
    gentle = stepper.factor.solve(np.ones(1))[0]
    rate = 2.0 * gentle / step  # velocity at the end of the step due to a unit force
    for number in range(1, steps + 1):
        before, after = (np.array([np.sin(0.9 * step * n)]) for n in (number - 1, number))
        free = stepper.advance(motion, stepper.free_displacement(motion, after))
        found = np.clip(-free.v / rate, -limit, limit)
        new = stepper.advance(motion, free.u + gentle * found)
        moved = float(new.u[0] - motion.u[0])
        work += 0.5 * float(before[0] + after[0]) * moved
        taken -= float(0.5 * (friction + found)[0] if mean else found[0]) * moved
        motion, friction = new, found
    energy = 0.5 * float(motion.u[0] ** 2 + motion.v[0] ** 2)
    return abs(work - taken - energy) / abs(work)


def run(quick: bool) -> ProblemResult:
    """Compute the energy balances."""
    answers = []
    for name, element in CATALOGUE.items():
        for lumping in (None, *element.lumpings):
            if quick and (lumping or name not in ("P1", "P2", "P2-P1")):
                continue
            mass = f"{lumping or 'consistent'} mass"
            for share in (0.05, 1.0):
                balance = forced(name, lumping, Newmark(), share)
                label = f"{name}, {mass}, Newmark, step {share:g} T: not accounted for"
                missing = abs(balance.algorithmic) / balance.total_absolute_work + balance.residual
                answers.append(
                    Quantity(label=label, value=missing, tolerance=1e-12, recorded=False)
                )
    for name, integrator in INTEGRATORS.items():
        balance = forced("Q1", "row-sum", integrator, 0.05)
        label = f"{name}, lumped mass, damped: residual"
        answers.append(
            Quantity(label=label, value=balance.residual, tolerance=1e-12, recorded=False)
        )
        answers.append(Quantity(label=f"{name}: share taken by the integrator", tolerance=2e-2,
                              value=abs(balance.algorithmic / balance.damping)))  # fmt: skip
    missing = with_friction(4000, mean=True)
    answers.append(Quantity(label="friction, mean force: missing", value=missing, tolerance=1e-10,
                          recorded=False))  # fmt: skip
    if quick:
        return ProblemResult(quantities=answers)
    coarse, fine = (with_friction(n, mean=False) for n in (2000, 16000))
    answers += [
        Quantity(label="friction, force at the end, 16000 steps: missing", value=fine,
               tolerance=1e-6),
        Quantity(label="friction, force at the end: falls by, at 8 times the steps",
               value=coarse / fine, reference=50.0, at_least=True, recorded=False),
    ]  # fmt: skip
    return ProblemResult(quantities=answers)


PROBLEM = Problem(
    name="energy balance",
    requirement="The work of all forces equals the sum of kinetic energy, strain energy, damping "
    "and friction work.",
    reference="exact: first law, discrete for the average acceleration with mean forces "
    "(T. Belytschko, D. F. Schoeberle 1975)",
    tolerance_rationale="round-off; friction at the end of the step causes an error that "
    "decreases with the step",
    run=run,
)
