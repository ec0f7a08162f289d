"""S8: the stress at a hole in plates of finite width, square and long."""

import numpy as np

from needlefem.checks import Problem, ProblemResult, Quantity, Shape, for_bent_cells, mapped_mesh
from needlefem.elements import CATALOGUE
from needlefem.fem import BoundaryValueProblem, StaticSolution
from needlefem.materials import Isotropic

STRIP = {0.1: 3.0361, 0.2: 3.1526, 0.25: 3.2480, 0.3: 3.3744, 0.4: 3.7472, 0.5: 4.3477, 0.6: 5.319}
SQUARE = {0.1: 3.086085, 0.2: 3.360116, 0.25: 3.583216, 0.3: 3.879742, 0.4: 4.78307, 0.5: 6.38870,
          0.6: 9.47982}  # fmt: skip
"""Stress at the hole relative to the remote stress, by diameter over width."""
LONG = 3.0
"""Length of a strip relative to its width; a longer strip gives the same results."""
GRADING = 8.0
"""Size of the outermost cells relative to the cells at the hole."""


def solve(name: str, share: float, length: float, cells: int) -> StaticSolution:
    """Solve a quarter of a plate of `length` widths under tension, with a hole of radius 1."""
    half = 1.0 / share
    corner = np.array([length * half, half])

    def place(square: np.ndarray) -> np.ndarray:
        angle = 0.5 * np.pi * square[:, 1]
        hole = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        edge = corner * np.clip(2.0 * np.stack([1.0 - square[:, 1], square[:, 1]], axis=1), 0, 1)
        return hole + (GRADING ** square[:, :1] - 1.0) / (GRADING - 1.0) * (edge - hole)

    element = CATALOGUE[name]
    mesh = mapped_mesh(element, (cells, 2 * cells), place, bent=True)
    material = Isotropic(youngs_modulus=1.0, poissons_ratio=0.3)
    problem = BoundaryValueProblem(mesh, for_bent_cells(element), material, "stress")
    problem.fix(lambda x: x[:, 1] < 1e-9, axes=[1]).fix(lambda x: x[:, 0] < 1e-9, axes=[0])
    return problem.apply_traction(lambda _, n: n, lambda x: x[:, 0] > corner[0] - 1e-9).solve()


def run(quick: bool) -> ProblemResult:
    """Compare all widths."""
    answers: list[Quantity] = []
    shapes: list[Shape] = []
    for kind, length, table in (("square", 1.0, SQUARE), ("strip", LONG, STRIP)):
        for share, reference in table.items():
            if quick and share not in (0.2, 0.5):
                continue
            solved = solve("Q2", share, length, 16)
            stress = float(solved.vertex_stress(np.array([0.0, 1.0]))[0])
            answers.append(
                Quantity(label=f"{kind}, d/W {share:g}", value=stress, reference=reference,
                       tolerance=1e-2)
            )  # fmt: skip
            if share == 0.5:
                shapes.append(Shape(title=f"{kind}, d/W 0.5", solution=solved, magnified=0.1))
    return ProblemResult(quantities=answers, shapes=shapes)


PROBLEM = Problem(
    name="hole in a plate",
    requirement="The stress concentration at a hole depends on the width and length of the plate.",
    reference="gross stress over remote stress; square plates by a Michell series with a boundary "
    "residual below 4e-5, strips by series and FEM; R. C. J. Howland 1930 for the strip",
    tolerance_rationale="1 % for a stress at a vertex without smoothing (Q2, 16 x 32 cells); the "
    "often used polynomial for strips is 0.8 % too low at d/W 0.5",
    run=run,
)
