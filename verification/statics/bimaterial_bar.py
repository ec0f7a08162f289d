"""S14: a bar of two materials, pressed without moving sideways."""

from needlefem.checks import Problem, ProblemResult, Quantity, two_material_bar
from needlefem.elements import CATALOGUE

CONTRASTS = (1.0, 1e3, 1e6)


def run(quick: bool) -> ProblemResult:
    """Compare the end's displacement at rising contrasts."""
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
    requirement="An interface along the mesh costs no accuracy, whatever the contrast.",
    reference="exact, stress (L1 / M1 + L2 / M2) with M = lambda + 2 mu",
    tolerance_rationale="round-off times the condition of the system, which grows with the "
    "contrast; pressures of "
    "mixed elements jump where materials meet",
    run=run,
)
