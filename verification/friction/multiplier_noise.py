"""Contact forces along the shaft under refinement: no round-off noise."""

import numpy as np

from needlefem import simulate
from needlefem.checks import Problem, ProblemResult, Quantity
from needlefem.insertion import STICK_CONDITION, Simulation, State
from needlefem.scene import Scene, Stage, vary
from verification.support.organ_in_gel import SIZE, organ_in_gel

DEPTH, BACK = 0.03, 0.5e-3
"""Depth of the insertion and length of the following retraction, m."""
DIVISIONS = (15, 30, 60)
"""Number of squares along a side of the meshes."""


def scene(element: str, divisions: int, share: float) -> Scene:
    """Return an insertion with a short retraction, with segments of a share of an element."""
    stages = Stage(depth=DEPTH), Stage(depth=DEPTH - BACK)
    return organ_in_gel(
        element, divisions, share * SIZE / divisions, max_depth=DEPTH, stages=stages
    )


def roughness(forces: np.ndarray) -> float:
    """Return the alternating part of forces: 1 for noise from segment to segment."""
    return float(np.linalg.norm(np.diff(forces, 2)) / (4.0 * np.linalg.norm(forces)))


def of_shaft(state: State) -> tuple[np.ndarray, np.ndarray]:
    """Return lateral forces and friction forces of the complete segments."""
    return state.lateral_force[1 : state.full_segments, 0], state.friction_force[
        1 : state.full_segments
    ]


def halved(element: str, share: float, stiffness: float, counts: tuple[int, ...]) -> list[Quantity]:
    """Compare the roughness on the finest mesh with that on the coarsest."""
    rough = []
    for divisions in counts:
        changes = {"needle.tangential_penalty": stiffness}
        found = simulate(vary(scene(element, divisions, share), changes))
        deepest = found.states[int(np.argmax(found.depths))]
        forces = of_shaft(deepest)[0], of_shaft(found.states[-1])[1]
        rough.append([roughness(force) for force in forces])
    give = f", sticking of {stiffness:g} N/m^3" if stiffness else ""
    label = f"{element}, {counts[0]} to {counts[-1]} squares, pieces of {share:g} elements{give}"
    return [
        Quantity(label=f"{label}: roughness of {name}, finest over coarsest", value=fine / coarse,
               tolerance=1.0)
        for name, coarse, fine in zip(("lateral forces", "friction"), *rough[:: len(rough) - 1],
                                      strict=True)
    ]  # fmt: skip


def refused(element: str, share: float) -> Quantity:
    """Test that segments much shorter than the node distance do not stick rigidly."""
    simulation = Simulation(scene(element, 30, share))
    found = simulation.sticking(simulation.entry_of_case())
    regular = found.condition <= STICK_CONDITION and found.stiffness > 0.0
    return Quantity(label=f"{element}, pieces of {share:g} elements: condition over its bound",
                  value=min(found.rigid_condition / STICK_CONDITION, 1e6) if regular else 0.0,
                  reference=1.0, at_least=True, recorded=False)  # fmt: skip


def run(quick: bool) -> ProblemResult:
    """Refine elements and segments, and shorten the segments."""
    answers = [refused("P1", 0.125), refused("P2", 0.08)]
    if quick:
        return ProblemResult(quantities=answers)
    answers += halved("P1", 1.0, 0.0, DIVISIONS) + halved("P2", 1.0, 0.0, DIVISIONS)
    answers += halved("P1", 0.5, 1e9, DIVISIONS) + halved("P2", 0.5, 1e9, DIVISIONS)
    return ProblemResult(quantities=answers)


PROBLEM = Problem(
    name="shaft multipliers",
    requirement="The forces along the shaft do not become rougher when elements and segments are "
    "refined together. Segments that are too short for the mesh stick with a tangential penalty.",
    reference="property; a stable pair of displacement and contact forces",
    tolerance_rationale="noise increases with each refinement; the physical forces become smoother",
    run=run,
)
