"""Tissue in time: systems with mass and damping, time integrators, energies, natural modes.

A system is advanced step by step with an integrator; `iterate` yields the states of a history.
The tissue alone is meant here; `needlefem.insertion` couples it with a needle.
"""

from typing import TYPE_CHECKING

from needlefem._exports import lazy_exports

if TYPE_CHECKING:
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
    from needlefem.dynamics.steppers import (
        AlphaParameters,
        ExplicitStepper,
        ImplicitStepper,
        KinematicState,
        Load,
        StaticStepper,
        Stepper,
        at_rest,
        constant,
        iterate,
        last,
        ramp,
        record,
        switched,
        table,
        together,
    )
    from needlefem.dynamics.system import (
        Damping,
        MatrixSystem,
        MaxwellUpdate,
        System,
        TissueSystem,
        modes,
    )

__all__ = [
    "HHT",
    "NAMES",
    "AlphaParameters",
    "CentralDifference",
    "Damping",
    "ExplicitStepper",
    "GeneralizedAlpha",
    "ImplicitStepper",
    "Integrator",
    "KinematicState",
    "Load",
    "MatrixSystem",
    "MaxwellUpdate",
    "Newmark",
    "QuasiStatic",
    "StaticStepper",
    "Stepper",
    "System",
    "TissueEnergyBalance",
    "TissueSystem",
    "at_rest",
    "constant",
    "critical_step",
    "integrator_class",
    "iterate",
    "kinetic_energy",
    "last",
    "modes",
    "ramp",
    "record",
    "switched",
    "table",
    "together",
]

if not TYPE_CHECKING:
    __getattr__, __dir__ = lazy_exports(
        __name__,
        energy="TissueEnergyBalance kinetic_energy",
        integrators=(
            "CentralDifference GeneralizedAlpha HHT Integrator NAMES Newmark QuasiStatic "
            "critical_step integrator_class"
        ),
        steppers=(
            "AlphaParameters ExplicitStepper ImplicitStepper KinematicState Load "
            "StaticStepper Stepper at_rest constant iterate last ramp record switched table "
            "together"
        ),
        system="Damping MatrixSystem MaxwellUpdate System TissueSystem modes",
    )
