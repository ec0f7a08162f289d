"""F7 and the ledger: a needle in a uniform layer."""

import numpy as np

from needlefem.checks.problem import Answer, Findings, Problem
from needlefem.insertion.ledger import ledger
from needlefem.insertion.simulation import Simulation
from needlefem.materials import Isotropic
from needlefem.scene import BoxMesh, Discretisation, Motion, Needle, Scene, Support


def layer(element: str) -> Scene:
    """Return a uniform square that a needle enters in its middle."""
    return Scene(
        title="uniform layer",
        axes=("y", "z"),
        mesh=BoxMesh(size=(0.06, 0.06), divisions=(20, 20)),
        materials={"gel": Isotropic(youngs_modulus=30e3, poissons_ratio=0.45)},
        background="gel",
        regions={},
        supports={"walls": Support(faces=("y_min", "y_max", "z_max"))},
        discretisation=Discretisation(element=element, path_spacing=1e-3),
        needle=Needle(tip_radius=2e-3, cutting_force=50.0, shaft_friction=10e3),
        motion=Motion(direction=(0.0, 1.0), entry=(0.0287, 0.0), max_depth=0.03),
    )


def run(quick: bool) -> Findings:
    """Compare the needle's force with cutting force plus friction times material path length."""
    answers = []
    for element in ("P1", "P2"):
        simulation = Simulation(layer(element))
        insertion = simulation.insert(simulation.entry_of_case())
        length = np.sum(np.linalg.norm(np.diff(insertion.tips, axis=0), axis=1))
        needle = simulation.scene.needle
        exact = needle.cutting_force + needle.shaft_friction * float(length)
        energies = ledger(insertion)
        rough = ledger(insertion, trapezoidal=True)
        answers += [
            Answer(label=f"{element}: force", value=insertion.states[-1].force, reference=exact,
                   tolerance=1e-10),
            Answer(label=f"{element}: strain identity", value=energies.identity, tolerance=1e-10,
                   recorded=False),
            Answer(label=f"{element}: ledger", value=energies.residual, tolerance=1e-6,
                   recorded=False),
            Answer(label=f"{element}: ledger, trapezoidal", value=rough.residual, tolerance=2e-2),
        ]  # fmt: skip
    return Findings(answers=answers)


PROBLEM = Problem(
    name="uniform layer",
    requirement="In a uniform layer the force is f_c + tau times the material path, and no energy "
    "is lost.",
    reference="exact; equilibrium of the needle, all shaft points slipping",
    why="round-off; the trapezoidal ledger has an error of second order in every step",
    run=run,
)
