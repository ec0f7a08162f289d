"""A uniform pressure on a strip of a half-plane (A. Flamant 1892, integrated)."""

import numpy as np

from needlefem.checks import (
    Curve,
    Problem,
    ProblemResult,
    Quantity,
    Shape,
    convergence_study,
    mapped_mesh,
)
from needlefem.elements import CATALOGUE, ElementType
from needlefem.fem import BoundaryValueProblem, StaticSolution
from needlefem.materials import Isotropic

RATIO, PRESSURE, HALF = 0.3, 1.0, 1.0
SHEAR, KAPPA = 0.5 / (1.0 + RATIO), 3.0 - 4.0 * RATIO
REACH = 4.0
"""Half width and depth of the mesh, in half widths of the strip."""
STRESSES = {0.5: (-0.959481, -0.450185), 1.0: (-0.818310, -0.181690), 2.0: (-0.549815, -0.040519)}
"""Lateral and vertical stress below the middle of the strip, by depth."""
COARSEST = {1: 16, 2: 8}
"""Number of cells across by degree; the number over the depth is half of it."""


def displacement(points: np.ndarray) -> np.ndarray:
    """Return the exact displacement (plane strain, Young's modulus 1); the tissue is y > 0.

    Potentials (E. Goursat 1898): ``phi' = i p / 2 pi ln((z - a) / (z + a))``, which is a real
    pressure on the strip and zero beside it, and ``psi = phi - z phi'``.
    """
    z = points[:, 0] + 1j * np.maximum(points[:, 1], 1e-14)
    left, right = z + HALF, z - HALF
    factor = 1j * PRESSURE / (2.0 * np.pi)
    phi = factor * (right * np.log(right) - left * np.log(left))
    slope = factor * (np.log(right) - np.log(left))
    moved = KAPPA * phi - np.conj(phi) - (z - np.conj(z)) * np.conj(slope)
    return np.stack([moved.real, moved.imag], axis=1) / (2.0 * SHEAR)


def solve(element: ElementType, level: int) -> StaticSolution:
    """Prescribe the exact displacement on three sides; fixed sides would cause an error."""
    across = level * COARSEST[element.degree]

    def place(square: np.ndarray) -> np.ndarray:
        return REACH * (square * np.array([2.0, 1.0]) - np.array([1.0, 0.0]))

    mesh = mapped_mesh(element, (across, across // 2), place)
    problem = BoundaryValueProblem(
        mesh, element, Isotropic(youngs_modulus=1.0, poissons_ratio=RATIO)
    )
    problem.fix(lambda x: (np.abs(x[:, 0]) > REACH - 1e-9) | (x[:, 1] > REACH - 1e-9), displacement)
    strip = np.array([0.0, PRESSURE])
    problem.apply_traction(
        lambda x, _: np.broadcast_to(strip, x.shape),
        lambda x: (x[:, 1] < 1e-9) & (np.abs(x[:, 0]) < HALF),
    )
    return problem.solve()


def run(quick: bool) -> ProblemResult:
    """Compare stresses under the strip and the displacement everywhere."""
    answers: list[Quantity] = []
    curves: list[Curve] = []
    shapes: list[Shape] = []
    levels = (1, 2) if quick else (1, 2, 4, 8)
    for name, element in CATALOGUE.items():
        found, finest = convergence_study(
            name, levels, lambda n, e=element: solve(e, n),
            lambda s: {"L2": s.l2_error(displacement)},
        )  # fmt: skip
        curves.append(found["L2"])
        if not quick:
            answers.append(
                Quantity(label=f"{name}: error in L2", value=found["L2"].errors[-1], tolerance=1e-3)
            )
            answers += stresses(name, finest, 5e-3)
        if name == "Q2":
            shapes.append(Shape(title="Q2", solution=finest, magnified=0.3))
    quickest = solve(CATALOGUE["Q2"], 2)
    answers += stresses("Q2, level 2", quickest, 3e-2)
    return ProblemResult(quantities=answers, curves=curves, shapes=shapes)


def stresses(name: str, solved: StaticSolution, bound: float) -> list[Quantity]:
    """Return the stresses below the middle of the strip, in units of the pressure."""
    answers = []
    for depth, (along, across) in STRESSES.items():
        found = solved.vertex_stress(np.array([0.0, depth]))
        off = max(abs(found[1] - along), abs(found[0] - across))
        label = f"{name}: stresses at depth {depth:g}"
        answers.append(Quantity(label=label, value=float(off), tolerance=bound))
    return answers


PROBLEM = Problem(
    name="strip on a half-plane",
    requirement="Stress and displacement under a pressure on a strip are those of the half-plane.",
    reference="exact, plane strain; A. Flamant 1892, potentials of E. Goursat 1898",
    tolerance_rationale="0.5 % of the pressure for stresses at a vertex, 3 % on the coarse mesh; "
    "0.1 % in displacement: the discontinuity of the pressure reduces the order of all elements",
    run=run,
)
