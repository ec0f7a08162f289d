"""A shaft along a clamped strip: sticking, sliding, slip weakening, position in the elements."""

import numpy as np

from needlefem.checks import EmbeddedShaft, Problem, ProblemResult, Quantity, rectangle
from needlefem.contact import SlipWeakeningFriction
from needlefem.elements import CATALOGUE
from needlefem.materials import Isotropic
from needlefem.scene import Support

HALF, LENGTH, SHEAR, LIMIT = 0.03, 0.02, 5e3, 40.0
"""Half width and length of the strip, m; shear modulus, Pa; friction per length, N/m."""
GIVE = LIMIT * HALF / (2.0 * SHEAR)
"""Displacement of a shaft on the middle line under its full friction, m."""
SUPPORTS = {
    "walls": Support(faces=("y_min", "y_max")),
    "ends": Support(faces=("z_min", "z_max"), fixed=("y",)),
}


def strip(element: str, across: int, height: float, **shaft: object) -> EmbeddedShaft:
    """Return a needle along a strip with some elements across, at a distance from the middle."""
    row = CATALOGUE[element]
    law = Isotropic(youngs_modulus=2.6 * SHEAR, poissons_ratio=0.3)
    model = rectangle(row, law, across, (2.0 * HALF, LENGTH), SUPPORTS)
    at = HALF + height
    ends = np.array([at, 0.0]), np.array([at, LENGTH])
    return EmbeddedShaft(model, ends, across, LIMIT, **shaft)  # type: ignore[arg-type]


def stiffer(element: str, across: int, height: float) -> float:
    """Return the exact relative error of the compliance of a line inside elements."""
    size = 2.0 * HALF / across
    xi = (HALF + height) / size % 1.0
    s = xi * (1.0 - xi)
    shape = s - 3.0 * s**2 if CATALOGUE[element].degree == 2 else s
    return -2.0 * HALF * size * shape / (HALF**2 - height**2)


def gives(element: str, across: int, height: float, **shaft: object) -> float:
    """Return the displacement of the tissue relative to the closed form, minus one."""
    needle = strip(element, across, height, **shaft)
    force = needle.move(10.0 * GIVE)
    give = float(needle.moved.mean())
    exact = force / LENGTH * (HALF**2 - height**2) / (2.0 * HALF * SHEAR)
    return give / exact - 1.0


def sliding() -> list[Quantity]:
    """Test sticking, sliding and the energy balance."""
    needle, goal, work = strip("Q2", 8, 0.0), 2.5 * GIVE, 0.0
    stuck = needle.move(0.5 * GIVE)
    for travel in np.linspace(0.5 * GIVE, goal, 41)[1:]:
        before, force = needle.pull.sum(), needle.move(float(travel))
        work += 0.5 * (before + force) * (goal - 0.5 * GIVE) / 40
    return [
        Quantity(label="sticking force", value=stuck, reference=0.5 * LIMIT * LENGTH,
               tolerance=1e-10),
        Quantity(label="plateau", value=force, reference=LIMIT * LENGTH, tolerance=1e-12),
        Quantity(label="stored", value=needle.strain_energy, reference=0.5 * LIMIT * GIVE * LENGTH,
               tolerance=1e-10),
        Quantity(label="dissipated", value=needle.dissipated,
               reference=LIMIT * LENGTH * (goal - GIVE), tolerance=1e-10),
    ]  # fmt: skip


def weakened(travel: float, ratio: float, length: float) -> float:
    """Return the exact force of a shaft after a monotonic pull, N/m, with linear slip weakening."""
    stiffness, top = LIMIT / GIVE, ratio * LIMIT
    fall = (top - LIMIT) / length
    force = stiffness * travel
    if force <= top:
        return force
    slip = (force - top) / (stiffness - fall) if stiffness > fall else np.inf
    return top - fall * slip if slip <= length else LIMIT


def weakening() -> list[Quantity]:
    """Test slip weakening with a ratio of 1.5, gradual and sudden."""
    answers = []
    for name, length in (("gentle", 2.0 * GIVE), ("sudden", 0.2 * GIVE)):
        needle = strip("Q2", 8, 0.0, friction=SlipWeakeningFriction(ratio=1.5, length=length))
        travel, back = np.linspace(0.0, 4.0, 33)[1:] * GIVE, 0.0
        forces = np.array([needle.move(float(at)) for at in travel]) / LENGTH
        exact = np.array([weakened(float(at), 1.5, length) for at in travel])
        apart = float(np.max(np.abs(forces - exact))) / LIMIT
        answers.append(
            Quantity(label=f"{name} weakening: force off", value=apart, tolerance=1e-9,
                   recorded=False)
        )  # fmt: skip
        back = needle.travel - 1.1 * GIVE - needle.pull.sum() / LENGTH * GIVE / LIMIT
        healed = needle.move(float(back))
        answers.append(
            Quantity(label=f"{name} weakening: force after turning back", value=healed / LENGTH,
                   reference=-1.1 * LIMIT, tolerance=1e-9)
        )  # fmt: skip
    return answers


def run(quick: bool) -> ProblemResult:
    """Compare compliance, friction, energy, and the error of a line inside elements."""
    answers = sliding() + weakening()
    for element in ("P1", "P2", "Q1", "Q2"):
        label = f"{element}: give of a line on the mesh, off"
        answers.append(
            Quantity(label=label, value=gives(element, 8, 0.0), tolerance=1e-10, recorded=False)
        )
        if element.startswith("P"):
            continue  # an edge crosses the line obliquely: the closed form is for squares only
        for across in (9, 17) if quick else (9, 17, 33):
            for height in (0.0, 0.44 * 2.0 * HALF / across):
                label = f"{element}, {across} across, height {height / HALF:.4f}: give off"
                exact = stiffer(element, across, height)
                value = gives(element, across, height)
                answers.append(
                    Quantity(label=label, value=value, reference=exact, tolerance=1e-6)
                )  # fmt: skip
    return ProblemResult(quantities=answers)


PROBLEM = Problem(
    name="shaft in a strip",
    requirement="A shaft sticks, slides and weakens like an elastic slider. A line inside elements "
    "is too stiff by the amount of the theory.",
    reference="exact: shear between a line load and clamped walls; error of the elements",
    tolerance_rationale="round-off; the discrete solution is known exactly",
    run=run,
)
