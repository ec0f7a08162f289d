"""Pure bending: exact for quadratic elements on any mesh, not for linear ones."""

from needlefem.checks import Problem, ProblemResult, Quantity, bending_error
from needlefem.elements import CATALOGUE
from needlefem.materials import Isotropic

BOUNDS = {0.3: 1e-13, 0.4999: 1e-12}
"""Largest error of quadratic elements by Poisson's ratio."""
LINEAR = 1e-3
"""Smallest error of linear elements, which have no curvature."""


def run(quick: bool) -> ProblemResult:
    """Prescribe pure bending on the boundary of a distorted mesh, in both plane states."""
    answers = []
    for name, element in CATALOGUE.items():
        for plane in ("strain", "stress"):
            for ratio, bound in BOUNDS.items():
                material = Isotropic(youngs_modulus=1.0, poissons_ratio=ratio)
                error = bending_error(element, material, plane)
                label = f"{name}, plane {plane}, nu {ratio}"
                if element.degree >= 2:
                    answer = Quantity(label=label, value=error, tolerance=bound, recorded=False)
                else:
                    label += ": fails"
                    answer = Quantity(label=label, value=error, reference=LINEAR, at_least=True)
                answers.append(answer)
    return ProblemResult(quantities=answers)


PROBLEM = Problem(
    name="bending patch",
    requirement="Quadratic elements represent a linear strain field exactly; linear elements do "
    "not.",
    reference="exact, u = x y, v = -(x^2 + b y^2) / 2; S. P. Timoshenko, J. N. Goodier 1951",
    tolerance_rationale="round-off times the condition number of the system; the error of linear "
    "elements is larger by orders of magnitude",
    run=run,
)
