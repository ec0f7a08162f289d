"""Strains of a state come from its own displacement."""

import dataclasses

import numpy as np
import pytest

from needlefem.errors import SimulationError
from needlefem.fem import LinearFunctionals
from needlefem.insertion import (
    DynamicResponse,
    Insertion,
    Simulation,
    ViscoelasticResponse,
    displacements,
    load,
    validity,
)
from needlefem.materials import Isotropic, Viscoelastic
from needlefem.scene import Scene, vary

SOFT = {"youngs_modulus": 30e3, "poissons_ratio": 0.45, "density": 1000.0}
SLOW = Viscoelastic(**SOFT, shares=(0.5,), times=(10.0,))
TISSUES = {
    "viscoelastic": {"materials.gel": SLOW, "discretization.integrator": "quasi_static"},
    "dynamic": {
        "materials.gel": Isotropic(**SOFT), "discretization.integrator": "generalized_alpha",
        "motion.speed": 1.0, "discretization.time_step": 5e-4,
    },
}  # fmt: skip


@pytest.fixture(params=TISSUES)
def run(gel: Scene, request: pytest.FixtureRequest) -> tuple[Insertion, np.ndarray]:
    """Return an insertion, and the displacement that the tissue had at its end."""
    coarse = {"mesh.divisions": (10, 10), "motion.max_depth": 0.012}
    simulation = Simulation(vary(gel, coarse | TISSUES[request.param]))
    course = simulation.insertion_run(simulation.entry_of_case())
    found = course.result(tuple(course.iterate()))
    tissue_response = course.tissue_response
    assert isinstance(tissue_response, ViscoelasticResponse | DynamicResponse)
    motion = (
        tissue_response.motion
        if isinstance(tissue_response, DynamicResponse)
        else tissue_response._motion
    )
    assert motion is not None
    moved = np.zeros(found.model.ndofs)
    moved[found.model.free_dofs] = motion.u
    return found, moved


def test_the_field_of_the_last_state_is_the_tissues(run: tuple[Insertion, np.ndarray]) -> None:
    found, moved = run
    last = len(found.states) - 1
    own = displacements(found, [last, 3])[:, 0]
    assert own == pytest.approx(moved, abs=1e-8 * np.abs(moved).max())
    state = found.states[last]
    tip = LinearFunctionals(state.tip_nodes, state.tip_weights[None]).of(found.model.nodal(own))[0]
    assert tip @ found.axis.direction == pytest.approx(state.tip_displacement, rel=1e-8)
    still = found.model.solve(load(found.model, found.axis.frame, state, found.segments)[:, None])
    assert np.abs(still[:, 0] - moved).max() > 1e-3 * np.abs(moved).max()  # not that at rest


def test_strains_are_those_of_the_field(run: tuple[Insertion, np.ndarray]) -> None:
    found, moved = run
    strains = validity(found, len(found.states) - 1)
    gradient = np.moveaxis(found.model.basis.interpolate(moved).grad, (0, 1), (2, 3))
    where = np.moveaxis(np.asarray(found.model.basis.global_coordinates()), 0, 2)
    away = np.linalg.norm(where - found.states[-1].tip, axis=2) > found.scene.needle.tip_radius
    largest = np.linalg.norm(0.5 * (gradient + np.swapaxes(gradient, 2, 3)), 2, axis=(2, 3))
    assert strains.largest_strain == pytest.approx(largest[away].max(), rel=1e-6)


def test_missing_states_are_not_passed_over(run: tuple[Insertion, np.ndarray]) -> None:
    found, _ = run
    thinned = dataclasses.replace(found, states=found.states[::3])
    with pytest.raises(SimulationError, match="keep all states"):
        displacements(thinned, [len(thinned.states) - 1])
