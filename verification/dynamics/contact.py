"""Dynamics with friction contact: sticking, energy balance, oscillations, drift."""

import numpy as np
from scipy.sparse import diags_array

from needlefem.checks import FrictionState, FrictionSystem, Problem, ProblemResult, Quantity
from needlefem.checks.friction_models import END, MEAN
from needlefem.contact import SlipWeakeningFriction
from needlefem.dynamics import (
    AlphaParameters,
    GeneralizedAlpha,
    MatrixSystem,
    Newmark,
    kinetic_energy,
)

RMS = {20: 1.3e-2, 80: 3.2e-3, 320: 8.0e-4}
"""Error at the end of a bar that is fixed at the other end, from `critical_step`."""
CELLS = 10
RATIO, LENGTH = 1.5, 2e-3
"""Ratio of static to kinetic friction, and slip-weakening distance."""


def bar(cells: int) -> MatrixSystem:
    """Return a bar of unit length, stiffness and mass, free at both ends."""
    h, beside, middle = 1.0 / cells, np.ones(cells), np.ones(cells + 1)
    middle[[0, -1]] = 0.5
    stiffness = diags_array([2.0 * middle, -beside, -beside], offsets=[0, 1, -1]) / h
    mass = diags_array([2.0 / 3.0 * middle, beside / 6.0, beside / 6.0], offsets=[0, 1, -1]) * h
    return MatrixSystem(mass, stiffness)


def pulled(cells: int, limit: float) -> tuple[FrictionSystem, list[FrictionState]]:
    """Return a bar with friction at one end and a unit force at the other from time 0."""
    still, step = np.zeros(cells + 1), 0.5 / cells
    force = np.append(still[1:], 1.0)
    held = FrictionSystem(
        bar(cells),
        np.eye(cells + 1)[:1],
        limit,
        SlipWeakeningFriction(),
        speed=0.0,
        load=lambda _: force,
    )
    start = held.start(still, still)
    return held, [start, *held.iterate(start, step, round(8.0 / step))]


def wave(cells: int) -> tuple[float, float, float]:
    """Return the rms error of the end, the mean multiplier, the displacement of the stuck end."""
    _, states = pulled(cells, 10.0)
    times = np.array([state.time for state in states[1:]])
    ends = np.array([state.motion.u[[0, -1]] for state in states[1:]])
    exact = 2.0 - np.abs(times % 4.0 - 2.0)
    rms = float(np.sqrt(np.mean((ends[:, 1] - exact) ** 2)))
    pull = float(np.mean([state.pull[0] for state in states[1:]]))
    return rms, pull, float(np.abs(ends[:, 0]).max())


def pushed(steps: int, weights: AlphaParameters) -> float:
    """Return the energy residual, relative to the work, of a mass pushed over a rough floor."""
    one = np.ones((1, 1))
    mass = FrictionSystem(MatrixSystem(one, one), one, 0.4, SlipWeakeningFriction(), speed=0.0,
                   load=lambda time: np.array([np.sin(0.9 * time)]), weights=weights)  # fmt: skip
    start = mass.start(np.zeros(1), np.zeros(1))
    return mass.missing(start, mass.last(start, 20.0 / steps, steps))


def caught(integrator: Newmark | GeneralizedAlpha, steps: int) -> tuple[float, float]:
    """Return velocity and acceleration that remain in a point whose displacement is prescribed.

    The point is at rest and then moves at unit speed; both values are relative to the first ones.
    """
    one = np.ones((1, 1))
    stepper = integrator.stepper(MatrixSystem(one, one), 1e-2)
    motion = stepper.start(np.zeros(1), np.zeros(1))
    first = stepper.advance(motion, np.array([1e-2])).a[0]
    for number in range(1, steps + 1):
        motion = stepper.advance(motion, np.array([1e-2 * number]))
    return abs(float(motion.v[0]) - 1.0), abs(float(motion.a[0] / first))


def caught_by_velocity(steps: int) -> float:
    """Return the remaining velocity of a sliding point that begins to stick, by its velocity."""
    one = np.ones((1, 1))
    mass = FrictionSystem(MatrixSystem(one, one), one, 1e3, SlipWeakeningFriction(), speed=1.0)
    found = mass.last(mass.start(np.zeros(1), np.zeros(1)), 1e-2, steps)
    return abs(float(found.motion.v[0]) - 1.0)


def cycles(count: int, steps: int) -> tuple[float, float, float]:
    """Return drift, growth of energy and energy residual of a bar under friction in many steps.

    The counterpart moves forwards, rests, moves back and rests, `steps` steps each. Drift is the
    change of the bar's mean displacement over the last cycle, relative to its largest value.
    """
    system, still = bar(CELLS), np.zeros(CELLS + 1)
    tether = system.stiffness + diags_array([1.0, *still[1:]])
    system = MatrixSystem(system.mass, tether, 0.05 * tether + system.mass)
    rubbings = [
        FrictionSystem(
            system, np.eye(CELLS + 1)[1::2], 0.02, SlipWeakeningFriction(RATIO, LENGTH), speed=speed
        )
        for speed in (0.02, 0.0, -0.02, 0.0)
    ]
    start = state = rubbings[0].start(still, still)
    means, energies = [], []
    for _ in range(count):
        most = 0.0
        for rubbing in rubbings:
            for new in rubbing.iterate(state, 0.02, steps):
                state, v = new, new.motion.v
                most = max(most, kinetic_energy(system, v) + system.strain_energy(new.motion.u))
        means.append(float(state.motion.u.mean()))
        energies.append(most)
    half, size = count // 2, max(abs(mean) for mean in means)
    growth = max(energies[half:]) / max(energies[:half])
    return abs(means[-1] - means[-2]) / size, growth, rubbings[0].missing(start, state)


def run(quick: bool) -> ProblemResult:
    """Run a bar with friction at one end, a mass, a point that begins to stick, and many cycles."""
    answers = []
    for cells, rms in RMS.items():
        if quick and cells > 80:
            continue
        found, pulling, moved = wave(cells)
        answers += [
            Quantity(label=f"{cells} cells held by friction: end of the bar", value=found,
                   reference=rms, tolerance=4e-2),
            Quantity(label=f"{cells} cells: multiplier, mean of two periods", value=pulling,
                   reference=-1.0, tolerance=1e-2),
            Quantity(label=f"{cells} cells: held end moves", value=moved, tolerance=1e-12,
                   recorded=False),
        ]  # fmt: skip
    sliding, states = pulled(20, 1.5)
    answers.append(
        Quantity(
            label="held end slides: not accounted for",
            tolerance=1e-12,
            value=sliding.missing(states[0], states[-1]),
            recorded=False,
        )
    )
    answers.append(Quantity(label="friction, mean force: missing", value=pushed(4000, MEAN),
                          tolerance=1e-10, recorded=False))  # fmt: skip
    answers += ringing_answers()
    return ProblemResult(
        quantities=answers if quick else answers + end_force_answers() + long_answers()
    )


def end_force_answers() -> list[Quantity]:
    """Use the friction at the end of each step: the error decreases with the square of the step."""
    coarse, fine = (pushed(n, END) for n in (2000, 16000))
    return [
        Quantity(label="friction, force at the end, 16000 steps: missing", value=fine,
               tolerance=1e-6, recorded=False),
        Quantity(label="friction, force at the end: falls by, at 8 times the steps",
               value=coarse / fine, reference=50.0, at_least=True, recorded=False),
    ]  # fmt: skip


def ringing_answers() -> list[Quantity]:
    """Show oscillations of the average acceleration under a prescribed displacement."""
    average, damped = caught(Newmark(), 1000), caught(GeneralizedAlpha(rho_inf=0.8), 200)
    return [
        Quantity(label="caught by displacement, average acceleration: velocity left",
               value=average[0], reference=1.0, tolerance=1e-9),
        Quantity(label="caught by displacement, average acceleration: acceleration grows by",
               value=average[1], reference=500.0, at_least=True, recorded=False),
        Quantity(label="caught by displacement, generalised-alpha 0.8: velocity left",
               value=damped[0], tolerance=1e-12, recorded=False),
        Quantity(label="caught by velocity, average acceleration: velocity left",
               value=caught_by_velocity(1000), tolerance=1e-12, recorded=False),
    ]  # fmt: skip


def long_answers() -> list[Quantity]:
    """Run 1e5 steps of stick and slip; some hundred cycles are needed for shakedown."""
    drift, growth, missing = cycles(500, 50)
    label = "1e5 steps of stick-slip and rest"
    return [
        Quantity(label=f"{label}: drift of a cycle", value=drift, tolerance=1e-9, recorded=False),
        Quantity(label=f"{label}: largest energy, second half over first", value=growth,
               tolerance=1.0 + 1e-9, recorded=False),
        Quantity(label=f"{label}: energy missing", value=missing, tolerance=1e-9, recorded=False),
    ]  # fmt: skip


PROBLEM = Problem(
    name="dynamics with contact",
    requirement="Points that stick by friction move like fixed points, and the friction force "
    "equals the multiplier. The energy balance of sliding points has no residual. A point that "
    "begins to stick does not oscillate. The motion does not drift.",
    reference="exact: J. le Rond d'Alembert 1747; the same bar without contact; first law; "
    "eigenvalues of motion under a constraint",
    tolerance_rationale="two digits of another program; round-off with mean forces, second order "
    "with the forces at the end of the step",
    run=run,
)
