"""Insertions with the tissue's inertia against those without, as the speed goes to zero.

Time stepping with inertia and damping must approach path following where no rupture occurs. The
difference at the lowest speed is due to the different contact segments of the two paths. After a
rupture inertia determines the point of arrest; with enough damping it must be that without inertia.
"""

from itertools import pairwise
from typing import Any

import numpy as np

from needlefem.insertion import Insertion, Simulation, TipTrajectory, energy_terms
from needlefem.scene import DYNAMIC, Rayleigh, Scene, Stage, vary
from needlefem.studies import Table

SPEEDS = (0.05, 0.02, 0.01, 0.005, 0.001)
TRAVEL = 1e-4
"""Travel of the needle in a time step, m."""
DAMPING = Rayleigh(mass_rate=5.0, stiffness_time=2e-3)
OVERDAMPED = Rayleigh(stiffness_time=0.05)
HARD = 5.0
BOUND = 1e-5
"""Largest difference of the material point at the tip at the paper's speed and below, m."""
SLOW = 0.005
"""The paper's speed, m/s."""
CYCLES, LEAK, GIVEN = 20, 1e-9, 1e-9
"""Cycles; largest energy residual, and largest energy gain in a step, over the absolute work."""
NEAR = 0.01
"""Largest relative difference of the force after the cycles from that without inertia."""


def study(scene: Scene, other: Scene | None = None) -> list[Table]:
    """Return differences by speed, positions after a rupture, and a long motion."""
    del other
    return [*(over_speed(scene, name) for name in DYNAMIC), landings(scene), at_length(scene)]


def moving(scene: Scene, integrator: str, speed: float, damping: Rayleigh) -> Scene:
    """Return the scene at a speed, in time steps with or without inertia."""
    changes = {
        "discretization.integrator": integrator,
        "discretization.time_step": TRAVEL / speed,
        "motion.speed": speed,
        "damping": damping,
    }
    return vary(scene, changes)


def inserted(scene: Scene, depth: float) -> Insertion:
    """Return the insertion up to a depth."""
    simulation = Simulation(scene)
    entry = simulation.entry_of_case()
    return simulation.insert(entry, lambda state: state.depth > depth)


def over_speed(scene: Scene, integrator: str) -> Table:
    """Return the difference of the material points at the tip, for each speed."""
    fine = vary(scene, {"discretization.path_spacing": 0.25 * scene.discretization.path_spacing})
    depth = 0.6 * scene.motion.max_depth
    path = TipTrajectory(inserted(fine, depth + 3e-3))
    rows: list[list[Any]] = []
    for speed in SPEEDS:
        found = inserted(moving(fine, integrator, speed, DAMPING), depth)
        apart = [
            float(np.linalg.norm(state.tip - reach.point))
            for state in found.states
            if state.depth > 0.5 * depth and (reach := path.at_depth(state.depth)) is not None
        ]
        energies = energy_terms(found)
        rows.append(
            [100.0 * speed, 100.0 * max(apart), energies.residual, energies.largest_energy_gain]
        )
    falls = all(a[1] >= b[1] for a, b in pairwise(rows))
    slow = all(row[1] <= 100.0 * BOUND for row in rows if row[0] <= 100.0 * SLOW)
    return Table(
        title=f"insertion with inertia ({integrator}) against path following",
        columns=("speed (cm/s)", "largest distance (cm)", "energy residual", "energy gain"),
        rows=rows,
        passed=falls and slow,
        note=f"over the second half of {100 * depth:.2g} cm; falls with the speed, and is at most "
        f"{100 * BOUND:g} cm from {100 * SLOW:g} cm/s down; energy gain: by contact in a step",
    )


def landings(scene: Scene) -> Table:
    """Return the rupture in tissue with a large cutting force and small friction."""
    needle = scene.needle
    changes = {
        "needle.cutting_force": HARD * needle.cutting_force,
        "needle.shaft_friction": needle.shaft_friction / HARD,
    }
    hard = vary(scene, changes)
    rows: list[list[Any]] = []
    kinds = {"without inertia": ("quasi_static", Rayleigh())} | {
        f"{name}, {kind}": (name, damping)
        for name in DYNAMIC
        for kind, damping in {"undamped": Rayleigh(), "overdamped": OVERDAMPED}.items()
    }
    for kind, (integrator, damping) in kinds.items():
        found = inserted(moving(hard, integrator, 0.1 * SLOW, damping), scene.motion.max_depth)
        energies, (jump, at) = energy_terms(found), leap(found)
        place = float(found.axis.axial_coordinate(found.states[-1].tip))
        rows.append([kind, str(found.outcome.status), 100.0 * at, 100.0 * jump, 100.0 * place,
                     energies.residual, energies.largest_energy_gain])  # fmt: skip
    return Table(
        title=f"cutting force times {HARD:g}, friction over it: the longest rupture",
        columns=(
            "tissue",
            "status",
            "depth (cm)",
            "rupture (cm)",
            "final tip (cm)",
            "energy residual",
            "energy gain",
        ),
        rows=rows,
        note=f"within {3e3 * TRAVEL:g} mm of depth; reported: inertia may determine the arrest",
    )


def leap(found: Insertion) -> tuple[float, float]:
    """Return the longest advance of the tip within three steps, and the depth of it, m."""
    along = np.array([float(found.axis.axial_coordinate(state.tip)) for state in found.states])
    later = np.searchsorted(found.depths, found.depths + 3.0 * TRAVEL, side="right") - 1
    ahead = along[later] - along
    return float(ahead.max()), float(found.depths[int(np.argmax(ahead))])


def at_length(scene: Scene) -> Table:
    """Return forces at rest and energies of insertion, cycles and retraction."""
    depth, back = 0.4 * scene.motion.max_depth, 0.3 * scene.motion.max_depth
    to_and_fro = (Stage(dwell=1.0), Stage(depth=back), Stage(dwell=1.0), Stage(depth=depth))
    stages = (Stage(depth=depth), *(CYCLES * to_and_fro), Stage(depth=0.0), Stage(dwell=5.0))
    spacing = scene.discretization.path_spacing
    changes = {
        "motion.stages": stages,
        "needle.static_friction_ratio": 1.5,
        "needle.slip_weakening_distance": spacing,
    }
    rows: list[list[Any]] = []
    for integrator in ("quasi_static", *DYNAMIC):
        moved = vary(moving(scene, integrator, SLOW, DAMPING), changes)
        moved = vary(moved, {"discretization.time_step": 0.5 * spacing / SLOW})
        simulation = Simulation(moved)
        found = simulation.move(simulation.entry_of_case())
        forces = [state.force for state in found.states if state.depth == depth]
        rows.append([integrator, len(found.states), str(found.outcome.status),
                     forces[len(forces) // 2], forces[-1], energy_terms(found).residual,
                     energy_terms(found).largest_energy_gain])  # fmt: skip
    return Table(
        title=f"{CYCLES} cycles with dwells, static over kinetic friction 1.5",
        columns=(
            "tissue",
            "steps",
            "status",
            "force, half of the cycles",
            "final force",
            "energy residual",
            "energy gain",
        ),
        rows=rows,
        passed=all(
            row[-2] <= LEAK and row[-1] <= GIVEN and abs(row[4] / rows[0][4] - 1.0) <= NEAR
            for row in rows
        ),
        note="forces (N/m) with the needle at its depth",
    )
