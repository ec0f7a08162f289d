import numpy as np
import pytest

from needlefem.insertion import Simulation
from needlefem.insertion.tip_solver import WarmStart
from needlefem.scene import Scene


def test_marches_beside_one_another_need_fewer_evaluations(organ: Scene) -> None:
    simulation = Simulation(organ)
    height = np.array([1e-5, 0.0])
    first = simulation.insert(simulation.entry_through(np.array(organ.target)))
    second = simulation.insert(simulation.entry_through(np.array(organ.target) + height))
    alone = Simulation(organ, simulation.model)
    same = alone.insert(alone.entry_through(np.array(organ.target) + height))
    assert second.contact_solves < 0.85 * same.contact_solves
    assert first.contact_solves == pytest.approx(same.contact_solves, abs=5)
    assert second.tips == pytest.approx(same.tips, abs=1e-11)
    assert second.depths == pytest.approx(same.depths, abs=1e-11)


def test_a_march_elsewhere_begins_anew() -> None:
    warm_start = WarmStart(np.array([0.0, 0.0]))
    warm_start.learnt += [(np.array([0.1]), np.eye(1)), (np.array([0.3]), 2.0 * np.eye(1))]
    far, near = (warm_start.for_entry(np.array([x, 0.0]), 1e-3) for x in (2e-3, 1e-4))
    for other in (far, near):
        other.learnt.append((np.array([0.15]), np.eye(1)))
    slope, jacobian = near.guess(np.array([0.15]), np.eye(1))
    assert slope == pytest.approx([0.35])  # turns as the one before did
    assert jacobian == pytest.approx(2.0 * np.eye(1))
    slope, jacobian = far.guess(np.array([0.15]), np.eye(1))
    assert slope == pytest.approx([0.15])
    assert jacobian == pytest.approx(np.eye(1))
