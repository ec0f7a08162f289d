"""Simple systems under dry friction."""

import numpy as np
import pytest

from needlefem.checks import FrictionSystem
from needlefem.checks.friction_models import END, MEAN
from needlefem.contact import SlipWeakeningFriction
from needlefem.dynamics import MatrixSystem

ONE = np.ones((1, 1))


@pytest.mark.parametrize("weights", [MEAN, END])
def test_what_slid_is_caught_at_once_and_stays(weights: object) -> None:
    mass = FrictionSystem(
        MatrixSystem(ONE, 0.0 * ONE), ONE, 1e4, SlipWeakeningFriction(), speed=1.0, weights=weights
    )
    states = list(mass.iterate(mass.start(np.zeros(1), np.zeros(1)), 1e-2, 50))
    assert [float(state.motion.v[0]) for state in states] == pytest.approx([1.0] * 50)
    lag = [1e-2 * (n + 1) - float(state.motion.u[0]) for n, state in enumerate(states)]
    assert lag == pytest.approx([5e-3] * 50, abs=1e-12)  # half a step's way, once


def test_catching_takes_the_energy_of_an_inelastic_impact() -> None:
    mass = FrictionSystem(
        MatrixSystem(ONE, 0.0 * ONE), ONE, 1e4, SlipWeakeningFriction(), speed=1.0
    )
    start = mass.start(np.zeros(1), np.zeros(1))
    end = mass.last(start, 1e-2, 5)
    assert end.dissipated == pytest.approx(0.5)
    assert mass.missing(start, end) <= 1e-12


def test_a_limit_bounds_the_force() -> None:
    mass = FrictionSystem(MatrixSystem(ONE, ONE), ONE, 0.3, SlipWeakeningFriction(), speed=1.0)
    state = mass.start(np.zeros(1), np.zeros(1))
    pulls = [abs(float(s.pull[0])) for s in mass.iterate(state, 0.05, 400)]
    assert max(pulls) <= 0.3


def test_two_points_stick_and_slip_each_on_its_own() -> None:
    system = MatrixSystem(np.eye(2), np.diag([1.0, 100.0]))
    bar = FrictionSystem(system, np.eye(2), 1.0, SlipWeakeningFriction(1.2, 1e-2), speed=0.1)
    start = bar.start(np.zeros(2), np.full(2, 0.1))
    seen = {tuple(state.slid != 0.0) for state in bar.iterate(start, 0.01, 1000)}
    assert {(False, False), (False, True)} <= seen
    assert bar.missing(start, bar.last(start, 0.01, 1000)) <= 1e-11
