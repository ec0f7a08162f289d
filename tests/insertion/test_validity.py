"""Strains of a state come from its own displacement."""

from itertools import pairwise

import numpy as np
import pytest

from needlefem import simulate
from needlefem.errors import CaseError, SimulationError
from needlefem.fem import LinearFunctionals
from needlefem.insertion import (
    Insertion,
    SaveAt,
    Simulation,
    displacements,
    energy_terms,
    insertion_run,
    load,
    validity,
)
from needlefem.materials import Isotropic, Viscoelastic
from needlefem.scene import Scene, Stage, vary

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
    """Return an insertion, and the displacement at its end from the forces of all its steps."""
    coarse = {"mesh.divisions": (10, 10), "motion.max_depth": 0.012}
    scene = vary(gel, coarse | TISSUES[request.param])
    found = simulate(scene)
    again = Simulation(scene)
    tissue = again.insertion_run(again.entry_of_case()).tissue_response
    for before, state in pairwise(found.states):
        if state.time > before.time:
            tissue.begin(state.time - before.time)
            tissue.finish(load(found.model, found.axis.frame, state, found.segments))
    moved = tissue.displacement()
    assert moved is not None
    return found, moved


def test_states_hold_the_displacement_of_the_tissue(run: tuple[Insertion, np.ndarray]) -> None:
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


def test_states_without_displacement_are_refused(gel: Scene) -> None:
    coarse = {"mesh.divisions": (10, 10), "motion.max_depth": 0.012}
    scene = vary(gel, coarse | TISSUES["viscoelastic"])
    found = simulate(scene, SaveAt(fields=False))
    assert found.states[-1].displacement is not None  # for the strains at the end
    assert found.states[5].displacement is None
    with pytest.raises(SimulationError, match=r"state 5 does not hold .*SaveAt\(fields=True\)"):
        displacements(found, [5])


@pytest.mark.parametrize("stages", [(), (Stage(depth=0.02), Stage(depth=0.01))])
def test_elastic_states_hold_the_equilibrium_if_asked(
    gel: Scene, stages: tuple[Stage, ...]
) -> None:
    scene = vary(gel, {"motion.stages": stages})
    plain = simulate(scene)
    found = simulate(scene, SaveAt(fields=True))
    assert all(state.displacement is None for state in plain.states)
    numbers = range(len(plain.states))
    assert displacements(found, numbers) == pytest.approx(displacements(plain, numbers), abs=1e-15)


def test_memory_limits_what_is_kept_by_default(gel: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(insertion_run, "MEMORY", 1e4)
    scene = vary(gel, {"mesh.divisions": (10, 10)} | TISSUES["viscoelastic"])
    found = simulate(vary(scene, {"motion.max_depth": 0.006}))
    held = [state.displacement is not None for state in found.states]
    assert held == [False] * (len(held) - 1) + [True]


def test_some_states_are_kept(popping: Scene) -> None:
    """Of time stepping one of five, with those around ruptures, events and given times."""
    scene = vary(popping, {"discretization.integrator": "quasi_static"})
    scene = vary(scene, {"discretization.time_step": 0.05})
    every = simulate(scene)
    speed = scene.motion.speed
    times = (0.011 / speed,)
    found = simulate(scene, SaveAt(every=5, times=times))
    assert len(found.states) < 0.6 * len(every.states)
    assert found.states[-1].depth == every.states[-1].depth
    assert len(found.ruptures) == len(every.ruptures) > 0
    for one, other in zip(found.ruptures, every.ruptures, strict=True):
        for a, b in ((one.first, other.first), (one.last, other.last)):
            assert found.states[a].tip == pytest.approx(every.states[b].tip)
    depths = found.depths
    assert any(a <= 0.011 <= b for a, b in pairwise(depths))
    assert np.diff(depths)[np.searchsorted(depths, 0.011) - 1] < 2.1 * 0.05 * speed
    assert energy_terms(found).work == pytest.approx(energy_terms(every).work, rel=1e-12)
    with pytest.raises(CaseError, match=r"SaveAt.every: 0 is below 1"):
        SaveAt(every=0)
