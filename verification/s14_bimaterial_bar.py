"""S14: a bar of two materials, pressed without moving sideways."""

import numpy as np

from needlefem.checks.models import mapped_mesh
from needlefem.checks.problem import Answer, Findings, Problem
from needlefem.elements import CATALOGUE, ElementRow
from needlefem.fem.statics import Statics
from needlefem.materials import Isotropic

CONTRASTS = (1.0, 1e3, 1e6)
LENGTHS = (0.5, 0.5)
RATIO, STRESS = 0.3, 2.0


def end_displacement(element: ElementRow, contrast: float) -> tuple[float, float]:
    """Return the displacement of the pulled end, solved and exact."""
    mesh = mapped_mesh(element, (8, 4), lambda square: square)
    left = np.flatnonzero(mesh.p[0, mesh.t].mean(axis=0) < LENGTHS[0])
    right = np.setdiff1d(np.arange(mesh.nelements), left)
    laws = {
        "left": Isotropic(youngs_modulus=1.0, poissons_ratio=RATIO),
        "right": Isotropic(youngs_modulus=contrast, poissons_ratio=RATIO),
    }
    named = mesh.with_subdomains({"left": left, "right": right})
    problem = Statics(named, element, laws)
    problem.hold(lambda x: x[:, 0] < 1e-9, axes=[0])
    problem.hold(lambda x: np.abs(x[:, 1] - 0.5) > 0.5 - 1e-9, axes=[1])
    problem.push(lambda _, normals: STRESS * normals, lambda x: x[:, 0] > 1.0 - 1e-9)
    moved = float(problem.solve().at(np.array([[1.0, 0.5]]))[0, 0])
    moduli = [law.lame()[0] + 2.0 * law.lame()[1] for law in laws.values()]
    return moved, STRESS * sum(a / m for a, m in zip(LENGTHS, moduli, strict=True))


def run(quick: bool) -> Findings:
    """Compare the end's displacement at rising contrasts."""
    answers = []
    for name, element in CATALOGUE.items():
        for contrast in CONTRASTS:
            moved, exact = end_displacement(element, contrast)
            answers.append(
                Answer(label=f"{name}, contrast {contrast:.0e}", value=moved, reference=exact,
                       tolerance=1e-7)
            )  # fmt: skip
    return Findings(answers=answers)


PROBLEM = Problem(
    name="bar of two materials",
    requirement="An interface along the mesh costs no accuracy, whatever the contrast.",
    reference="exact, stress (L1 / M1 + L2 / M2) with M = lambda + 2 mu",
    why="round-off times the condition of the system, which grows with the contrast; pressures of "
    "mixed elements jump where materials meet",
    run=run,
)
