"""Time: systems, integrators, histories, modes."""

from needlefem.dynamics.energy import TissueEnergyBalance, kinetic_energy
from needlefem.dynamics.integrators import (
    HHT,
    NAMES,
    CentralDifference,
    GeneralizedAlpha,
    Integrator,
    Newmark,
    QuasiStatic,
    critical_step,
    integrator_class,
)
from needlefem.dynamics.steppers import ImplicitStepper, KinematicState, Stepper, at_rest
from needlefem.dynamics.system import Damping, MatrixSystem, System, TissueSystem

__all__ = [
    "HHT",
    "NAMES",
    "CentralDifference",
    "Damping",
    "GeneralizedAlpha",
    "ImplicitStepper",
    "Integrator",
    "KinematicState",
    "MatrixSystem",
    "Newmark",
    "QuasiStatic",
    "Stepper",
    "System",
    "TissueEnergyBalance",
    "TissueSystem",
    "at_rest",
    "critical_step",
    "integrator_class",
    "kinetic_energy",
]
