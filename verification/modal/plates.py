"""NAFEMS FV32, a tapered membrane, and a plane cantilever."""

import numpy as np

from needlefem.checks import Problem, ProblemResult, Quantity, mapped_mesh, tissue
from needlefem.dynamics import TissueSystem, modes
from needlefem.elements import CATALOGUE
from needlefem.materials import Isotropic

TAPERED = (44.61702, 130.0094, 162.6887, 245.9858, 379.717, 391.4042)
"""Hz, converged on graded meshes of degree 4; published values are up to 0.05 % higher."""
CLAMPED = (0.0100816, 0.0604791, 0.1572579, 0.1593019, 0.2894878, 0.441491)
COARSE = {
    ("Q2", 126): ((10, 1), 0.25), ("P2", 126): ((10, 1), 0.53), ("Q1", 1458): ((80, 8), 0.42),
    ("P1", 5474): ((160, 16), 0.70),
}  # fmt: skip
"""Grid of the cantilever by element and unknowns, and the error of the first frequency there by
another program, %."""
BEAM = (0.0101499, 0.0636081, 0.1781045)
"""Frequencies of bending modes 1, 2 and 4 by the theory of slender beams, clamped."""
FREE = (0.0624138, 0.1625689, 0.297027, 0.3140419)
"""Angular frequencies of the cantilever, clamped, and free after three zeros."""


def tapered(name: str, divisions: tuple[int, int]) -> np.ndarray:
    """Return the six lowest frequencies of FV32, Hz."""

    def place(square: np.ndarray) -> np.ndarray:
        across = 5.0 - 4.0 * square[:, 0]
        return np.stack([10.0 * square[:, 0], (square[:, 1] - 0.5) * across], axis=1)

    element = CATALOGUE[name]
    steel = Isotropic(youngs_modulus=200e9, poissons_ratio=0.3, density=8000.0)
    mesh = mapped_mesh(element, divisions, place)
    model = tissue(mesh, element, steel, lambda x: x[:, 0] < 1e-9, plane="stress")
    return modes(TissueSystem(model), 6)[0] / (2.0 * np.pi)


def cantilever(name: str, divisions: tuple[int, int], *, clamped: bool) -> np.ndarray:
    """Return the lowest frequencies of a beam of 10 by 1, 1/s."""

    def place(square: np.ndarray) -> np.ndarray:
        return square * np.array([10.0, 1.0])

    element = CATALOGUE[name]
    law = Isotropic(youngs_modulus=1.0, poissons_ratio=0.3, density=1.0)
    mesh = mapped_mesh(element, divisions, place)
    held = (lambda x: x[:, 0] < 1e-9) if clamped else None
    model = tissue(mesh, element, law, held, plane="stress")
    return modes(TissueSystem(model), 6 if clamped else 7)[0]


def compare(name: str, found: np.ndarray, exact: tuple[float, ...], bound: float) -> list[Quantity]:
    """Return one quantity per mode."""
    return [
        Quantity(label=f"{name}: mode {number}", value=float(value), reference=reference,
               tolerance=bound)
        for number, (value, reference) in enumerate(zip(found, exact, strict=True), 1)
    ]  # fmt: skip


def run(quick: bool) -> ProblemResult:
    """Compare frequencies of both bodies."""
    answers = compare("FV32, Q2, 1122 dofs", tapered("Q2", (16, 8)), TAPERED, 6e-4)
    answers += compare("FV32, Q1, 1122 dofs", tapered("Q1", (32, 16)), TAPERED, 1.2e-2)
    if not quick:
        answers += compare("FV32, P1, 4290 dofs", tapered("P1", (64, 32)), TAPERED, 6e-3)
    for (name, dofs), (divisions, percent) in COARSE.items():
        if quick and dofs > 126:
            continue
        first = float(cantilever(name, divisions, clamped=True)[0])
        label = f"cantilever, {name}, {dofs} dofs: mode 1"
        answers += [
            Quantity(label=label, value=first, reference=CLAMPED[0], tolerance=1e-2),
            Quantity(label=f"{label}, too high by, %", value=100.0 * (first / CLAMPED[0] - 1.0),
                   reference=percent, tolerance=2e-2),
        ]  # fmt: skip
    fine = cantilever("Q2", (40, 4), clamped=True)
    answers += compare("cantilever, Q2, 40 x 4", fine, CLAMPED, 2e-3)
    bending = fine[[0, 1, 3]]
    answers += [
        Quantity(label=f"slender beam, bending {number}: too high by", value=slender / value - 1.0,
               reference=least, at_least=True)
        for number, (slender, value, least) in enumerate(
            zip(BEAM, bending, (0.006, 0.05, 0.115), strict=True), 1)
    ]  # fmt: skip
    loose = cantilever("Q2", (40, 4), clamped=False)
    answers.append(
        Quantity(label="free beam: rigid motions, largest frequency squared",
               value=float(np.max(loose[:3] ** 2)), tolerance=1e-9, recorded=False)
    )  # fmt: skip
    answers += compare("free beam, Q2, 40 x 4", loose[3:], FREE, 2e-3)
    return ProblemResult(quantities=answers)


PROBLEM = Problem(
    name="plates in vibration",
    requirement="The frequencies of bodies with and without supports are correct; the frequencies "
    "of rigid motions are zero.",
    reference="NAFEMS FV32 and a plane cantilever, converged on graded meshes of degree 4; the "
    "theory of slender beams differs by 0.7 to 12 % here",
    tolerance_rationale="0.06 % (Q2), 1.2 % (Q1), 0.6 % (P1) with the stated unknowns; 1 % with "
    "126 (Q2)",
    run=run,
)
