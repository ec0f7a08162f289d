"""Scenes that many tests share."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from needlefem import load_case
from needlefem.geometry import Contour
from needlefem.insertion import Simulation
from needlefem.materials import Isotropic
from needlefem.scene import (
    BoxMesh,
    Discretization,
    Motion,
    Needle,
    Region,
    Scene,
    Support,
    vary,
)

ROOT = Path(__file__).parents[1]
CASES = ROOT / "cases"
PAPER_CASE = CASES / "prostate-2003" / "case.toml"


@pytest.fixture
def paper_scene() -> Scene:
    """Return the case of the paper."""
    return load_case(PAPER_CASE)


@pytest.fixture
def gel() -> Scene:
    """Return a uniform block of gel, 6 cm wide, with a needle beside its middle."""
    return Scene(
        title="gel",
        axes=("y", "z"),
        mesh=BoxMesh(size=(0.06, 0.06), divisions=(20, 20)),
        materials={"gel": Isotropic(youngs_modulus=30e3, poissons_ratio=0.45)},
        default_material="gel",
        regions={},
        supports={"walls": Support(faces=("y_min", "y_max", "z_max"))},
        discretization=Discretization(element="P1", path_spacing=1e-3),
        needle=Needle(tip_radius=2e-3, cutting_force=50.0, shaft_friction=10e3),
        motion=Motion(direction=(0.0, 1.0), max_depth=0.03),
        target=(0.0287, 0.02),
    )


@pytest.fixture
def organ(gel: Scene) -> Scene:
    """Return the gel with a stiff disc in it, off the needle's line."""
    turn = 2.0 * np.pi * np.arange(48) / 48
    circle = np.array([0.036, 0.025]) + 0.012 * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    return vary(
        gel,
        {
            "materials": {
                **gel.materials,
                "stiff": Isotropic(youngs_modulus=90e3, poissons_ratio=0.45),
            },
            "regions": {"organ": Region(contour=Contour(circle), material="stiff")},
        },
    )


@pytest.fixture
def popping(organ: Scene) -> Scene:
    """Return the organ behind tissue that is hard to cut: the needle snaps into it."""
    return vary(
        organ,
        {
            "discretization.element": "P2",
            "needle.cutting_force": 260.0,
            "needle.shaft_friction": 2e3,
            "regions.organ.cutting_force": 20.0,
            "materials.gel.youngs_modulus": 20e3,
        },
    )


@pytest.fixture
def insert() -> Callable[[Scene], object]:
    """Return a function that pushes the needle of a scene in to its largest depth."""

    def push(scene: Scene) -> object:
        simulation = Simulation(scene)
        return simulation.insert(simulation.entry_of_case())

    return push
