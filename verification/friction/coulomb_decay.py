"""Free vibration under dry friction: linear decay of the amplitude, then rest."""

import numpy as np

from needlefem.checks import FrictionState, FrictionSystem, Problem, ProblemResult, Quantity
from needlefem.contact import SlipWeakeningFriction
from needlefem.dynamics import MatrixSystem

STIFFNESS, START = 100.0, 0.105
STATIC, KINETIC = 1.2, 1.0
TURNS = (-0.085, 0.065, -0.045, 0.025, -0.005)
PERIOD = 0.2 * np.pi
STOP = 2.5 * PERIOD


def turns(steps: int) -> tuple[list[FrictionState], FrictionState]:
    """Return the states at the turning points, for a number of steps per period, and a late one."""
    one = np.ones((1, 1))
    mass = FrictionSystem(
        MatrixSystem(one, STIFFNESS * one),
        one,
        KINETIC,
        SlipWeakeningFriction(STATIC / KINETIC),
        speed=0.0,
    )
    old = state = mass.start(np.array([START]), np.zeros(1))
    found = []
    for state in mass.located(old, PERIOD / steps, 2.0 * STOP):
        if state.slid[0] != old.slid[0] and old.slid[0] != 0.0:
            found.append(state)
        old = state
    return found, state


def run(quick: bool) -> ProblemResult:
    """Compare the turning points, and the time at which the motion stops."""
    found, last = turns(100)
    answers = [
        Quantity(label=f"turning point {n + 1}", value=float(state.motion.u[0]), reference=exact,
               tolerance=1e-9)
        for n, (state, exact) in enumerate(zip(found, TURNS, strict=True))
    ]  # fmt: skip
    answers += [
        Quantity(label="time at which it stops", value=found[-1].time, reference=STOP,
               tolerance=1e-3),
        Quantity(label="creep after it", value=abs(float(last.motion.u[0] - found[-1].motion.u[0])),
               tolerance=1e-14, recorded=False),
        Quantity(label="velocity after it", value=abs(float(last.motion.v[0])), tolerance=1e-12,
               recorded=False),
    ]  # fmt: skip
    if not quick:
        finer, _ = turns(200)
        off = [abs(states[-1].time / STOP - 1.0) for states in (found, finer)]
        answers.append(Quantity(label="time: error falls by, at twice the steps",
                              value=off[0] / off[1], reference=4.0, tolerance=2e-2,
                              recorded=False))  # fmt: skip
    return ProblemResult(quantities=answers)


PROBLEM = Problem(
    name="Coulomb decay",
    requirement="Dry friction reduces the amplitude by the same length in each half period, until "
    "the spring force is below static friction at a turning point and the mass remains at rest.",
    reference="exact: the amplitude decreases by 2 F / k in each half period",
    tolerance_rationale="with time steps that end at the turning points the average acceleration "
    "conserves the energy of each half period exactly; its period is longer by (w dt)^2 / 12",
    run=run,
)
