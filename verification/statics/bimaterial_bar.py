"""A bar of two materials under compression without lateral displacement."""

from needlefem.checks import Problem, ProblemResult, Quantity, two_material_bar
from needlefem.elements import CATALOGUE

CONTRASTS = (1.0, 1e3, 1e6)


def run(quick: bool) -> ProblemResult:
    """Compare the displacement of the end for increasing contrasts."""
    answers = []
    for name, element in CATALOGUE.items():
        for contrast in CONTRASTS:
            moved, exact = two_material_bar(element, contrast)
            answers.append(
                Quantity(label=f"{name}, contrast {contrast:.0e}", value=moved, reference=exact,
                       tolerance=1e-7)
            )  # fmt: skip
    return ProblemResult(quantities=answers)


PROBLEM = Problem(
    name="bar of two materials",
    requirement="An interface along mesh edges does not reduce the accuracy for any contrast.",
    reference="exact, stress (L1 / M1 + L2 / M2) with M = lambda + 2 mu",
    tolerance_rationale="round-off times the condition number of the system, which increases with "
    "the contrast; the pressure of mixed elements is discontinuous at the interface",
    run=run,
)
