"""A mass with a spring on a moving belt: stick-slip, and vibration under constant friction."""

import numpy as np

from needlefem.checks import FrictionSystem, Problem, ProblemResult, Quantity
from needlefem.contact import SlipWeakeningFriction
from needlefem.dynamics import MatrixSystem

WEIGHT, STIFFNESS, SPEED = 10.0, 100.0, 0.1
STATIC, KINETIC = 0.3, 0.2
"""Friction coefficients."""
OMEGA = np.sqrt(STIFFNESS)
FORCE, LIMIT = KINETIC * WEIGHT, STATIC * WEIGHT
STICKS = 2.0 * (LIMIT - FORCE) / (STIFFNESS * SPEED)
SLIPS = 2.0 / OMEGA * (np.pi - np.arctan((LIMIT - FORCE) * OMEGA / (STIFFNESS * SPEED)))


def belt(ratio: float) -> FrictionSystem:
    """Return the mass on a belt with a given ratio of static to kinetic friction."""
    one = np.ones((1, 1))
    return FrictionSystem(
        MatrixSystem(one, STIFFNESS * one),
        one,
        FORCE,
        SlipWeakeningFriction(ratio),
        speed=SPEED,
    )


def period(steps: int) -> float:
    """Return the time between two successive beginnings of slip."""
    mass = belt(LIMIT / FORCE)
    old, found = mass.start(np.zeros(1), np.array([SPEED])), []
    for state in mass.located(old, SLIPS / steps, 2.0):
        if state.slid[0] != 0.0 and old.slid[0] == 0.0:
            found.append(state.time)
        old = state
    return found[1] - found[0]


def smooth(steps: int) -> tuple[float, float]:
    """Return the error relative to the amplitude, and the smallest difference to the belt's speed.

    With equal static and kinetic friction the mass never sticks: once per period its velocity
    reaches that of the belt.
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
    """Compare the period, and the motion with equal static and kinetic friction."""
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
    requirement="A mass with a spring on a belt sticks and slips. With equal static and kinetic "
    "friction it vibrates around the position in which friction and spring are in equilibrium.",
    reference="exact: the oscillator of `stick_slip` in the frame of the belt, with friction as "
    "weight times coefficient",
    tolerance_rationale="1 % is required; the error is that of the period of the average "
    "acceleration",
    run=run,
)
