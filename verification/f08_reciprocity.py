"""F8: Betti's theorem, and answers that don't depend on the frame."""

import numpy as np

from needlefem.checks.models import rectangle
from needlefem.checks.problem import Answer, Findings, Problem
from needlefem.checks.tissue import reciprocity
from needlefem.elements import CATALOGUE
from needlefem.insertion.simulation import Simulation
from needlefem.materials import Isotropic
from needlefem.scene import BoxMesh, Discretisation, Motion, Needle, Scene, Support


def square(shift: float, mirrored: bool) -> Scene:
    """Return a square of crossed triangles that is its own mirror image, shifted sideways."""
    entry = 0.028 if not mirrored else 0.06 - 0.028
    return Scene(
        title="frame",
        axes=("y", "z"),
        mesh=BoxMesh(size=(0.06, 0.06), origin=(shift, 0.0), divisions=(16, 16), pattern="crossed"),
        materials={"gel": Isotropic(youngs_modulus=30e3, poissons_ratio=0.45)},
        background="gel",
        regions={},
        supports={"walls": Support(faces=("y_min", "y_max", "z_max"))},
        discretisation=Discretisation(element="P2"),
        needle=Needle(tip_radius=2e-3, cutting_force=50.0, shaft_friction=10e3),
        motion=Motion(direction=(0.0, 1.0), entry=(shift + entry, 0.0), max_depth=0.03),
    )


def path(shift: float, mirrored: bool) -> np.ndarray:
    """Return the cut path in coordinates of the unshifted, unmirrored square."""
    simulation = Simulation(square(shift, mirrored))
    tips = simulation.insert(simulation.entry_of_case()).tips - np.array([shift, 0.0])
    return np.column_stack([0.06 - tips[:, 0], tips[:, 1]]) if mirrored else tips


def run(quick: bool) -> Findings:
    """Compare responses both ways round, and paths in shifted and mirrored frames."""
    answers = []
    for name, element in CATALOGUE.items():
        for ratio in (0.3, 0.4999):
            model = rectangle(element, Isotropic(youngs_modulus=1.0, poissons_ratio=ratio), 12)
            label = f"{name}, nu {ratio}: responses apart"
            value = reciprocity(model).value
            answers.append(Answer(label=label, value=value, tolerance=1e-9, recorded=False))
    plain = path(0.0, mirrored=False)
    for label, other in (
        ("shifted", path(0.02, mirrored=False)),
        ("mirrored", path(0.0, mirrored=True)),
    ):
        apart = float(np.max(np.abs(other - plain)) / 0.06)
        answers.append(
            Answer(label=f"path {label}: moved", value=apart, tolerance=1e-9, recorded=False)
        )
    return Findings(answers=answers)


PROBLEM = Problem(
    name="reciprocity and frames",
    requirement="Responses are symmetric; answers move with a shifted or mirrored scene.",
    reference="exact; E. Betti 1872",
    why="round-off times the condition of the system",
    run=run,
)
