"""S3: an unsupported tissue has exactly three motions that cost nothing."""

from needlefem.checks.models import rectangle
from needlefem.checks.problem import Answer, Findings, Problem
from needlefem.checks.tissue import rigid_motion, zero_modes
from needlefem.elements import CATALOGUE
from needlefem.materials import Isotropic


def run(quick: bool) -> Findings:
    """Count zero eigenvalues of K, and measure the force that rigid motions cost."""
    answers = []
    for name, element in CATALOGUE.items():
        material = Isotropic(youngs_modulus=1.0, poissons_ratio=0.3)
        model = rectangle(element, material, 4)  # K itself knows of no supports
        modes = Answer(
            label=f"{name}: zero modes", value=zero_modes(model), reference=3.0, tolerance=0.0
        )
        force = Answer(
            label=f"{name}: force of rigid motions",
            value=rigid_motion(model).value,
            tolerance=1e-12,
            recorded=False,
        )
        answers += [modes, force]
    return Findings(answers=answers)


PROBLEM = Problem(
    name="null space",
    requirement="Two translations and one rotation cost no force, and nothing else.",
    reference="exact; linear elasticity is indifferent to infinitesimal rigid motions",
    why="a count is exact; forces are round-off",
    run=run,
)
