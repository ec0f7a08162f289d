"""F11: forces along the shaft are forces, not noise, whatever the mesh."""

import numpy as np

from needlefem.checks.needle import sticking_pieces
from needlefem.checks.problem import Answer, Findings, Problem
from needlefem.contour import Contour
from needlefem.insertion.simulation import Simulation, simulate
from needlefem.insertion.state import State
from needlefem.materials import Isotropic
from needlefem.scene import (
    BoxMesh,
    Discretisation,
    Motion,
    Needle,
    Region,
    Scene,
    Stage,
    Support,
    vary,
)

TURN = 2.0 * np.pi * np.arange(48) / 48
ORGAN = np.array([0.036, 0.025]) + 0.012 * np.stack([np.cos(TURN), np.sin(TURN)], axis=1)
SIZE, DEPTH, BACK = 0.06, 0.03, 0.5e-3
DIVISIONS = (15, 30, 60)
"""Of the square's sides."""


def scene(element: str, divisions: int, share: float) -> Scene:
    """Return a needle that goes in and a little back, with pieces of a share of an element."""
    return Scene(
        title="multipliers",
        axes=("y", "z"),
        mesh=BoxMesh(size=(SIZE, SIZE), divisions=(divisions, divisions)),
        materials={
            "gel": Isotropic(youngs_modulus=30e3, poissons_ratio=0.45),
            "stiff": Isotropic(youngs_modulus=90e3, poissons_ratio=0.45),
        },
        background="gel",
        regions={"organ": Region(contour=Contour(ORGAN), material="stiff")},
        supports={"walls": Support(faces=("y_min", "y_max", "z_max"))},
        discretisation=Discretisation(element=element, path_spacing=share * SIZE / divisions),
        needle=Needle(tip_radius=3e-3, cutting_force=50.0, shaft_friction=10e3),
        motion=Motion(
            direction=(0.0, 1.0),
            entry=(0.0287, 0.0),
            max_depth=DEPTH,
            stages=(Stage(to=DEPTH), Stage(to=DEPTH - BACK)),
        ),
    )


def roughness(forces: np.ndarray) -> float:
    """Return the part of forces that alternates: 1 for noise from piece to piece."""
    return float(np.linalg.norm(np.diff(forces, 2)) / (4.0 * np.linalg.norm(forces)))


def of_shaft(state: State) -> tuple[np.ndarray, np.ndarray]:
    """Return lateral forces and friction of whole pieces."""
    return state.lateral[1 : state.whole, 0], state.axial[1 : state.whole]


def halved(element: str, share: float, stiffness: float, counts: tuple[int, ...]) -> list[Answer]:
    """Compare the roughness on the finest mesh with that on the coarsest."""
    rough = []
    for divisions in counts:
        changes = {"needle.stick_stiffness": stiffness}
        found = simulate(vary(scene(element, divisions, share), changes))
        deepest = found.states[int(np.argmax(found.depths))]
        forces = of_shaft(deepest)[0], of_shaft(found.states[-1])[1]
        rough.append([roughness(force) for force in forces])
    give = f", sticking of {stiffness:g} N/m^3" if stiffness else ""
    label = f"{element}, {counts[0]} to {counts[-1]} squares, pieces of {share:g} elements{give}"
    return [
        Answer(label=f"{label}: roughness of {name}, finest over coarsest", value=fine / coarse,
               tolerance=1.0)
        for name, coarse, fine in zip(("lateral forces", "friction"), *rough[:: len(rough) - 1],
                                      strict=True)
    ]  # fmt: skip


def refused(element: str, share: float) -> Answer:
    """Say that pieces much shorter than the distance of nodes are refused."""
    check = sticking_pieces(Simulation(scene(element, 30, share)))
    return Answer(label=f"{element}, pieces of {share:g} elements: condition over its bound",
                  value=min(check.value / check.bound, 1e6), reference=1.0, at_least=True,
                  recorded=False)  # fmt: skip


def run(quick: bool) -> Findings:
    """Halve, and shorten."""
    answers = [refused("P1", 0.125), refused("P2", 0.08)]
    if quick:
        return Findings(answers=answers)
    answers += halved("P1", 1.0, 0.0, DIVISIONS) + halved("P2", 1.0, 0.0, DIVISIONS)
    answers += halved("P1", 0.5, 1e9, DIVISIONS) + halved("P2", 0.5, 1e9, DIVISIONS)
    return Findings(answers=answers)


PROBLEM = Problem(
    name="shaft multipliers",
    requirement="Forces along the shaft grow no rougher when elements and pieces are halved "
    "together; pieces that would make them noise are refused.",
    reference="property; a stable pair of displacement and contact forces",
    why="noise grows with every halving; what is there in the tissue gets smoother",
    run=run,
)
