"""A cantilever with a parabolic shear traction at its end; exact solution of S. P. Timoshenko."""

import numpy as np

from needlefem.checks import (
    Curve,
    Problem,
    ProblemResult,
    Quantity,
    Shape,
    convergence_study,
    mapped_mesh,
    order_at_least,
)
from needlefem.elements import CATALOGUE, ElementType
from needlefem.fem import BoundaryValueProblem, StaticSolution
from needlefem.materials import Isotropic

FORCE, LENGTH, DEPTH, MODULUS, RATIO = 1.0, 8.0, 2.0, 1000.0, 0.3
INERTIA = DEPTH**3 / 12.0
TIP = 0.267
"""Exact deflection at the middle of the end; the theory of slender beams gives 0.256."""
LIMITS = {("Q2", 1): 1e-3, ("P2", 2): 1e-3, ("Q1", 4): 1e-2}
"""Largest relative error of the deflection by element and level: 54, 170 and 594 displacements,
fixed ones included."""
COARSEST = {1: (8, 2), 2: (4, 1)}
"""Cells along the beam and across it by degree."""


def displacement(points: np.ndarray) -> np.ndarray:
    """Return the exact displacement in plane stress; x from the root, y from the middle line."""
    x, y = points.T
    factor = FORCE / (6.0 * MODULUS * INERTIA)
    along = -y * ((6.0 * LENGTH - 3.0 * x) * x + (2.0 + RATIO) * (y**2 - DEPTH**2 / 4.0))
    across = 3.0 * RATIO * y**2 * (LENGTH - x) + (3.0 * LENGTH - x) * x**2
    across = across + (4.0 + 5.0 * RATIO) * DEPTH**2 * x / 4.0
    return factor * np.stack([along, across], axis=1)


def gradient(points: np.ndarray) -> np.ndarray:
    """Return the displacement's gradient, shape (n, 2, 2)."""
    x, y = points.T
    factor = FORCE / (6.0 * MODULUS * INERTIA)
    quarter = DEPTH**2 / 4.0
    along_x = -y * (6.0 * LENGTH - 6.0 * x)
    along_y = -((6.0 * LENGTH - 3.0 * x) * x) - (2.0 + RATIO) * (3.0 * y**2 - quarter)
    across_x = -3.0 * RATIO * y**2 + 6.0 * LENGTH * x - 3.0 * x**2 + (4.0 + 5.0 * RATIO) * quarter
    across_y = 6.0 * RATIO * y * (LENGTH - x)
    return factor * np.moveaxis(np.array([[along_x, along_y], [across_x, across_y]]), 2, 0)


def shear(points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return the parabolic traction on the end."""
    across = FORCE / (2.0 * INERTIA) * (DEPTH**2 / 4.0 - points[:, 1] ** 2)
    return np.stack([0.0 * across, normals[:, 0] * across], axis=1)


def solve(element: ElementType, level: int) -> StaticSolution:
    """Prescribe the exact displacement at the root and the shear at the end."""
    along, across = COARSEST[element.degree]

    def place(square: np.ndarray) -> np.ndarray:
        return np.array([LENGTH, DEPTH]) * square - np.array([0.0, 0.5 * DEPTH])

    mesh = mapped_mesh(element, (level * along, level * across), place)
    material = Isotropic(youngs_modulus=MODULUS, poissons_ratio=RATIO)
    problem = BoundaryValueProblem(mesh, element, material, "stress")
    problem.fix(lambda x: x[:, 0] < 1e-9, displacement)
    problem.apply_traction(shear, lambda x: x[:, 0] > LENGTH - 1e-9)
    return problem.solve()


def deflection_error(solved: StaticSolution) -> float:
    """Return the relative error of the end's deflection."""
    return abs(float(solved.at(np.array([[LENGTH, 0.0]]))[0, 1]) / TIP - 1.0)


def run(quick: bool) -> ProblemResult:
    """Refine the mesh for all elements."""
    answers: list[Quantity] = []
    curves: list[Curve] = []
    shapes: list[Shape] = []
    levels = (1, 2, 4) if quick else (1, 2, 4, 8, 16)
    for name, element in CATALOGUE.items():
        found, finest = convergence_study(
            name, levels, lambda n, e=element: solve(e, n),
            lambda s: {"deflection": deflection_error(s), "L2": s.l2_error(displacement),
                       "H1": s.h1_error(gradient)},
            {"L2": element.degree + 1.0, "H1": float(element.degree)},
        )  # fmt: skip
        curves += found.values()
        errors = found["deflection"].errors
        for level, error in zip(levels, errors, strict=True):
            if (name, level) in LIMITS:
                label = f"{name}, level {level}: deflection, relative error"
                answers.append(Quantity(label=label, value=error, tolerance=LIMITS[name, level]))
        if not quick:
            answers += [order_at_least(found["L2"]), order_at_least(found["H1"])]
        if name == "Q2":
            shapes.append(Shape(title="Q2", solution=finest, magnified=3.0))
    return ProblemResult(quantities=answers, curves=curves, shapes=shapes)


PROBLEM = Problem(
    name="Timoshenko cantilever",
    requirement="A short cantilever deflects by bending and shear.",
    reference="exact, plane stress, exact data at both ends; S. P. Timoshenko, J. N. Goodier 1951",
    tolerance_rationale="0.1 % with 54 (Q2) and 170 (P2) displacements, 1 % with 594 (Q1); linear "
    "elements represent bending on fine meshes only, so that their first errors decrease faster "
    "than the theory predicts",
    run=run,
)
