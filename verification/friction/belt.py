"""F3: a tethered mass on a running belt."""

import numpy as np

from needlefem.checks import Problem, ProblemResult, Quantity
from needlefem.contact import SlipWeakeningFriction
from needlefem.dynamics import MatrixSystem
from verification.support.friction_system import FrictionSystem

WEIGHT, STIFFNESS, SPEED = 10.0, 100.0, 0.1
STATIC, KINETIC = 0.3, 0.2
"""Friction coefficients."""
OMEGA = np.sqrt(STIFFNESS)
FORCE, LIMIT = KINETIC * WEIGHT, STATIC * WEIGHT
STICKS = 2.0 * (LIMIT - FORCE) / (STIFFNESS * SPEED)
SLIPS = 2.0 / OMEGA * (np.pi - np.arctan((LIMIT - FORCE) * OMEGA / (STIFFNESS * SPEED)))


def belt(ratio: float) -> FrictionSystem:
    """Return the mass on a belt whose static friction is larger by a ratio."""
    one = np.ones((1, 1))
    return FrictionSystem(
        MatrixSystem(one, STIFFNESS * one),
        one,
        FORCE,
        SlipWeakeningFriction(ratio),
        speed=SPEED,
    )


def period(steps: int) -> float:
    """Return the time between two moments at which the belt lets go."""
    mass = belt(LIMIT / FORCE)
    old, found = mass.start(np.zeros(1), np.array([SPEED])), []
    for state in mass.located(old, SLIPS / steps, 2.0):
        if state.slid[0] != 0.0 and old.slid[0] == 0.0:
            found.append(state.time)
        old = state
    return found[1] - found[0]


def smooth(steps: int) -> tuple[float, float]:
    """Return error of the stretch over its swing, and the least distance to the belt's speed.

    Without a drop of friction it never sticks: once a period the mass touches the belt's speed.
    """
    mass, swing = belt(1.0), SPEED / OMEGA
    start = mass.start(np.array([FORCE / STIFFNESS]), np.array([SPEED]))
    states = list(mass.located(start, 2.0 * np.pi / OMEGA / steps, 3.2 * np.pi / OMEGA))
    times = np.array([state.time for state in states])
    stretch = np.array([state.motion.u[0] for state in states])
    exact = FORCE / STIFFNESS + swing * np.sin(OMEGA * times)
    later = times > np.pi / OMEGA
    apart = SPEED - np.array([state.motion.v[0] for state in states])[later]
    return float(np.abs(stretch - exact).max() / swing), float(apart.min() / SPEED)


def run(quick: bool) -> ProblemResult:
    """Compare the period, and the motion without a drop of friction."""
    coarse, fine = smooth(100), smooth(200)
    return ProblemResult(
        quantities=[
            Quantity(label="period", value=period(100), reference=float(STICKS + SLIPS),
                   tolerance=1e-2),
            Quantity(label="one friction: stretch off", value=coarse[0], tolerance=1e-2),
            Quantity(label="one friction: error falls by, at twice the steps",
                   value=coarse[0] / fine[0], reference=4.0, tolerance=2e-2, recorded=False),
            Quantity(label="one friction: touches the belt's speed", value=coarse[1],
                   tolerance=1e-3, recorded=False),
        ]
    )  # fmt: skip


PROBLEM = Problem(
    name="belt",
    requirement="A tethered mass on a belt sticks and slips; without a drop of friction it swings "
    "about the place where friction stretches the spring.",
    reference="exact: the oscillator of F1 in the belt's frame, with friction as weight times "
    "coefficient",
    tolerance_rationale="1 % is asked for; the error is that of the period of average acceleration",
    run=run,
)
