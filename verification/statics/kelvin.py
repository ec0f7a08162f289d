"""A force distributed over a smooth kernel, as for the tip of the needle."""

import numpy as np

from needlefem.checks import (
    Curve,
    Problem,
    ProblemResult,
    Quantity,
    Shape,
    convergence_study,
    elements_race,
    mapped_mesh,
)
from needlefem.elements import CATALOGUE, ElementType
from needlefem.fem import BoundaryValueProblem, StaticSolution
from needlefem.materials import Isotropic

RATIO, SIZE = 0.49, 0.1
SHEAR = 0.5 / (1.0 + RATIO)
FIRST = 1.0 / (2.0 * np.pi * SHEAR)
SECOND = FIRST / (4.0 * (1.0 - RATIO))
DROP = 0.5625504
"""u(0) - u(1, 0) in the direction of a unit force; Young's modulus is 1."""
HALF_WIDTH = 0.5
PLACES = {"node": (0.0, 0.0), "edge": (0.5, 0.0), "centre": (0.5, 0.5), "anywhere": (0.31, 0.17)}
"""Centre of the kernel, in element sizes from a node."""
LIMITS = {("P2", 2): 1e-2, ("P2", 4): 1e-3, ("Q2", 4): 1e-3}
"""Largest error under the force, by element and number of elements per kernel radius."""
WORST = {"P2": 1.4e-3, "Q2": 6e-4, "P2-P1": 1.4e-3, "Q2-Q1": 6e-4}
"""Largest error for any position, with four elements per kernel radius."""
LINEAR = 5e-2
"""Smallest error of linear elements with four elements per radius; too large for a needle."""


def displacement(points: np.ndarray) -> np.ndarray:
    """Return the exact displacement of a unit force along x at the origin (plane strain)."""
    square = np.sum(points**2, axis=1) + SIZE**2
    along = -0.5 * (FIRST - SECOND) * np.log(square) + 0.5 * FIRST * SIZE**2 / square
    found = SECOND * points[:, :1] * points / square[:, None]
    found[:, 0] += along
    return found


def blob(points: np.ndarray) -> np.ndarray:
    """Return the force per area, whose integral is 1."""
    square = np.sum(points**2, axis=1) + SIZE**2
    density = 2.0 * SIZE**4 / (np.pi * square**3)
    return np.stack([density, 0.0 * density], axis=1)


def solve(element: ElementType, fineness: int, place: tuple[float, float]) -> StaticSolution:
    """Solve a square with the exact displacement on its sides; `fineness` elements per radius."""
    count = round(2.0 * HALF_WIDTH / SIZE * fineness)
    offset = np.array(place) * 2.0 * HALF_WIDTH / count

    def square(points: np.ndarray) -> np.ndarray:
        return 2.0 * HALF_WIDTH * points - HALF_WIDTH - offset

    mesh = mapped_mesh(element, (count, count), square)
    problem = BoundaryValueProblem(
        mesh, element, Isotropic(youngs_modulus=1.0, poissons_ratio=RATIO)
    )
    return problem.fix(None, displacement).apply_body_force(blob).solve()


def under_the_force(solved: StaticSolution) -> float:
    """Return the error of the displacement under the force, relative to its decrease over 1."""
    origin = np.zeros((1, 2))
    return float((solved.at(origin) - displacement(origin))[0, 0] / DROP)


def run(quick: bool) -> ProblemResult:
    """Compare the displacement under the force for several positions in an element."""
    answers: list[Quantity] = []
    curves: list[Curve] = []
    shapes: list[Shape] = []
    ends = displacement(np.array([[0.0, 0.0], [1.0, 0.0]]))[:, 0]
    answers.append(
        Quantity(label="u(0) - u(1, 0)", value=float(ends[0] - ends[1]), reference=DROP,
               tolerance=1e-7)
    )  # fmt: skip
    levels = (1, 2) if quick else (1, 2, 4)
    for name, element in CATALOGUE.items():
        found, finest = convergence_study(
            name, levels, lambda n, e=element: solve(e, n, PLACES["anywhere"]),
            lambda s: {"under the force": abs(under_the_force(s))},
        )  # fmt: skip
        curves.append(found["under the force"])
        if name == "Q2":
            shapes.append(Shape(title="Q2", solution=finest, magnified=0.1))
        for level, error in zip(levels, found["under the force"].errors, strict=True):
            label = f"{name}, {level} elements a radius"
            if (name, level) in LIMITS:
                limit = LIMITS[name, level]
                answers.append(Quantity(label=f"{label}: error", value=error, tolerance=limit))
            if level == 4 and name in WORST:
                answers.append(
                    Quantity(label=f"{label}: worst place", value=worst_place(element, level),
                           tolerance=WORST[name])
                )  # fmt: skip
            if level == 4 and name == "P1":
                answers.append(
                    Quantity(label=f"{label}: fails", value=error, reference=LINEAR, at_least=True)
                )
    return ProblemResult(quantities=answers, curves=curves, shapes=shapes)


def worst_place(element: ElementType, level: int) -> float:
    """Return the largest error of all positions in an element."""
    return max(abs(under_the_force(solve(element, level, place))) for place in PLACES.values())


RACES = [
    elements_race(
        title=f"spread force, nu {RATIO:g}",
        quantity="displacement under it",
        ratio=RATIO,
        solve=lambda element, level: solve(element, level, PLACES["anywhere"]),
        measure=lambda s: (s.free, abs(under_the_force(s))),
        levels=(1, 2, 4, 8),
    )
]
PROBLEM = Problem(
    name="spread force",
    requirement="The displacement under a force that is distributed over a smooth kernel converges "
    "for all positions of the kernel in an element.",
    reference="exact, plane strain; Lord Kelvin 1848, regularised by R. Cortez 2001",
    tolerance_rationale="1 % with two quadratic elements per radius, 0.1 % with four, 0.14 % at "
    "the worst position: the rule for the elements along a needle",
    run=run,
    races=RACES,
)
