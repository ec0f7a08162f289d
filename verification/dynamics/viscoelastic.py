"""Viscoelastic tissue: relaxation, creep, loss factor, free decay, energy balance."""

import numpy as np
from scipy.sparse import block_array
from scipy.sparse.linalg import spsolve

from needlefem._arrays import Floats
from needlefem.checks import Problem, ProblemResult, Quantity, rectangle
from needlefem.dynamics import (
    HHT,
    CentralDifference,
    GeneralizedAlpha,
    MatrixSystem,
    Newmark,
    QuasiStatic,
    Stepper,
    TissueEnergyBalance,
    TissueSystem,
    constant,
    iterate,
    last,
)
from needlefem.elements import CATALOGUE
from needlefem.fem import TissueModel, traction_load
from needlefem.materials import Viscoelastic
from needlefem.scene import Support

SHARES, TIMES = (0.3, 0.2), (0.2, 3.0)
FREQUENCY = 0.4
"""Frequency of the load, Hz, between those of the two branches."""


def tissue_of(ratio: float, **constants: object) -> Viscoelastic:
    """Return a law with two branches (or others)."""
    given = {"shares": SHARES, "times": TIMES} | constants
    return Viscoelastic(youngs_modulus=3e3, poissons_ratio=ratio, **given)


def pulled(name: str, law: Viscoelastic) -> tuple[TissueModel, Floats]:
    """Return a square with two sliding sides, and a uniform load on a third side."""
    supports = {
        "back": Support(faces=("y_min",), fixed=("y",)),
        "below": Support(faces=("z_min",), fixed=("z",)),
    }
    model = rectangle(CATALOGUE[name], law, 2, (1.0, 1.0), supports)
    ends = model.mesh.boundaries["y_max"]
    along = traction_load(model.mesh, model.element, ends, lambda _, normals: normals)
    return model, along[model.free_dofs]


def sheared(name: str, law: Viscoelastic) -> tuple[TissueModel, Floats]:
    """Return a square that is fixed on one side, and a load that shears the opposite side."""
    model = rectangle(CATALOGUE[name], law, 4)
    force = np.zeros(model.ndofs)
    force[model.dofs_on(model.mesh.boundaries["y_max"], [1])] = 1.0
    return model, force[model.free_dofs]


def of_the_law() -> list[Quantity]:
    """Shear a material point, in steps as long as its relaxation times, and keep its strain."""
    law, rate, duration = tissue_of(0.3), 0.01, 1.0
    direction = np.zeros((3, 3))
    direction[0, 1] = 1.0
    answers, state = [], None
    for steps, until in ((4, duration), (3, 4.0)):
        begin = 0.0 if until == duration else duration
        for number in range(1, steps + 1):
            time = begin + (until - begin) * number / steps
            strain = rate * min(time, duration)
            found = law.evaluate(strain * direction, state, (until - begin) / steps)
            state = found.state
            exact = law.lame()[1] * strain
            for share, relaxation in zip(SHARES, TIMES, strict=True):
                modulus = law.lame()[1] * share / (1.0 - sum(SHARES))
                pulled = -np.expm1(-min(time, duration) / relaxation)
                left = np.exp(-max(time - duration, 0.0) / relaxation)
                exact += modulus * relaxation * rate * pulled * left
            label = f"law: stress after {time:g} s"
            answers.append(Quantity(label=label, value=float(found.stress[0, 1]), reference=exact,
                                  tolerance=1e-12))  # fmt: skip
    return answers


def relaxation() -> list[Quantity]:
    """Displace a side suddenly: the force decreases like the relaxation modulus."""
    law = tissue_of(0.5)
    model, along = pulled("P2-P1", law)
    stepper = QuasiStatic().stepper(TissueSystem(model), 0.25)
    motion = stepper.start(np.zeros_like(along), np.zeros_like(along), along)
    place = along @ motion.u
    answer, answers = stepper.factor.solve(along), []
    for number in range(1, 9):
        free = stepper.free_displacement(motion)
        force = (place - along @ free) / (along @ answer)
        motion = stepper.advance(motion, free + force * answer)
        exact = law.shear_modulus(0.25 * number) / law.shear_modulus(0.0)
        answers.append(Quantity(label=f"relaxation: force after {0.25 * number:g} s", value=force,
                              reference=exact, tolerance=1e-10))  # fmt: skip
    return answers


def creep_error(steps: int) -> float:
    """Return the relative error of the displacement 2 s after a sudden load, with one branch."""
    law = tissue_of(0.5, shares=(0.4,), times=(1.0,))
    model, force = pulled("P2-P1", law)
    system = TissueSystem(model)
    stepper = QuasiStatic().stepper(system, 2.0 / steps)
    motion = stepper.start(np.zeros_like(force), np.zeros_like(force), force)
    found = last(iterate(stepper, motion, constant(force), steps))
    relaxed = system.factor(0.0, 0.0, 1.0).solve(force)
    at_once = 1.0 / law.shear_modulus(0.0) * law.lame()[1]
    exact = 1.0 - (1.0 - at_once) * np.exp(-2.0 * at_once)  # retardation: T G(0) / G
    return abs(float(force @ found.u / (force @ relaxed)) / exact - 1.0)


def loss(name: str, per_period: int) -> list[Quantity]:
    """Compare the amplitude under a harmonic load in time with that of the complex problem."""
    law = tissue_of(0.3)
    model, force = sheared(name, law)
    system = TissueSystem(model)
    omega, step = 2.0 * np.pi * FREQUENCY, 1.0 / (FREQUENCY * per_period)
    periods = 20  # six times the longest relaxation time: the transient motion has decayed
    stepper = QuasiStatic().stepper(system, step)
    motion = stepper.start(np.zeros_like(force), np.zeros_like(force))
    found, balance = 0.0 + 0.0j, TissueEnergyBalance(stepper)
    for number in range(periods * per_period):
        before, after = (np.sin(omega * step * n) * force for n in (number, number + 1))
        old, motion = motion, stepper.step_under_load(motion, before, after)
        if number >= (periods - 1) * per_period:
            balance.add(old, motion, before, after)
            turn = np.exp(-1j * omega * step * (number + 1))
            found += 2j / per_period * turn * float(force @ motion.u)
    direct = directly(model, system, force, omega)
    return [
        Quantity(
            label=f"{name}: amplitude", value=abs(found), reference=abs(direct), tolerance=1e-4
        ),
        Quantity(
            label=f"{name}: loss factor",
            value=float(np.tan(-np.angle(found))),
            reference=float(np.tan(-np.angle(direct))),
            tolerance=5e-4,
        ),
        Quantity(
            label=f"{name}: energy lost in a period",
            value=balance.relaxation,
            reference=-np.pi * direct.imag,
            tolerance=1e-3,
        ),
    ]


def directly(model: TissueModel, system: TissueSystem, force: Floats, omega: float) -> complex:
    """Solve the complex problem: each branch has its stiffness at the frequency of the load."""
    matrix = model.free_block(model.stiffness.matrix.tocsr()).astype(complex)
    for time, relaxing in system.branches:
        turn = 1j * omega * time
        matrix = matrix + turn / (1.0 + turn) * relaxing
    if model.element.definite:
        return complex(force @ spsolve(matrix.tocsc(), force))
    gained = model.stiffness.coupling.tocsr()[:, model.free_dofs]
    volume = model.stiffness.volume
    scale = 1e3  # pressures in kPa
    both = block_array([[matrix, scale * gained.T], [scale * gained, -(scale**2) * volume]])
    found = spsolve(both.tocsc(), np.concatenate([force, np.zeros(volume.shape[0])]))
    return complex(force @ found[: len(force)])


def incompressible_loss(per_period: int) -> float:
    """Return the relative error of the loss factor of incompressible tissue."""
    law = tissue_of(0.5)
    model, force = pulled("Q2-Q1", law)
    omega, step = 2.0 * np.pi * FREQUENCY, 1.0 / (FREQUENCY * per_period)
    stepper = QuasiStatic().stepper(TissueSystem(model), step)
    motion = stepper.start(np.zeros_like(force), np.zeros_like(force))
    sums = np.zeros(2)
    run = iterate(stepper, motion, lambda t: np.sin(omega * t) * force, 20 * per_period)
    for number, at in enumerate(run, 1):
        if number > 19 * per_period:
            angle = omega * step * number
            sums += np.array([np.sin(angle), np.cos(angle)]) * float(force @ at.u)
    modulus = law.complex_shear_modulus(FREQUENCY)
    return abs(-sums[1] / sums[0] / (modulus.imag / modulus.real) - 1.0)


def energies() -> list[Quantity]:
    """Load and unload with each integrator, and compute the energy balance."""
    law = tissue_of(0.3, density=1e3)
    model, force = sheared("P2", law)
    system = TissueSystem(model, lumping=None)
    answers = []
    explicit = 0.9 * 2.0 / system.largest_frequency
    for name, integrator, step in (
        ("quasi-static", QuasiStatic(), 0.05), ("Newmark", Newmark(), 0.02),
        ("HHT -0.1", HHT(alpha=-0.1), 0.02),
        ("generalised-alpha 0.8", GeneralizedAlpha(rho_inf=0.8), 0.02),
        ("central difference", CentralDifference(), explicit),
    ):  # fmt: skip
        stepper: Stepper = integrator.stepper(system, step)
        balance, motion = TissueEnergyBalance(stepper), stepper.start(0.0 * force, 0.0 * force)
        for number in range(400):
            before, after = (min(step * n, 1.0) * force for n in (number, number + 1))
            old, motion = motion, stepper.step_under_load(motion, before, after)
            balance.add(old, motion, before, after)
        answers += [
            Quantity(label=f"{name}: ledger, residual", value=balance.residual, tolerance=1e-10,
                   recorded=False),
            Quantity(label=f"{name}: energy lost by relaxation over work",
                   value=balance.relaxation / balance.work, reference=0.0, at_least=True),
        ]  # fmt: skip
        if name in ("Newmark", "quasi-static"):
            share = abs(balance.algorithmic / balance.work)
            answers.append(
                Quantity(
                    label=f"{name}: algorithmic share", value=share, tolerance=1e-10, recorded=False
                )
            )
    return answers


def largest_growth() -> float:
    """Return the largest growth of a random motion for all steps and relaxation times."""
    worst = 0.0
    rng = np.random.default_rng(8)
    for integrator in (Newmark(), HHT(alpha=-0.1), GeneralizedAlpha(rho_inf=0.8)):
        for step in (1e-2, 1.0, 1e2):
            for time in (1e-3, 1.0, 1e3):
                one = np.ones((1, 1))
                system = MatrixSystem(one, one, branches=[(time, one)])
                stepper = integrator.stepper(system, step)
                motion = stepper.start(rng.normal(size=1), np.zeros(1))
                begin = abs(motion.u[0])
                found = last(iterate(stepper, motion, None, 3000))
                worst = max(worst, abs(found.u[0]) / begin)
    return worst


def run(quick: bool) -> ProblemResult:
    """Compare with closed forms, and with the solution of the complex problem."""
    answers = [*of_the_law(), *relaxation(), *energies()]
    coarse, fine = creep_error(40), creep_error(80)
    answers += [
        Quantity(label="creep: error, 80 steps", value=fine, tolerance=5e-5),
        Quantity(label="creep: order", value=float(np.log2(coarse / fine)), reference=2.0,
               tolerance=0.025, recorded=False),
    ]  # fmt: skip
    if not quick:
        answers.append(Quantity(label="growth of any motion", value=largest_growth(), tolerance=1.0,
                              recorded=False))  # fmt: skip
    coarse, fine = incompressible_loss(50), incompressible_loss(100)
    answers += [
        Quantity(label="incompressible: loss factor, error", value=fine, tolerance=1e-3),
        Quantity(label="incompressible: order", value=float(np.log2(coarse / fine)), reference=2.0,
               tolerance=0.025, recorded=False),
    ]  # fmt: skip
    for name in ("P2-P1",) if quick else CATALOGUE:
        answers += loss(name, 200)
    return ProblemResult(quantities=answers)


PROBLEM = Problem(
    name="viscoelastic tissue",
    requirement="Relaxation of forces, creep under a load and loss of vibrations follow the "
    "relaxation modulus of shear; the energy balance contains the dissipated energy.",
    reference="exact: generalised Maxwell solid; incompressible tissue follows its shear modulus; "
    "correspondence principle (T. Alfrey 1944), solved as a complex problem without time",
    tolerance_rationale="round-off where the strain changes linearly over a step; elsewhere second "
    "order in the step",
    run=run,
)
