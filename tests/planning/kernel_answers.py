"""Print points of plans by every method; `test_round_off` runs this under several kernels."""

import json
import sys

import numpy as np

from needlefem import load_case, plan
from needlefem.alterovitz2003.plan import paper_plan, refined
from needlefem.alterovitz2003.simulation import InTime, NodeSimulation
from needlefem.geometry import Contour
from needlefem.materials import Isotropic
from needlefem.planning import Plan
from needlefem.scene import (
    BoxMesh,
    Discretization,
    Motion,
    Needle,
    Planning,
    Region,
    Scene,
    Support,
    vary,
)
from tests.conftest import PAPER_CASE


def scene() -> Scene:
    """Return a stiff disc in gel, symmetric to a mesh line that the needle enters at."""
    turn = 2.0 * np.pi * np.arange(24) / 24
    circle = np.array([0.03, 0.025]) + 0.012 * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    return Scene(
        title="disc",
        axes=("y", "z"),
        mesh=BoxMesh(size=(0.06, 0.06), divisions=(15, 15)),
        materials={
            "gel": Isotropic(youngs_modulus=30e3, poissons_ratio=0.45),
            "stiff": Isotropic(youngs_modulus=90e3, poissons_ratio=0.45),
        },
        default_material="gel",
        regions={"organ": Region(contour=Contour(circle), material="stiff")},
        supports={"walls": Support(faces=("y_min", "y_max", "z_max"))},
        discretization=Discretization(element="P1", path_spacing=1e-3),
        needle=Needle(tip_radius=2e-3, cutting_force=50.0, shaft_friction=10e3),
        motion=Motion(direction=(0.0, 1.0), max_depth=0.022, speed=1e-2),
        target=(0.032, 0.011),
        planning=Planning(estimate=False, offset_range=(-1e-3, 1e-3), interval_tolerance=2.5e-4),
    )


def points(found: Plan) -> list[list[float]]:
    """Return where a plan releases and places, planned and not."""
    releases = [found.best, found.unplanned, found.depth_only]
    kept = [release for release in releases if release is not None]
    return [list(p) for one in kept for p in (one.release_point, one.placed_at)]


def fine_nodes() -> list[list[float]]:
    """Return the tip's path where a node is hard to bring to it: on the paper's mesh, halved."""
    fine = vary(refined(load_case(PAPER_CASE), 2), {"motion.max_depth": 7e-3})
    simulation = NodeSimulation(fine, InTime())
    pushed = simulation.insert(simulation.entry_of_case())
    return [list(point) for point in pushed.tips]


def main() -> None:
    """Print everything as JSON."""
    numbers = np.random.default_rng(1).standard_normal((2, 200, 200))
    common = scene()
    stepped = vary(
        common,
        {"discretization.integrator": "quasi_static", "discretization.path_spacing": 2e-3,
         "needle.tangential_penalty": 1e9},
    )  # fmt: skip
    sticking = vary(
        stepped, {"needle.static_friction_ratio": 1.3,
                  "needle.slip_weakening_distance": 2e-3},
    )  # fmt: skip
    level = vary(common, {"target": (0.03, 0.011)})
    found = {
        "root": points(plan(common)),
        "golden": points(plan(level, search="golden")),
        "grid": points(plan(level, search="grid")),
        "stepped": points(plan(stepped)),
        "sticking": points(plan(sticking)),
        "paper": points(paper_plan(common).plan),
        "spread": points(paper_plan(level, InTime(spread=True)).plan),
        "fine nodes": fine_nodes(),
    }
    bits = (numbers[0] @ numbers[1]).tobytes().hex()[:4000]
    sys.stdout.write(json.dumps({"points": found, "bits": bits}))


if __name__ == "__main__":
    main()
