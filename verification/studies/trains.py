"""A train of seeds: where each rests, simulated, and by the shortcut for the first.

A seed that is released during the insertion, or at its end, remains in the material at the tip.
During the retraction the friction has the opposite direction and displaces the tissue. At the same
position in space the tip is then in other material than during the insertion.
"""

import numpy as np

from needlefem._arrays import Vector
from needlefem.insertion import Insertion, Seed, Simulation
from needlefem.scene import Scene, Stage, vary
from needlefem.studies import Table

SEEDS = 5
REST = 1e-9
"""Largest distance of a seed from its material after the retraction, relative to the depth."""


def study(scene: Scene, other: Scene | None = None) -> list[Table]:
    """Return the final positions of five seeds that are released during the retraction."""
    del other
    deep = 0.75 * scene.motion.max_depth
    pitch = 0.8 * deep / (SEEDS - 1)
    stages = (
        Stage(depth=deep),
        Stage(depth=0.1 * deep, seed_count=SEEDS, seed_spacing=pitch, release="seed"),
        Stage(depth=-1e-3),
    )
    simulation = Simulation(vary(scene, {"motion.stages": stages}))
    found = simulation.move(simulation.entry_of_case())
    rest = found.states[-1].seeds
    rows = [_row(found, seed, place) for seed, place in zip(found.seeds, rest, strict=True)]
    off = max(_apart(place, seed) for seed, place in zip(found.seeds, rest, strict=True))
    first = found.seeds[0]
    return [
        Table(
            title=f"{SEEDS} seeds released {100 * pitch:.2g} cm apart during the retraction",
            columns=("seed", "released at (cm)", "prediction (cm)", "simulated (cm)",
                     "apart (cm)", "left over (cm)"),
            rows=rows,
            passed=off <= REST * deep and _apart(first.elastic_prediction, first) <= REST * deep,
            note="depths; prediction: material at the tip at that depth in the push; left over: "
            "distance of the simulated seed from the material of its release, needle outside",
        )
    ]  # fmt: skip


def _row(found: Insertion, seed: Seed, place: Vector) -> list[object]:
    along = found.axis.axial_coordinate
    apart, left = _apart(seed.elastic_prediction, seed), _apart(place, seed)
    depths = (
        float(along(seed.released_at)),
        float(along(seed.elastic_prediction)),
        float(along(place)),
    )
    return [seed.name, *(100.0 * depth for depth in depths), 100.0 * apart, 100.0 * left]


def _apart(place: Vector, seed: Seed) -> float:
    """Return the distance of a place from the material of a release, m."""
    return float(np.linalg.norm(place - seed.point))
