"""S1: a constant strain is reproduced exactly on any mesh."""

import numpy as np

from needlefem.checks.problem import Answer, Problem
from needlefem.checks.tissue import patch_error
from needlefem.elements import CATALOGUE
from needlefem.fem.mesh import box
from needlefem.materials import Isotropic


def distorted(pattern: str) -> object:
    """Return 4 x 4 squares of triangles, inner vertices moved by up to 30 % of a square."""
    mesh = box((0.0, 0.0), (1.0, 1.0), (4, 4), pattern)
    inner = np.setdiff1d(np.arange(mesh.nvertices), mesh.boundary_nodes())
    random = np.random.default_rng(1)
    points = mesh.p.copy()
    points[:, inner] += 0.3 * 0.25 * random.uniform(-1.0, 1.0, (2, len(inner)))
    return type(mesh)(points, mesh.t)


def run() -> list[Answer]:
    """Prescribe a linear field on the boundary; measure its error inside."""
    answers = []
    for name, element in CATALOGUE.items():
        for ratio, bound in ((0.3, 1e-12), (0.4999, 1e-11)):
            material = Isotropic(youngs_modulus=1.0, poissons_ratio=ratio)
            worst = max(
                patch_error(distorted(pattern), element, material)
                for pattern in ("diagonal", "crossed")
            )
            label = f"{name}, nu {ratio}: largest error"
            answers.append(Answer(label=label, value=worst, tolerance=bound, recorded=False))
    return answers


PROBLEM = Problem(
    name="patch",
    requirement="A linear displacement on the boundary gives the same linear displacement inside.",
    reference="exact; B. M. Irons, A. Razzaque 1972",
    why="round-off times the condition of the system, which grows as nu nears 1/2",
    run=run,
)
