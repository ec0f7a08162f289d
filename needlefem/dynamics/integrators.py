"""Integrators of ``M a + C v + K u = f`` with a fixed time step.

An integrator is an immutable set of parameters. Its method `stepper` returns an object for one
system and one step, with a single factorisation. The contact uses three parts of an implicit
stepper: the operator ``A`` (its `factor`), the displacement without contact forces
(`free_displacement`), and the update of velocity and acceleration from the displacement
(`advance`).
"""

import dataclasses
from typing import Protocol

from needlefem import _plugin
from needlefem.dynamics.steppers import (
    AlphaParameters,
    ExplicitStepper,
    ImplicitStepper,
    StaticStepper,
    Stepper,
)
from needlefem.dynamics.system import System
from needlefem.errors import CaseError, matching, nearest, short

ROUND_OFF = 1e-9
"""Relative excess over a computed limit that a step may have."""


class Integrator(Protocol):
    """A method of time integration."""

    def stepper(self, system: System, step: float) -> Stepper:
        """Return the stepper for a system and a time step, s."""
        ...


@dataclasses.dataclass(frozen=True, kw_only=True)
class Newmark:
    """Newmark's method (N. M. Newmark, J. Eng. Mech. Div. ASCE 85, 1959).

    ``beta = 1/4, gamma = 1/2`` is the average acceleration: second order, unconditionally
    stable, without algorithmic damping. ``gamma > 1/2`` adds damping and is of first order.
    """

    beta: float = 0.25
    gamma: float = 0.5

    def __post_init__(self) -> None:
        if self.gamma < 0.5 or 2.0 * self.beta < self.gamma:
            problem = f"beta {self.beta:g}, gamma {self.gamma:g} are not unconditionally stable"
            raise CaseError("newmark", problem, "keep 2 beta >= gamma >= 1/2")

    def stepper(self, system: System, step: float) -> ImplicitStepper:
        """See `Integrator`."""
        return ImplicitStepper(system, step, AlphaParameters(0.0, 0.0, self.beta, self.gamma))


@dataclasses.dataclass(frozen=True, kw_only=True)
class HHT:
    """The alpha method (H. M. Hilber, T. J. R. Hughes, R. L. Taylor 1977).

    Second order, unconditionally stable. ``alpha`` between 0 (average acceleration) and -1/3 damps
    frequencies that the step does not resolve.
    """

    alpha: float = -0.05

    def __post_init__(self) -> None:
        if not -1.0 / 3.0 - ROUND_OFF <= self.alpha <= 0.0:
            raise CaseError("hht", f"alpha {self.alpha:g} is out of range", "keep -1/3 to 0")

    def stepper(self, system: System, step: float) -> ImplicitStepper:
        """See `Integrator`."""
        alpha = self.alpha
        weights = AlphaParameters(0.0, -alpha, 0.25 * (1.0 - alpha) ** 2, 0.5 - alpha)
        return ImplicitStepper(system, step, weights)


@dataclasses.dataclass(frozen=True, kw_only=True)
class GeneralizedAlpha:
    """The generalised-alpha method (J. Chung, G. M. Hulbert 1993) by its spectral radius.

    Second order, unconditionally stable. Frequencies that the step does not resolve are reduced by
    the factor ``rho_inf`` per step; the damping of low frequencies is as small as possible.
    """

    rho_inf: float = 0.8

    def __post_init__(self) -> None:
        if not 0.0 <= self.rho_inf <= 1.0:
            problem = f"rho_inf {self.rho_inf:g} is out of range"
            raise CaseError("generalized-alpha", problem, "keep 0 to 1")

    def stepper(self, system: System, step: float) -> ImplicitStepper:
        """See `Integrator`."""
        rho = self.rho_inf
        mass, force = (2.0 * rho - 1.0) / (rho + 1.0), rho / (rho + 1.0)
        beta = 0.25 * (1.0 - mass + force) ** 2
        return ImplicitStepper(system, step, AlphaParameters(mass, force, beta, 0.5 - mass + force))


@dataclasses.dataclass(frozen=True, kw_only=True)
class CentralDifference:
    """Central differences: explicit, second order, stable below ``2 / w_max``.

    Damping acts on the velocity at the end of the step and does not change the limit (T. J. R.
    Hughes 2000, 9.1: ``gamma = 1/2``). A larger step raises an error unless the instability itself
    is to be shown.
    """

    refuse_unstable: bool = True

    def stepper(self, system: System, step: float) -> ExplicitStepper:
        """See `Integrator`.

        Raises
        ------
        CaseError
            The step is larger than the limit, which the message states.
        """
        if self.refuse_unstable:
            limit = critical_step(system)
            if step > limit * (1.0 + ROUND_OFF):
                problem = f"{step:.4g} s is above the stable {limit:.4g} s of this system"
                raise CaseError("step", problem, "take a smaller step or an implicit integrator")
        return ExplicitStepper(system, step)


@dataclasses.dataclass(frozen=True, kw_only=True)
class QuasiStatic:
    """No inertia and no damping: equilibrium at the end of each step."""

    def stepper(self, system: System, step: float) -> StaticStepper:
        """See `Integrator`."""
        return StaticStepper(system, step)


def critical_step(system: System) -> float:
    """Return the largest stable step of central differences, ``2 / w_max``, s."""
    return 2.0 / system.largest_frequency


NAMES: dict[str, type] = {
    "quasi_static": QuasiStatic,
    "newmark": Newmark,
    "hht": HHT,
    "generalized-alpha": GeneralizedAlpha,
    "central_difference": CentralDifference,
}
"""The integrators by their names in a case."""


def integrator_class(name: str, key: str) -> type:
    """Return the class of an integrator of the package or of the user (``module:Class``).

    Raises
    ------
    CaseError
        The name does not exist (the most similar one is given), or the class has no `stepper`.
    """
    if not _plugin.is_foreign(name):
        known = matching(name, NAMES)
        if known is None:
            raise CaseError(key, f"no integrator {short(name)}", nearest(name, NAMES))
        return NAMES[known]
    found = _plugin.load(name, key)
    if not (isinstance(found, type) and hasattr(found, "stepper")):
        raise CaseError(key, f"'{name}' has no method stepper", "see docs/how-to/own-integrator.md")
    return found
