"""Path following against time steps, without and with memory of the tissue."""

import numpy as np

from needlefem import simulate
from needlefem.checks import Curve, Problem, ProblemResult, Quantity
from needlefem.insertion import Insertion, Simulation, TipPhase, TipTrajectory
from needlefem.materials import Viscoelastic
from needlefem.scene import Scene, vary
from verification.support.organ_in_gel import MODULI, organ_in_gel

SPACINGS = (2.4e-3, 1.2e-3, 0.6e-3)


def scene(spacing: float) -> Scene:
    """Return an organ in gel and a needle that passes beside its centre."""
    plain = organ_in_gel("P2", 30, spacing, max_depth=0.03)
    return vary(plain, {"discretization.tip_quadrature_points": 200})


def in_depth(marched: Insertion, spacing: float, step: float) -> float:
    """Return the largest difference of quasi-static steps from path following at its depths, m."""
    changes = {"discretization.integrator": "quasi_static", "discretization.time_step": step}
    found = simulate(vary(scene(spacing), changes))
    return apart(found, marched.depths[2:-1], marched.tips[2:-1])


def apart(found: Insertion, depths: np.ndarray, tips: np.ndarray) -> float:
    """Return the largest distance of an insertion from given material points at given depths, m."""
    cutting = [state for state in found.states if state.tip_phase is TipPhase.CUTTING]
    own = np.array([state.depth for state in cutting])
    nearest = np.argmin(np.abs(own[:, None] - depths), axis=0)
    missed = float(np.max(np.abs(own[nearest] - depths)))
    points = np.array([cutting[number].tip for number in nearest])
    return max(missed, float(np.max(np.linalg.norm(points - tips, axis=1))))


def in_time(marched: Insertion, spacing: float) -> float:
    """Return the largest difference of steps in time from path following between its states, m.

    The tissue has a viscoelastic branch without effect, which forbids steps of variable length.
    """
    laws = {
        name: Viscoelastic(
            youngs_modulus=modulus, poissons_ratio=0.45, shares=(1e-9,), times=(1.0,)
        )
        for name, modulus in MODULI.items()
    }
    found = simulate(vary(scene(spacing), {"materials": laws}))
    path, begin = TipTrajectory(marched), (marched.puncture_depth or 0.0) + 2.0 * SPACINGS[0]
    worst = 0.0
    for state in found.states:
        if state.tip_phase is TipPhase.CUTTING and begin < state.depth < marched.depths[-1]:
            reach = path.at_depth(state.depth)
            worst = max(worst, np.inf if reach is None else np.linalg.norm(reach.point - state.tip))
    return float(worst)


def run(quick: bool) -> ProblemResult:
    """Compare both for decreasing segment lengths and steps."""
    answers, errors, cost = [], [], []
    for spacing in SPACINGS[:1] if quick else SPACINGS:
        simulation = Simulation(scene(spacing))
        marched = simulation.insert(simulation.entry_of_case())
        for step in (0.2,) if quick else (0.2, 0.05):
            label = f"pieces of {spacing * 1e3:g} mm, steps of {step} s: off the march's states"
            value = in_depth(marched, spacing, step) / 0.03
            answers.append(Quantity(label=label, value=value, tolerance=1e-9, recorded=False))
        errors.append(in_time(marched, spacing))
        cost.append(len(marched.states))
        label = f"pieces of {spacing * 1e3:g} mm, steps in time of half of them: off, m"
        answers.append(Quantity(label=label, value=errors[-1], tolerance=2e-4))
    if quick:
        return ProblemResult(quantities=answers)
    curve = Curve(element="P2", quantity="place of the tip, steps in time", order=1.0,
                  sizes=SPACINGS, dofs=tuple(cost), seconds=(0.0,) * len(cost),
                  errors=tuple(errors))  # fmt: skip
    order = np.log(errors[0] / errors[-1]) / np.log(SPACINGS[0] / SPACINGS[-1])
    answers += [
        Quantity(label="order of steps in time", value=float(order), reference=1.0, at_least=True),
        Quantity(label="steps in time: off at the finest, m", value=errors[-1], tolerance=1e-5),
    ]
    return ProblemResult(quantities=answers, curves=[curve])


PROBLEM = Problem(
    name="march and steps",
    requirement="Time steps without inertia agree with path following at its states. Time steps of "
    "constant length converge to it.",
    reference="another method for the same equations: unknown depth instead of unknown position",
    tolerance_rationale="both solve to 1e-12 m; steps of constant length make segments that are "
    "too long by up to one step",
    run=run,
)
