"""A stiff disc in a plate under tension; the stress in the disc is uniform."""

import dataclasses

import numpy as np

from needlefem.checks import (
    Curve,
    Problem,
    ProblemResult,
    Quantity,
    Shape,
    convergence_study,
    elements_race,
    joined,
    mapped_mesh,
    order_at_least,
)
from needlefem.elements import CATALOGUE, ElementType
from needlefem.fem import BoundaryValueProblem, StaticSolution
from needlefem.materials import Isotropic

HALF_WIDTH = 4.0
"""Size of the box in radii of the disc; the exact displacement is prescribed on its sides."""
COARSEST = {1: 4, 2: 2}
"""Cells along a side of the square inside the disc by degree; twice as many along a quarter."""


@dataclasses.dataclass(frozen=True)
class Case:
    """Young's moduli of plate and disc, Poisson's ratio of both, exact stresses in the disc."""

    plate: float
    disc: float
    ratio: float
    along: float
    across: float


CASES = {
    "nu 0.49": Case(15.0, 60.0, 0.49, 1.29816036, -0.28323499),
    "nu 0.3": Case(15.0, 60.0, 0.3, 1.31929047, -0.04656319),
    "rigid, nu 0.49": Case(15.0, 15e6, 0.49, 1.49076828, -0.47076830),
}
RUBBER = Case(15.0, 75.0, 0.4999, 1.33330226, -0.33314226)
LIMITS = {("Q2", 2): 1e-2, ("Q1", 4): 1e-2, ("Q2", 4): 1e-3}
"""Largest error of the mean stress by element and level."""


class Field:
    """The exact displacement by potentials (E. Goursat 1898), unit tension along x far away.

    Their coefficients follow from continuity of displacement and traction at the circle.
    """

    def __init__(self, case: Case) -> None:
        self.shear = [0.5 * modulus / (1.0 + case.ratio) for modulus in (case.plate, case.disc)]
        self.kappa = 3.0 - 4.0 * case.ratio
        z = np.exp(1j * np.linspace(0.1, 6.0, 40))
        jumps = []
        for unknown in (None, *range(5)):
            given = np.zeros(5) if unknown is None else np.eye(5)[unknown]
            outside, inside = (self._state(z, given, part, unknown is None) for part in (0, 1))
            jumps.append(np.concatenate([outside - inside]))
        rows = [np.concatenate([jump.real, jump.imag]) for jump in jumps]
        self.coefficients = np.linalg.lstsq(np.array(rows[1:]).T, -rows[0], rcond=None)[0]

    def _potentials(self, z: np.ndarray, c: np.ndarray, part: int, far: bool) -> tuple:
        """Return phi, phi' and psi outside (part 0) or inside (1) the disc."""
        if part == 1:
            return c[3] * z, c[3] + 0.0 * z, c[4] * z
        phi = 0.25 * far * z + c[0] / z
        return phi, 0.25 * far - c[0] / z**2, -0.5 * far * z + c[1] / z + c[2] / z**3

    def _state(self, z: np.ndarray, c: np.ndarray, part: int, far: bool) -> np.ndarray:
        phi, slope, psi = self._potentials(z, c, part, far)
        moved = (self.kappa * phi - z * np.conj(slope) - np.conj(psi)) / (2.0 * self.shear[part])
        pulled = phi + z * np.conj(slope) + np.conj(psi)
        return np.concatenate([moved * self.shear[0], pulled])

    def displacement(self, points: np.ndarray) -> np.ndarray:
        """Return the displacement at points (n, 2)."""
        z = points[:, 0] + 1j * points[:, 1]
        inside = np.abs(z) <= 1.0 + 1e-9
        safe = np.where(np.abs(z) > 0.5, z, 1.0)
        both = [
            self._state(at, self.coefficients, part, True)[: len(z)] / self.shear[0]
            for part, at in ((0, safe), (1, z))
        ]
        moved = np.where(inside, both[1], both[0])
        return np.stack([moved.real, moved.imag], axis=1)


def disc_mesh(element: ElementType, cells: int) -> object:
    """Return a quarter of the box: a square in the disc, a ring around it, the rest."""
    core = 0.5

    def square_edge(share: np.ndarray) -> np.ndarray:
        return np.clip(2.0 * np.stack([1.0 - share, share], axis=1), 0.0, 1.0)

    def circle(share: np.ndarray) -> np.ndarray:
        return np.stack([np.cos(0.5 * np.pi * share), np.sin(0.5 * np.pi * share)], axis=1)

    def ring(square: np.ndarray) -> np.ndarray:
        inner, outer = core * square_edge(square[:, 1]), circle(square[:, 1])
        return inner + square[:, :1] * (outer - inner)

    def rest(square: np.ndarray) -> np.ndarray:
        inner, outer = circle(square[:, 1]), HALF_WIDTH * square_edge(square[:, 1])
        return inner + (4.0 ** square[:, :1] - 1.0) / 3.0 * (outer - inner)

    parts = [
        mapped_mesh(element, (cells, cells), lambda square: core * square),
        mapped_mesh(element, (cells, 2 * cells), ring),
        mapped_mesh(element, (2 * cells, 2 * cells), rest),
    ]
    mesh = joined(parts)
    middles = mesh.p[:, mesh.t].mean(axis=1)
    disc = np.flatnonzero(np.linalg.norm(middles, axis=0) < 1.0)
    return mesh.with_subdomains(
        {"disc": disc, "plate": np.setdiff1d(np.arange(mesh.nelements), disc)}
    )


def solve(element: ElementType, level: int, case: Case) -> StaticSolution:
    """Prescribe the exact displacement on the outer sides; the inner sides are symmetry planes."""
    laws = {
        "plate": Isotropic(youngs_modulus=case.plate, poissons_ratio=case.ratio),
        "disc": Isotropic(youngs_modulus=case.disc, poissons_ratio=case.ratio),
    }
    problem = BoundaryValueProblem(
        disc_mesh(element, level * COARSEST[element.degree]), element, laws
    )
    problem.fix(lambda x: x[:, 0] < 1e-9, axes=[0]).fix(lambda x: x[:, 1] < 1e-9, axes=[1])
    problem.fix(lambda x: np.max(x, axis=1) > HALF_WIDTH - 1e-9, Field(case).displacement)
    return problem.solve()


def disc_stress(solved: StaticSolution) -> np.ndarray:
    """Return the mean Voigt stress in the disc."""
    rule, space = solved.space.element.stiffness_rule(), solved.space
    disc = space.mesh.subdomains["disc"]
    weight = space.basis.dx[disc]
    return np.einsum("cq,cqi->i", weight, solved.stress(rule[0].T)[disc]) / weight.sum()


def errors(solved: StaticSolution, case: Case) -> float:
    """Return the relative error of the mean stress in the disc along the tension."""
    return abs(float(disc_stress(solved)[0]) / case.along - 1.0)


def run(quick: bool) -> ProblemResult:
    """Compare the mean stress in the disc, and the displacement field."""
    answers: list[Quantity] = []
    curves: list[Curve] = []
    shapes: list[Shape] = []
    levels = (1, 2) if quick else (1, 2, 4)
    for (name, level), limit in LIMITS.items():
        for label, case in CASES.items():
            if level <= levels[-1] and not (name == "Q1" and case.disc > 1e6):
                error = errors(solve(CATALOGUE[name], level, case), case)
                what = f"{name}, level {level}, {label}: stress in the disc"
                answers.append(Quantity(label=what, value=error, tolerance=limit))
    for name in ("Q1-Bbar", "P2-P1", "Q2-Q1"):
        error = errors(solve(CATALOGUE[name], 2, RUBBER), RUBBER)
        label = f"{name}, level 2, nu 0.4999: stress in the disc"
        answers.append(Quantity(label=label, value=error, tolerance=1e-2))
    case = CASES["nu 0.49"]
    exact = Field(case).displacement
    for name, element in CATALOGUE.items():
        found, finest = convergence_study(
            name, levels, lambda n, e=element: solve(e, n, case),
            lambda s: {"L2": s.l2_error(exact)}, {"L2": 2.0},
        )  # fmt: skip
        curves.append(found["L2"])
        if not quick and element.poissons_ratio_limit >= case.ratio:
            answers.append(order_at_least(found["L2"], 0.2))
        if name == "P2-P1":
            shapes.append(Shape(title="P2-P1, nu 0.49", solution=finest, magnified=4.0))
    return ProblemResult(quantities=answers, curves=curves, shapes=shapes)


RACES = [
    elements_race(
        title=f"stiff disc, {name}",
        quantity="displacement, L2",
        ratio=case.ratio,
        solve=lambda element, level, c=case: solve(element, level, c),
        measure=lambda s, c=case: (s.free, s.l2_error(Field(c).displacement)),
        levels=(1, 2, 4, 8),
    )
    for name, case in CASES.items()
    if case.disc < 1e6
]
PROBLEM = Problem(
    name="inclusion",
    requirement="The strain in a disc of different stiffness is uniform, and the displacement "
    "inside and outside is correct.",
    reference="exact, plane strain; J. D. Eshelby 1957, outside by potentials of E. Goursat 1898 "
    "whose coefficients follow from continuity",
    tolerance_rationale="1 % with 880 displacements (Q2), 0.1 % with 3,552; a polygon approximates "
    "the circle, so that all elements are of second order",
    run=run,
    races=RACES,
)
