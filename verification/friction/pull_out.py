"""Pull-out of a shaft: shear lag, and cycles with rigid sticking."""

import numpy as np

from needlefem.checks import Curve, EmbeddedShaft, Problem, ProblemResult, Quantity, tissue
from needlefem.contact import SlipWeakeningFriction
from needlefem.elements import CATALOGUE
from needlefem.materials import Isotropic
from needlefem.mesh import box

LENGTH, WIDTH, STRETCH = 0.1, 0.01, 50.0
"""Length of the bar, m, and its EA, N."""
LIMIT, STIFFNESS = 20.0, 4e4
"""Friction per length, N/m, and tangential penalty, N/m^2."""
RATE = np.sqrt(STIFFNESS / STRETCH)
LOADS = (0.5, 1.0, 1.5, 1.8, 1.95)


def needle(pieces: int, stiffness: float) -> EmbeddedShaft:
    """Return a needle in a bar that is fixed at the far end of the needle.

    In the frame of the needle, the fixed end of the bar is pulled.
    """
    mesh = box((0.0, 0.0), (WIDTH, LENGTH), (1, pieces), "quadrilateral")
    law = Isotropic(youngs_modulus=STRETCH / WIDTH, poissons_ratio=0.0)
    bar = tissue(mesh, CATALOGUE["Q1"], law, lambda at: at[:, 1] > LENGTH * (1.0 - 1e-9))
    ends = np.array([0.5 * WIDTH, 0.0]), np.array([0.5 * WIDTH, LENGTH])
    return EmbeddedShaft(
        bar, ends, pieces, LIMIT, friction=SlipWeakeningFriction(stiffness=stiffness)
    )


def slip_length(load: float) -> float:
    """Return the slipping length under a load (by bisection of the closed form), m."""
    low, high = 0.0, LENGTH
    for _ in range(200):
        middle = 0.5 * (low + high)
        holds = LIMIT * middle + LIMIT / RATE * np.tanh(RATE * (LENGTH - middle))
        low, high = (middle, high) if holds < load else (low, middle)
    return 0.5 * (low + high)


def pulled(load: float) -> float:
    """Return the displacement of the loaded end, m."""
    if load <= LIMIT / RATE * np.tanh(RATE * LENGTH):
        return load / (STRETCH * RATE * np.tanh(RATE * LENGTH))
    slip = slip_length(load)
    stuck = LIMIT / RATE * np.tanh(RATE * (LENGTH - slip))
    return LIMIT / STIFFNESS + (0.5 * LIMIT * slip**2 + slip * stuck) / STRETCH


def shear_lag(pieces: int) -> list[Quantity]:
    """Compare force and slip front at the displacements of some loads."""
    answers = []
    shaft, reached = needle(pieces, STIFFNESS), 0.0
    for load in LOADS:
        wanted = pulled(load)
        for share in np.linspace(0.0, 1.0, 9)[1:]:
            force = shaft.move(reached + share * (wanted - reached))
        reached = wanted
        slides = np.count_nonzero(shaft.slipping) * LENGTH / pieces
        front = slip_length(load) if slides else 0.0
        answers += [
            Quantity(label=f"{pieces} pieces, load {load}", value=force, reference=load,
                   tolerance=2e-3 * (20 / pieces) ** 2),
            Quantity(label=f"{pieces} pieces, load {load}: slip front off, pieces",
                   value=abs(slides - front) * pieces / LENGTH, tolerance=1.0, recorded=False),
        ]  # fmt: skip
    return answers


def loop(pieces: int) -> list[Quantity]:
    """Load, unload and reload with rigid sticking."""
    shaft, most = needle(pieces, 0.0), 1.5
    far, label = most**2 / (2.0 * STRETCH * LIMIT), f"rigid, {pieces} pieces"
    closed = (("loading", far, most, most**3 / (6.0 * STRETCH * LIMIT)),
              ("unloading", 0.5 * far, 0.0, most**3 / (24.0 * STRETCH * LIMIT)),
              ("reloading", far, most, most**3 / (24.0 * STRETCH * LIMIT)))  # fmt: skip
    piece = 2.0 * LIMIT / most * LENGTH / pieces  # segment length relative to the reverse slip
    answers = []
    for name, goal, load, lost in closed:
        start, old = shaft.travel, shaft.dissipated
        for share in np.linspace(0.0, 1.0, 161)[1:]:
            force = shaft.move(start + share * (goal - start))
        answers += [
            Quantity(label=f"{label}, {name}: force over the largest", value=force / most,
                   reference=load / most, tolerance=1e-2),
            Quantity(label=f"{label}, {name}: dissipated",
                   value=shaft.dissipated - old, reference=lost,
                   tolerance=piece),
        ]  # fmt: skip
    return answers


def run(quick: bool) -> ProblemResult:
    """Compare forces, slip fronts and dissipation with the closed forms."""
    counts = (10, 20) if quick else (10, 20, 40, 80)
    answers = [answer for pieces in counts for answer in shear_lag(pieces)]
    if quick:
        return ProblemResult(quantities=answers)
    errors = tuple(answer.distance for answer in answers if answer.label.endswith("load 0.5"))
    curve = Curve(element="Q1", quantity="force, all sticking", order=2.0,
                  sizes=tuple(LENGTH / n for n in counts), dofs=counts,
                  seconds=(0.0,) * len(counts), errors=errors)  # fmt: skip
    order = Quantity(
        label="order, all sticking", value=curve.observed, reference=2.0, tolerance=0.05
    )
    return ProblemResult(quantities=[*answers, order, *loop(160)], curves=[curve])


PROBLEM = Problem(
    name="shaft pull-out",
    requirement="Compliant sticking, slip fronts and hysteresis loops agree with shear lag theory.",
    reference="exact; shear lag (H. L. Cox 1952) with a constant friction limit",
    tolerance_rationale="a slip front moves by complete segments; the bar has an error of second "
    "order in the element size",
    run=run,
)
