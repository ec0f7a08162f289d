"""Cook's membrane, a tapered panel under shear, and locking of elements."""

import dataclasses

import numpy as np

from needlefem.checks import (
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

CORNER, MIDDLE = np.array([[48.0, 60.0]]), np.array([[48.0, 52.0]])


@dataclasses.dataclass(frozen=True)
class Case:
    """Plane state, constants, total shear force, and results on graded meshes of degree 4."""

    plane: str
    modulus: float
    ratio: float
    force: float
    corner: tuple[float, float]
    middle: float
    work: float


CASES = (
    Case("stress", 1.0, 1 / 3, 1.0, (-18.9229, 25.1893), 23.9677, 24.0415),
    Case("stress", 70.0, 1 / 3, 100.0, (-27.0327, 35.9848), 34.2396, 3434.51),
    Case("strain", 70.0, 1 / 3, 100.0, (-24.0304, 32.3006), 30.7494, 3084.31),
)
NEARLY_INCOMPRESSIBLE = (
    Case("strain", 1.0, 0.49, 1.0, (-14.2557, 19.6648), 18.7366, 18.7926),
    Case("strain", 240.565, 0.4999, 100.0, (-5.8420, 8.0760), 7.6951, 771.81),
    Case("strain", 1.0, 0.4999, 1.0, (-14.0537, 19.4280), 18.5117, 18.5670),
    Case("strain", 1.0, 0.49999, 1.0, (-14.0518, 19.4258), 18.5096, 18.5650),
)
RUBBER = Case("strain", 250.0, 0.4999, 100.0, (-5.6215, 7.7712), 7.4047, 742.68)

LOCKING = {
    "P1": (-73.2, -72.7, -70.9), "Q1": (-72.5, -70.3, -63.5), "P2": (-8.63, -3.48, -1.46),
    "Q2": (-6.10, -2.86, -1.36), "MINI": (-26.4, -10.8, -4.26), "Q1-Bbar": (-7.25, -2.84, -1.19),
    "P2-P1": (-2.73, -1.19, -0.55), "Q2-Q1": (-0.88, -0.39, -0.18),
}  # fmt: skip
"""Error of v at the corner in percent on 8, 16, 32 divisions, by an independent program."""
SHARE = 6e-4
"""Allowed relative difference of two programs: the last digit given, rounded."""
WITHIN = {"Q2-Q1": 8, "P2-P1": 32, "Q1-Bbar": 64}
"""Divisions for which the corner of the rubber case must be within 1 %."""


def place(square: np.ndarray) -> np.ndarray:
    """Map the unit square to the panel: clamped side first."""
    across, up = square.T
    return np.stack([48.0 * across, 44.0 * across + up * (44.0 - 28.0 * across)], axis=1)


def solve(element: ElementType, divisions: int, case: Case) -> StaticSolution:
    """Solve the panel with a clamped left side and a shear traction on the right side."""
    material = Isotropic(youngs_modulus=case.modulus, poissons_ratio=case.ratio)
    mesh = mapped_mesh(element, (divisions, divisions), place)
    problem = BoundaryValueProblem(mesh, element, material, case.plane)
    problem.fix(lambda x: x[:, 0] < 1e-9)
    shear = np.array([0.0, case.force / 16.0])
    problem.apply_traction(
        lambda x, _: np.broadcast_to(shear, x.shape), lambda x: x[:, 0] > 48.0 - 1e-9
    )
    return problem.solve()


def corner(solved: StaticSolution) -> float:
    """Return the upward displacement of the loaded corner."""
    return float(solved.at(CORNER)[0, 1])


def compare(name: str, divisions: int, case: Case) -> list[Quantity]:
    """Return displacements of corner and middle, and the work, as separate quantities."""
    solved = solve(CATALOGUE[name], divisions, case)
    work = 2.0 * float(solved.stiffness.energy(solved.u[:, None])[0])
    label = f"{name}, plane {case.plane}, E {case.modulus:g}, nu {case.ratio:.5g}"
    values = {
        "u(48, 60)": (float(solved.at(CORNER)[0, 0]), case.corner[0]),
        "v(48, 60)": (corner(solved), case.corner[1]),
        "v(48, 52)": (float(solved.at(MIDDLE)[0, 1]), case.middle),
        "work": (work, case.work),
    }
    return [
        Quantity(label=f"{label}: {what}", value=value, reference=reference, tolerance=1e-2)
        for what, (value, reference) in values.items()
    ]


def locking(quick: bool) -> ProblemResult:
    """Compare the errors of all elements near incompressibility with those of another program."""
    answers: list[Quantity] = []
    curves, shapes = [], []
    for name, expected in LOCKING.items():
        divisions = (8, 16) if quick else (8, 16, 32)
        found, finest = convergence_study(
            name,
            divisions,
            lambda n, e=CATALOGUE[name]: solve(e, n, RUBBER),
            lambda s: {"corner": abs(corner(s) / RUBBER.corner[1] - 1.0)},
        )
        curves.append(found["corner"])
        for count, error, percent in zip(divisions, found["corner"].errors, expected, strict=False):
            label = f"{name}, nu 0.4999, {count} divisions: error beside {percent:g} %"
            answers.append(
                Quantity(label=label, value=abs(error + percent / 100.0), tolerance=SHARE)
            )
        if name in ("P1", "P2-P1"):
            shapes.append(Shape(title=f"{name}, nu 0.4999", solution=finest))
    return ProblemResult(quantities=answers, curves=curves, shapes=shapes)


def run(quick: bool) -> ProblemResult:
    """Compare all cases, then all elements near incompressibility."""
    answers = [answer for case in CASES for answer in compare("Q2", 16, case)]
    if not quick:
        for case in (*NEARLY_INCOMPRESSIBLE, RUBBER):
            answers += compare("Q2-Q1", 32, case)
    for name, divisions in WITHIN.items():
        if divisions <= 16 or not quick:
            solved = solve(CATALOGUE[name], divisions, RUBBER)
            answers.append(
                Quantity(label=f"{name}, nu 0.4999, {solved.free} dofs: v(48, 60)",
                       value=corner(solved), reference=RUBBER.corner[1], tolerance=1e-2)
            )  # fmt: skip
    for name in ("P1", "Q1"):
        error = 1.0 - corner(solve(CATALOGUE[name], 16, RUBBER)) / RUBBER.corner[1]
        answers.append(
            Quantity(label=f"{name}, nu 0.4999: locks", value=error, reference=0.5, at_least=True)
        )
    found = locking(quick)
    return dataclasses.replace(found, quantities=[*answers, *found.quantities])


RACES = [
    elements_race(
        title=f"Cook, plane {case.plane}, nu {case.ratio:.4g}",
        quantity="displacement of the corner",
        ratio=0.0 if case.plane == "stress" else case.ratio,
        solve=lambda element, level, c=case: solve(element, level, c),
        measure=lambda s, c=case: (s.free, abs(corner(s) / c.corner[1] - 1.0)),
        levels=(4, 8, 16, 32, 64),
        target=1e-2,
    )
    for case in (CASES[0], RUBBER)
]
PROBLEM = Problem(
    name="Cook's membrane",
    requirement="The deflection of a tapered panel under shear is correct. Near incompressibility "
    "linear displacement elements lock; B-bar and mixed elements do not.",
    reference="R. D. Cook 1974; values on graded meshes of degree 4 (28,354 dofs), separately for "
    "corner (48, 60) and middle (48, 52) of the loaded side; errors of elements by another program",
    tolerance_rationale="1 %: the singularity at the clamped corner limits all elements to first "
    "order; two programs agree on the same grid to the last digit given",
    run=run,
    races=RACES,
)
