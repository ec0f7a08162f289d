"""A result that is given up is freed at once: no reference cycle keeps its tissue.

Factorisations are large. What waits for the garbage collector's oldest generation may wait for
hundreds of scenes.
"""

import gc
import weakref
from collections.abc import Callable, Iterator

import pytest

import needlefem as nf
from needlefem.elements import CATALOGUE
from needlefem.fem import TissueModel
from needlefem.insertion import Simulation, energy_terms
from needlefem.materials import Viscoelastic
from needlefem.scene import DYNAMIC, Scene, Stage, vary, with_element

STAGES = (
    Stage(depth=0.01),
    Stage(dwell=0.1),
    Stage(depth=0.004),
    Stage(depth=0.012),
    Stage(depth=0.0),
)


@pytest.fixture
def uncollected() -> Iterator[None]:
    gc.collect()
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


def kept(make: Callable[[], object]) -> tuple[int, int]:
    """Return how many models there are with a result, and after it was deleted."""
    before = {id(thing) for thing in gc.get_objects() if isinstance(thing, TissueModel)}
    result = make()
    with_it = [
        weakref.ref(thing)
        for thing in gc.get_objects()
        if isinstance(thing, TissueModel) and id(thing) not in before
    ]
    del result
    return len(with_it), sum(reference() is not None for reference in with_it)


def scene_of(organ: Scene, element: str, **changes: object) -> Scene:
    small = {"mesh.divisions": (8, 8), "motion.max_depth": 0.012}
    return with_element(vary(organ, small | changes), element)


@pytest.mark.usefixtures("uncollected")
@pytest.mark.parametrize("element", list(CATALOGUE))
def test_an_insertion_is_freed_with_every_element(organ: Scene, element: str) -> None:
    scene = scene_of(organ, element)

    def insert() -> object:
        found = nf.simulate(scene)
        energy_terms(found)
        return found

    assert kept(insert) == (1, 0)


@pytest.mark.usefixtures("uncollected")
@pytest.mark.parametrize("integrator", ["path_following", "quasi_static", *DYNAMIC])
@pytest.mark.parametrize("element", ["P2", "Q1", "MINI"])
def test_a_motion_in_time_is_freed(organ: Scene, element: str, integrator: str) -> None:
    changes = {"discretization.integrator": integrator, "motion.stages": STAGES}
    scene = scene_of(organ, element, **changes)
    assert kept(lambda: nf.simulate(scene)) == (1, 0)


@pytest.mark.usefixtures("uncollected")
@pytest.mark.parametrize("integrator", ["quasi_static", *DYNAMIC])
def test_viscous_tissue_is_freed(gel: Scene, integrator: str) -> None:
    law = Viscoelastic(youngs_modulus=20e3, poissons_ratio=0.45, shares=(0.4,), times=(0.5,))
    changes = {"materials.gel": law, "discretization.integrator": integrator}
    scene = vary(scene_of(gel, "P1", **changes), {"motion.stages": STAGES[:3]})
    assert kept(lambda: nf.simulate(scene)) == (1, 0)


@pytest.mark.usefixtures("uncollected")
@pytest.mark.parametrize("element", ["P2", "Q1", "P2-P1"])
@pytest.mark.parametrize("estimate", [False, True])
def test_a_plan_is_freed(organ: Scene, element: str, *, estimate: bool) -> None:
    changes = {"planning.estimate": estimate, "motion.max_depth": 0.04}
    scene = scene_of(organ, element, **changes)
    models, left = kept(lambda: nf.plan(scene))
    assert models >= 1
    assert left == 0


@pytest.mark.usefixtures("uncollected")
@pytest.mark.parametrize("changes", [{"motion.max_depth": 0.2}, {"needle.cutting_force": 1e9}])
def test_an_insertion_that_fails_is_freed(gel: Scene, changes: dict[str, object]) -> None:
    scene = scene_of(gel, "P2", **changes)
    assert kept(lambda: nf.simulate(scene)) == (1, 0)


@pytest.mark.usefixtures("uncollected")
def test_the_factorisation_goes_with_the_simulation(gel: Scene) -> None:
    simulation = Simulation(scene_of(gel, "P2-P1"))
    simulation.move(simulation.entry_of_case())
    factor = weakref.ref(simulation.model.factor)
    assert factor() is not None
    del simulation
    assert factor() is None
