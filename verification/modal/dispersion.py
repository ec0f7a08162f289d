"""Dispersion of waves in a bar with consistent and lumped mass: closed forms."""

import numpy as np

from needlefem.checks import Problem, ProblemResult, Quantity, mapped_mesh
from needlefem.dynamics import TissueSystem, modes
from needlefem.elements import CATALOGUE
from needlefem.fem import TissueModel
from needlefem.materials import Isotropic
from needlefem.mesh import BACKGROUND, name_faces, name_regions
from needlefem.scene import Support

CELLS, THIN = 12, 0.01
"""Cells along the strip, and its width; only longitudinal vibrations have low frequencies."""
WIDE = 1e6
LAW = Isotropic(youngs_modulus=1.0, poissons_ratio=0.3, density=2.0)
LARGEST = {"consistent": 2.0 * np.sqrt(3.0), "lumped": 2.0}
"""Largest frequency of a bar in units of ``c / h``."""


def largest(lumping: str | None) -> float:
    """Return the largest frequency, in units of ``c / h``, of a strip with free ends.

    The strip is so wide that lateral vibrations have low frequencies.
    """
    mesh = mapped_mesh(CATALOGUE["Q1"], (CELLS, 1), lambda p: p * np.array([1.0, WIDE]))
    named = name_faces(name_regions(mesh, {}), ("y", "z"))
    supports = {"sides": Support(faces=("z_min", "z_max"), fixed=("z",))}
    axes = ("y", "z")
    model = TissueModel(named, CATALOGUE["Q1"], {BACKGROUND: LAW}, supports, axes, floating=True)
    return TissueSystem(model, lumping=lumping).largest_frequency / CELLS / sound()


def sound() -> float:
    """Return the speed of waves along the strip."""
    lam, mu = LAW.lame()
    return float(np.sqrt((lam + 2.0 * mu) / LAW.density))


def system(lumping: str | None) -> tuple[TissueSystem, float]:
    """Return a strip of one cell width between sliding walls, and its wave speed."""
    mesh = mapped_mesh(CATALOGUE["Q1"], (CELLS, 1), lambda p: p * np.array([1.0, THIN]))
    named = name_faces(name_regions(mesh, {}), ("y", "z"))
    supports = {
        "ends": Support(faces=("y_min", "y_max"), fixed=("y",)),
        "sides": Support(faces=("z_min", "z_max"), fixed=("z",)),
    }
    model = TissueModel(named, CATALOGUE["Q1"], {BACKGROUND: LAW}, supports, ("y", "z"))
    return TissueSystem(model, lumping=lumping), sound()


def run(quick: bool) -> ProblemResult:
    """Compare the lowest frequencies with the formulas."""
    answers = []
    h = 1.0 / CELLS
    turn = np.pi * np.arange(1, 6) * h
    formulas = {
        "consistent": (None, np.sqrt(6.0 * (1.0 - np.cos(turn)) / (2.0 + np.cos(turn)))),
        "lumped": ("row-sum", 2.0 * np.sin(0.5 * turn)),
    }
    for name, (lumping, exact) in formulas.items():
        strip, speed = system(lumping)
        found, _ = modes(strip, 5)
        for number, (value, reference) in enumerate(zip(found, exact * speed / h, strict=True), 1):
            answers.append(
                Quantity(label=f"{name} mass: mode {number}", value=float(value),
                       reference=float(reference), tolerance=1e-10)
            )  # fmt: skip
        answers.append(
            Quantity(label=f"{name} mass: largest frequency, h / c", value=largest(lumping),
                   reference=float(LARGEST[name]), tolerance=1e-10)
        )  # fmt: skip
    return ProblemResult(quantities=answers)


PROBLEM = Problem(
    name="dispersion of a bar",
    requirement="Wave speeds are too high with consistent mass and too low with lumped mass, each "
    "by its formula.",
    reference="exact for linear elements; R. D. Krieg, S. W. Key 1973",
    tolerance_rationale="round-off",
    run=run,
)
