"""Lame's modes of a free square for any Poisson's ratio; locking and mass lumping."""

import numpy as np

from needlefem.checks import Problem, ProblemResult, Quantity, elements_race, square_mesh, tissue
from needlefem.dynamics import TissueSystem, modes
from needlefem.elements import CATALOGUE
from needlefem.fem import FunctionSpace
from needlefem.materials import Isotropic

EXACT = np.sqrt(2.0) * np.pi
"""First angular frequency on the unit square with mu = rho = 1."""
LIMITS = {
    ("P1", 64, 0.3): 7e-4, ("Q1", 32, 0.3): 9.5e-4, ("P2", 8, 0.3): 2.5e-4, ("Q2", 8, 0.3): 4e-5,
    ("P2", 32, 0.4999): 2e-4, ("Q1-Bbar", 32, 0.4999): 2e-3, ("P2-P1", 8, 0.4999): 1e-3,
    ("Q2-Q1", 8, 0.4999): 1e-4, ("MINI", 32, 0.4999): 5e-3,
}  # fmt: skip
"""Largest relative error by element, divisions and Poisson's ratio; the frequency of displacement
elements with consistent mass is never too low."""
LOCKED = {"P1": 0.071, "Q1": 0.071}
"""Relative error at nu 0.4999 on 64 divisions, by another program."""
LUMPED = {("P1", 0.3): 2.7e-4, ("Q1", 0.3): -1.8e-4, ("Q1", 0.49): 2.2e-3}
"""Relative error with row sums on 64 divisions, two digits by another program. Lumping decreases
frequencies, but they may still be too high."""
FINE = {1: 64, 2: 16}
"""Divisions by degree for orders of convergence."""


def frequency(
    name: str,
    divisions: int,
    ratio: float,
    near: float = 1.001,
    like: float = 0.97,
    *,
    number: int = 1,
    lumping: str | None = None,
) -> float:
    """Return the frequency of the mode that is similar to Lame's, over `number`, or NaN.

    `near` is the expected value in units of the exact one. `like` is the smallest accepted
    correlation with respect to mass, which is lower for a mode that is distorted by locking.
    `number` is the number of half waves along a side.
    """
    element = CATALOGUE[name]
    material = Isotropic(youngs_modulus=2.0 * (1.0 + ratio), poissons_ratio=ratio, density=1.0)
    model = tissue(square_mesh(element, divisions), element, material)
    system = TissueSystem(model, lumping=lumping)
    x, y = number * np.pi * model.nodes.T
    shape = model.dof_vector(np.stack([-np.cos(x) * np.sin(y), np.sin(x) * np.cos(y)], axis=1))[
        model.free_dofs
    ]
    shape /= np.sqrt(shape @ system.mass_times(shape))
    found, shapes = modes(system, 6, near=near * number * EXACT)
    alike = np.abs(shapes.T @ system.mass_times(shape))
    return float(found[np.argmax(alike)]) / number if alike.max() > like else np.nan


def unknowns(divisions: int, name: str) -> int:
    """Return the number of displacement unknowns of a square."""
    return FunctionSpace(square_mesh(CATALOGUE[name], divisions), CATALOGUE[name]).ndofs


def run(quick: bool) -> ProblemResult:
    """Compare Lame modes of elements at both ratios."""
    answers = []
    for (name, divisions, ratio), limit in LIMITS.items():
        if quick and divisions > 32:
            continue
        off = frequency(name, divisions, ratio) / EXACT - 1.0
        label = f"{name}, {divisions} divisions, nu {ratio}: frequency"
        answers.append(Quantity(label=label, value=EXACT * (1.0 + off), reference=EXACT,
                              tolerance=limit))  # fmt: skip
        if CATALOGUE[name].volume == "plain":
            below = max(0.0, -off)
            label = f"{name}, {divisions} divisions, nu {ratio}: below exact"
            answers.append(Quantity(label=label, value=below, tolerance=1e-12, recorded=False))
    return ProblemResult(
        quantities=answers if quick else [*answers, *locked_and_lumped(), *orders()]
    )


def locked_and_lumped() -> list[Quantity]:
    """Show locking of linear elements, and errors of lumped mass with both signs."""
    answers = []
    for name, expected in LOCKED.items():
        off = frequency(name, 64, 0.4999, near=1.07, like=0.9) / EXACT - 1.0
        label = f"{name}, 64 divisions, nu 0.4999: locks by"
        answers.append(Quantity(label=label, value=off, reference=expected, tolerance=2e-2))
    for (name, ratio), expected in LUMPED.items():
        off = frequency(name, 64, ratio, lumping="row-sum") / EXACT - 1.0
        label = f"{name}, row-sum mass, 64 divisions, nu {ratio}: off by"
        answers.append(Quantity(label=label, value=off, reference=expected, tolerance=3e-2))
    return answers


def orders() -> list[Quantity]:
    """Halve the cells; a mode with twice as many half waves has the same error."""
    answers = []
    for name in ("P1", "Q1", "P2", "Q2"):
        degree = CATALOGUE[name].degree
        fine = FINE[degree]
        coarse, error = (frequency(name, n, 0.3) / EXACT - 1.0 for n in (fine // 2, fine))
        second = frequency(name, fine, 0.3, number=2)
        answers += [
            Quantity(label=f"{name}: order", value=float(np.log2(coarse / error)),
                   reference=2.0 * degree, tolerance=0.1 / degree, recorded=False),
            Quantity(label=f"{name}, {fine} divisions: half of the second mode", value=second,
                   reference=EXACT, tolerance=4e-3 if degree == 1 else 3e-4),
        ]  # fmt: skip
    return answers


RACES = [
    elements_race(
        title=f"free vibration, nu {ratio:g}",
        quantity="frequency",
        ratio=ratio,
        solve=lambda e, n, nu=ratio: (n, e.name, frequency(e.name, n, nu, like=0.5)),
        measure=lambda found: (unknowns(*found[:2]), abs(found[2] / EXACT - 1.0)),
        levels=(4, 8, 16, 32),
    )
    for ratio in (0.3, 0.4999)
]
PROBLEM = Problem(
    name="Lame modes",
    requirement="A free square has a shear vibration whose frequency does not depend on Poisson's "
    "ratio; linear elements lock.",
    reference="exact, sqrt(2) pi c_s / L; G. Lame 1852",
    tolerance_rationale="errors of another program on the same grids (P1 0.067 %, Q1 0.090 %, P2 "
    "0.023 %, Q2 0.0037 %; 0.018 % for P2 at nu 0.4999; by row sums P1 0.027 %, Q1 -0.018 %, at "
    "nu 0.49 0.22 %); errors of elements that do not lock by their degree",
    run=run,
    races=RACES,
)
