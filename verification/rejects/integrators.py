"""Integrators with deliberate mistakes; a named check detects each of them."""

import dataclasses

import numpy as np

from needlefem.checks import Problem, ProblemResult, Quantity, check_integrator, failures
from needlefem.dynamics import (
    HHT,
    AlphaParameters,
    CentralDifference,
    GeneralizedAlpha,
    ImplicitStepper,
    Integrator,
    KinematicState,
    Newmark,
    System,
)

RIGHT: dict[str, Integrator] = {
    "Newmark": Newmark(),
    "HHT": HHT(alpha=-0.1),
    "generalised-alpha": GeneralizedAlpha(rho_inf=0.8),
    "central difference": CentralDifference(),
}

QUICK = ("generalised-alpha", "central difference")
"""Integrators of a quick run: an implicit and an explicit one."""


class StaleAcceleration(ImplicitStepper):
    """Keeps the acceleration of the previous step."""

    def advance(self, motion: KinematicState, u: np.ndarray) -> KinematicState:
        """Return the motion with its old acceleration."""
        return dataclasses.replace(super().advance(motion, u), a=motion.a)


class WrongPredictor(ImplicitStepper):
    """Predicts without the acceleration."""

    def _predictor(self) -> np.ndarray:
        return np.array([1.0, self.step, 0.0])


class Undamped(ImplicitStepper):
    """Has no damping force."""

    def __init__(self, system: System, step: float, weights: AlphaParameters) -> None:
        super().__init__(system, step, weights)
        inertia = (1.0 - weights.mass) / (weights.beta * step**2)
        self.factor = system.factor(inertia, 0.0, 1.0 - weights.force)

    def free_displacement(
        self, motion: KinematicState, force: np.ndarray | None = None
    ) -> np.ndarray:
        """Return the displacement after a step without damping."""
        damped, self.system.damped = self.system.damped, False
        found = super().free_displacement(motion, force)
        self.system.damped = damped
        return found


class HalfVelocity(ImplicitStepper):
    """Adds the share of the old acceleration to the velocity twice."""

    def advance(self, motion: KinematicState, u: np.ndarray) -> KinematicState:
        """Return the motion with a wrong velocity."""
        right = super().advance(motion, u)
        extra = self.step * (1.0 - self.weights.gamma) * motion.a
        return dataclasses.replace(right, v=right.v + extra)


class LateForce(ImplicitStepper):
    """Uses the force at the start of the step."""

    def step_under_load(
        self, motion: KinematicState, before: np.ndarray, after: np.ndarray
    ) -> KinematicState:
        """Return the motion under the wrong force."""
        return super().step_under_load(motion, before, before)


class Forgetful(ImplicitStepper):
    """Does not update the viscoelastic branches."""

    def advance(self, motion: KinematicState, u: np.ndarray) -> KinematicState:
        """Return the state with unchanged branches."""
        return dataclasses.replace(super().advance(motion, u), parts=motion.parts)


class BorrowedVelocity(ImplicitStepper):
    """Returns the velocity in the middle of the step."""

    def advance(self, motion: KinematicState, u: np.ndarray) -> KinematicState:
        """Return the state with the velocity of half a step earlier."""
        return dataclasses.replace(super().advance(motion, u), v=(u - motion.u) / self.step)


@dataclasses.dataclass(frozen=True)
class Wrong:
    """A wrong stepper with weights of the generalised-alpha family."""

    kind: type[ImplicitStepper]
    weights: AlphaParameters

    def stepper(self, system: System, step: float) -> ImplicitStepper:
        """Return the stepper."""
        return self.kind(system, step, self.weights)


AVERAGE = AlphaParameters(0.0, 0.0, 0.25, 0.5)
WRONG: dict[str, tuple[Integrator, str]] = {
    "beta and gamma swapped": (
        Wrong(ImplicitStepper, AlphaParameters(0.0, 0.0, 0.5, 0.25)),
        "stability",
    ),
    "stale acceleration": (Wrong(StaleAcceleration, AVERAGE), "order, free"),
    "predictor without acceleration": (Wrong(WrongPredictor, AVERAGE), "free fall"),
    "damping left out": (Wrong(Undamped, AVERAGE), "damping"),
    "alpha on the wrong side": (
        Wrong(ImplicitStepper, AlphaParameters(0.0, -0.1, 0.3025, 0.6)),
        "order, free",
    ),
    "old acceleration counted twice": (Wrong(HalfVelocity, AVERAGE), "free fall"),
    "memory left as it was": (Wrong(Forgetful, AVERAGE), "order, memory"),
    "velocity of the step's middle": (Wrong(BorrowedVelocity, AVERAGE), "energy"),
    "no limit to the step": (CentralDifference(refuse_unstable=False), "stability"),
    "force of the step before": (Wrong(LateForce, AVERAGE), "order, pushed"),
}
"""Mistake, and the check that must detect it."""


def run(quick: bool) -> ProblemResult:
    """Check the faulty integrators and the correct ones."""
    answers = [
        Quantity(label=f"{name}: checks failed", value=len(failures(check_integrator(integrator))),
               tolerance=0.0)
        for name, integrator in RIGHT.items()
        if name in QUICK or not quick
    ]  # fmt: skip
    for what, (integrator, name) in WRONG.items():
        hit = float(name in failures(check_integrator(integrator, names=[name])))
        answers.append(Quantity(label=f"{what}: caught by '{name}'", value=hit, reference=1.0))
    return ProblemResult(quantities=answers)


PROBLEM = Problem(
    name="wrong integrators",
    requirement="An integrator with a mistake fails the check that names this mistake.",
    reference="typical mistakes: exchanged parameters, outdated states, omitted terms",
    tolerance_rationale="each check must be able to fail",
    run=run,
)
