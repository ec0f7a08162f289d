"""A mass that is pulled over a rough floor by a spring: stick and slip."""

import numpy as np

from needlefem.checks import FrictionSystem, Problem, ProblemResult, Quantity
from needlefem.contact import SlipWeakeningFriction
from needlefem.dynamics import MatrixSystem

MASS, STIFFNESS, SPEED = 1.0, 100.0, 0.1
STATIC, KINETIC = 3.0, 2.0
OMEGA = np.sqrt(STIFFNESS / MASS)
DROP, SWING = STATIC - KINETIC, SPEED / OMEGA
SLIPS = 2.0 / OMEGA * (np.pi - np.arctan(DROP * OMEGA / (STIFFNESS * SPEED)))
STICKS = 2.0 * DROP / (STIFFNESS * SPEED)
AMPLITUDE = np.hypot(DROP / STIFFNESS, SWING)
EXACT = {
    "first slip": STATIC / (STIFFNESS * SPEED),
    "period": STICKS + SLIPS,
    "time of slip": SLIPS,
    "slip": SPEED * (STICKS + SLIPS),
    "largest force": KINETIC + STIFFNESS * AMPLITUDE,
    "force where it sticks": 2.0 * KINETIC - STATIC,
    "largest velocity": SPEED + OMEGA * AMPLITUDE,
    "dissipation": KINETIC * SPEED * (STICKS + SLIPS),
}


def cycle(steps: int) -> dict[str, float]:
    """Return the quantities of the first cycle, for a number of steps per slip phase."""
    one = np.ones((1, 1))
    drawn = FrictionSystem(
        MatrixSystem(MASS * one, STIFFNESS * one),
        one,
        KINETIC,
        SlipWeakeningFriction(STATIC / KINETIC),
        speed=0.0,
        load=lambda time: np.array([STIFFNESS * SPEED * time]),
    )
    states = [drawn.start(np.zeros(1), np.zeros(1))]
    states += drawn.located(states[0], SLIPS / steps, 1.1)
    slides = [state.slid[0] != 0.0 for state in states]
    changes = [n for n in range(1, len(states)) if slides[n] is not slides[n - 1]]
    loose, stuck, again = (states[n] for n in changes[:3])
    forces = [STIFFNESS * (SPEED * s.time - s.motion.u[0]) for s in states]
    return {
        "first slip": loose.time,
        "period": again.time - loose.time,
        "time of slip": stuck.time - loose.time,
        "slip": float(stuck.motion.u[0] - loose.motion.u[0]),
        "largest force": max(forces),
        "force where it sticks": forces[changes[1]],
        "largest velocity": max(float(s.motion.v[0]) for s in states),
        "dissipation": stuck.dissipated - loose.dissipated,
    }


def run(quick: bool) -> ProblemResult:
    """Compare a cycle with its closed form, and its error with that of twice as many steps."""
    coarse, fine = cycle(100), cycle(200)
    answers = [
        Quantity(label=name, value=coarse[name], reference=float(exact), tolerance=1e-2)
        for name, exact in EXACT.items()
    ]
    for name in ("period", "slip", "dissipation"):
        ratio = abs(coarse[name] - EXACT[name]) / abs(fine[name] - EXACT[name])
        label = f"{name}: error falls by, at twice the steps"
        answers.append(Quantity(label=label, value=ratio, reference=4.0, tolerance=2e-2,
                              recorded=False))  # fmt: skip
    return ProblemResult(quantities=answers)


PROBLEM = Problem(
    name="stick-slip oscillator",
    requirement="A sticking mass begins to slip at static friction, slides under kinetic friction, "
    "and sticks again when its velocity equals that of the floor, at the exact times and forces.",
    reference="exact: piecewise harmonic motion (J. P. Den Hartog 1931)",
    tolerance_rationale="1 % is required at a hundredth of the duration of a slip phase; the "
    "observed error is of second order",
    run=run,
)
