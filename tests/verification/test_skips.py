import numpy as np
import pytest

from needlefem import build_model
from needlefem.insertion import Simulation
from needlefem.scene import Scene, build_mesh, resolve, vary
from verification.benchmarks.scaling import grown
from verification.benchmarks.skips import skips


@pytest.fixture
def plain(organ: Scene) -> Scene:
    return vary(
        resolve(organ).scene,
        {"planning.offset_range": (-0.002, 0.002), "planning.interval_tolerance": 1e-4},
    )


def test_what_is_skipped_changes_nothing(plain: Scene) -> None:
    found = {skip.name: skip for skip in skips(plain)}
    assert set(found) == set(resolve(plain).skipped)
    for name, skip in found.items():
        if name != "pictures":  # imports alone, see test_architecture
            apart = np.max(np.abs(np.asarray(skip.lean()) - np.asarray(skip.full())))
            assert apart <= skip.allowed, name


def test_a_mesh_grows_away_from_the_needle_only(plain: Scene) -> None:
    mesh, larger = build_mesh(plain), grown(plain, 4000)
    assert 3800 < build_model(plain, larger).ndofs < 6000
    near = [m.p[:, np.abs(m.p[0] - 0.0287) < 0.0035].T for m in (mesh, larger)]
    assert {tuple(p) for p in near[0]} == {tuple(p) for p in near[1]}


def test_results_say_how_they_were_computed(plain: Scene) -> None:
    simulation = Simulation(plain)
    simulation.insert(simulation.entry_of_case())
    reasons = simulation.reasons
    assert reasons["factorisation"].startswith("SuperLU")
    assert "columns for all nodes touched" in reasons["responses"]
