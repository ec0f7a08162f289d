"""Numerical noise in lateral error and depth as functions of the lateral offset.

The second differences for many offsets at small distances show kinks where a contact point crosses
an element edge. A search cannot resolve differences below this noise.
"""

import numpy as np

from needlefem._table import Table
from needlefem.errors import SimulationError
from needlefem.fem.compliance import CachedCompliance
from needlefem.planning.planner import planner_of
from needlefem.scene import Scene

HEIGHTS = 200
BOUNDS = {5e-8: 1e-8, 5e-6: 1e-6}
"""Largest second difference (m) by the increment of the lateral offset (m)."""


def study(scene: Scene, other: Scene | None = None) -> list[Table]:
    """Return the largest second differences around the planned lateral offset."""
    del other
    planner = planner_of(scene)
    planner.simulation.responses = CachedCompliance(planner.simulation.model)
    start = planner.plan().solution.height
    rows: list[list[object]] = []
    for apart, bound in BOUNDS.items():
        values = []
        for number in range(HEIGHTS):
            height = start + number * apart
            reading = planner.read(height).level()
            reach = reading.reach
            if reach is None:
                where = 100.0 * float(height[0])
                raise SimulationError(f"at an offset of {where:+.4g} cm, {reading.sentence}")
            values.append(
                [float((reach.point - planner.target) @ planner.laterals[0]), reach.depth]
            )
        second = np.abs(np.diff(np.array(values), 2, axis=0)).max(axis=0)
        rows.append(
            [
                1e6 * apart,
                100.0 * second[0],
                100.0 * second[1],
                100.0 * bound,
                bool(second.max() <= bound),
            ]
        )
    return [
        Table(
            title=f"largest second difference over {HEIGHTS} lateral offsets",
            columns=("increment (um)", "lateral error (cm)", "depth (cm)", "bound (cm)", "passed"),
            rows=rows,
            passed=all(bool(row[4]) for row in rows),
        )
    ]
