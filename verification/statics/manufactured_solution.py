"""Manufactured solutions: order of convergence and size of the error."""

from needlefem.checks import (
    GENERAL,
    ISOCHORIC,
    Curve,
    Manufactured,
    Problem,
    ProblemResult,
    Quantity,
    convergence_study,
    distorted_mesh,
    order_answer,
)
from needlefem.elements import CATALOGUE, ElementType
from needlefem.fem import BoundaryValueProblem, StaticSolution
from needlefem.materials import Isotropic, plane_volumetric_split

FINEST = {1: 32, 2: 16}
"""Divisions of the finest mesh by degree, with equal numbers of unknowns."""
CEILING = {(1, "L2"): 4e-3, (1, "H1"): 6.5e-2, (2, "L2"): 2.2e-4, (2, "H1"): 6e-3}
"""Largest relative error on the finest mesh."""


def solve(
    element: ElementType, divisions: int, ratio: float, field: Manufactured
) -> StaticSolution:
    """Return the solution on a distorted square with prescribed boundary displacements."""
    material = Isotropic(youngs_modulus=1.0, poissons_ratio=ratio)
    problem = BoundaryValueProblem(distorted_mesh(element, divisions, 0.2), element, material)
    problem.fix(None, field.displacement)
    problem.apply_body_force(field.body_force(plane_volumetric_split(material, "strain").stiffness))
    return problem.solve()


def study(name: str, ratio: float, field: Manufactured, quick: bool) -> dict[str, Curve]:
    """Return the curves of both errors of an element."""
    element = CATALOGUE[name]
    fine = FINEST[element.degree]
    orders = {"L2": element.degree + 1.0, "H1": float(element.degree)}
    curves, _ = convergence_study(
        f"{name}, nu {ratio}",
        (fine // 2, fine) if quick else (fine // 4, fine // 2, fine),
        lambda n: solve(element, n, ratio, field),
        lambda s: {"L2": s.l2_error(field.displacement), "H1": s.h1_error(field.gradient)},
        orders,
    )
    return curves


def run(quick: bool) -> ProblemResult:
    """Refine at nu 0.3 with a general field, and at 0.4999 with a field of constant volume."""
    answers: list[Quantity] = []
    curves: list[Curve] = []
    for name, element in CATALOGUE.items():
        for ratio, field in ((0.3, GENERAL), (0.4999, ISOCHORIC)):
            found = study(name, ratio, field, quick)
            curves += found.values()
            if element.poissons_ratio_limit >= ratio:
                answers += [order_answer(curve) for curve in found.values()]
                answers += [
                    Quantity(label=f"{c.element}: error in {c.quantity}", value=c.errors[-1],
                           tolerance=CEILING[element.degree, c.quantity])
                    for c in found.values()
                ]  # fmt: skip
            elif element.degree == 1:
                c = found["L2"]
                answers.append(
                    Quantity(label=f"{c.element}: locks, error in L2", value=c.errors[-1],
                           reference=0.1, at_least=True)
                )  # fmt: skip
    return ProblemResult(quantities=answers, curves=curves)


PROBLEM = Problem(
    name="manufactured solutions",
    requirement="Displacement and strain converge with the order of the element's degree from a "
    "small error; near incompressibility too for elements made for it. Linear displacement "
    "elements lock there.",
    reference="exact under its own body force; P. J. Roache 2002",
    tolerance_rationale="orders within 0.15 on distorted meshes; the limits of errors are a third "
    "above the largest error of each degree, so that the error is tested as well as the order",
    run=run,
)
