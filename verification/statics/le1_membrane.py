"""NAFEMS LE1, an elliptic membrane under outward pressure."""

import numpy as np

from needlefem.checks import (
    Curve,
    Problem,
    ProblemResult,
    Quantity,
    Shape,
    convergence_study,
    for_bent_cells,
    mapped_mesh,
)
from needlefem.elements import CATALOGUE, ElementType
from needlefem.fem import BoundaryValueProblem, StaticSolution
from needlefem.materials import Isotropic

INNER, OUTER = np.array([2.0, 1.0]), np.array([3.25, 2.75])
"""Half axes of the ellipses, m."""
PRESSURE, MODULUS, RATIO = 10.0, 210e3, 0.3
"""MPa, outwards on the outer ellipse."""
POINT_D = np.array([2.0, 0.0])
HOOP = 92.657
"""sigma_yy at D, MPa: converged (quadratic elements to 263,682 dofs, extrapolated)."""
LIMITS = {
    ("Q2", 2): 1e-2, ("Q2-Q1", 2): 1e-2, ("Q1", 8): 1e-2, ("Q1-Bbar", 8): 1e-2,
    ("Q2", 8): 2e-3, ("Q2-Q1", 8): 2e-3, ("P2", 8): 5e-3, ("P2-P1", 8): 5e-3, ("P1", 8): 5e-2,
}  # fmt: skip
"""Largest error of the direct stress at D by element and level."""
COARSEST = {1: (8, 16), 2: (4, 8)}
"""Cells between the ellipses and along them by degree: level 2 has 1,122 displacements for degree
2, fixed ones included; its edges are curved and follow the ellipses."""


def place(square: np.ndarray) -> np.ndarray:
    """Map the unit square to the quarter between the ellipses."""
    angle = 0.5 * np.pi * square[:, 1]
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return (INNER + square[:, :1] * (OUTER - INNER)) * circle


def pull(points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return the pressure with the normal of the ellipse instead of the chord."""
    away = points / OUTER**2
    return PRESSURE * away / np.linalg.norm(away, axis=1)[:, None] + 0.0 * normals


def solve(element: ElementType, level: int) -> StaticSolution:
    """Solve with the pressure on the outer ellipse; the straight sides are symmetry planes."""
    across, along = COARSEST[element.degree]
    bent = element.degree > 1
    mesh = mapped_mesh(element, (level * across, level * along), place, bent=bent)
    element = for_bent_cells(element) if bent else element
    material = Isotropic(youngs_modulus=MODULUS, poissons_ratio=RATIO)
    problem = BoundaryValueProblem(mesh, element, material, "stress")
    problem.fix(lambda x: x[:, 1] < 1e-9, axes=[1]).fix(lambda x: x[:, 0] < 1e-9, axes=[0])
    outside = 0.9
    problem.apply_traction(
        pull,
        lambda x: (np.sum((x / OUTER) ** 2, axis=1) > outside) & (np.min(x, axis=1) > 1e-9),
    )
    return problem.solve()


def hoop(solved: StaticSolution) -> float:
    """Return the direct stress at D, averaged over the adjacent cells."""
    return float(solved.vertex_stress(POINT_D)[1])


def run(quick: bool) -> ProblemResult:
    """Compare the stress at D on finer meshes."""
    answers: list[Quantity] = []
    curves: list[Curve] = []
    shapes: list[Shape] = []
    levels = (1, 2) if quick else (1, 2, 4, 8)
    for name, element in CATALOGUE.items():
        found, finest = convergence_study(
            name, levels, lambda n, e=element: solve(e, n),
            lambda s: {"stress at D": abs(hoop(s) / HOOP - 1.0)},
        )  # fmt: skip
        curve = found["stress at D"]
        curves.append(curve)
        for level, dofs, error in zip(levels, curve.dofs, curve.errors, strict=True):
            if (name, level) in LIMITS:
                label = f"{name}, {dofs} dofs: stress at D, relative error"
                answers.append(Quantity(label=label, value=error, tolerance=LIMITS[name, level]))
        if name == "Q2":
            shapes.append(Shape(title="Q2", solution=finest, magnified=1e3))
    return ProblemResult(quantities=answers, curves=curves, shapes=shapes)


PROBLEM = Problem(
    name="NAFEMS LE1",
    requirement="The largest stress at an elliptic hole is correct.",
    reference="92.657 MPa, converged; NAFEMS LE1 (1990) publishes 92.7",
    tolerance_rationale="1 % with 1,122 displacements (Q2), 0.2 % on the finest mesh; the stress "
    "is evaluated at a vertex in the region of the steepest gradient, without smoothing",
    run=run,
)
