import numpy as np
import pytest

from needlefem import build_model
from needlefem.elements import element_row
from needlefem.insertion import Simulation, TipTrajectory
from needlefem.mesh import uniformly_refined
from needlefem.scene import Scene, resolve, tip_quadrature_points, vary, with_element

EXACT = 6400
"""Kernel points beyond which nothing changes that is asked for here."""
DEPTHS = np.linspace(0.008, 0.025, 8)


def _places(simulation: Simulation) -> np.ndarray:
    path = TipTrajectory(simulation.insert(simulation.entry_of_case()))
    return np.array([path.at_depth(depth).point for depth in DEPTHS])


def _with_points(scene: Scene, points: int) -> Scene:
    return vary(scene, {"discretization.tip_quadrature_points": points})


@pytest.mark.parametrize(("element", "radius"), [("P1", 2e-3), ("P2", 2e-3), ("P2", 4e-3)])
def test_kernel_errors_are_below_a_tenth_of_the_mesh_errors(
    organ: Scene, element: str, radius: float
) -> None:
    scene = vary(with_element(organ, element), {"needle.tip_radius": radius})
    exact = Simulation(_with_points(scene, EXACT))
    placed = _places(exact)
    fine = build_model(exact.scene, uniformly_refined(exact.model.mesh))
    by_mesh = np.linalg.norm(_places(Simulation(exact.scene, fine)) - placed, axis=1).max()
    by_kernel = _places(Simulation(scene, exact.model)) - placed
    assert np.linalg.norm(by_kernel, axis=1).max() < 0.1 * by_mesh


def test_kernel_points_follow_the_distance_of_nodes(gel: Scene) -> None:
    scene = vary(gel, {"needle.tip_radius": 4e-3})
    linear, quadratic = (tip_quadrature_points(scene, element_row(name)) for name in ("P1", "P2"))
    assert quadratic == pytest.approx(4 * linear, abs=4)
    chosen = resolve(with_element(scene, "P2"))
    assert chosen.scene.discretization.tip_quadrature_points == quadratic
    assert "points per node distance" in chosen.reasons["tip_quadrature_points"]
    assert resolve(_with_points(scene, 77)).scene.discretization.tip_quadrature_points == 77
