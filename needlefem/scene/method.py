"""Numbers of the method, as opposed to those of the tissue and the needle; and damping."""

import dataclasses

from needlefem.knobs import knob
from needlefem.scene.meshing import Coordinates

DYNAMIC = ("newmark", "generalised-alpha")
"""Integrators with inertia."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Discretisation:
    """Numbers of the method."""

    element: str = knob("Element of the catalogue, or 'auto'", default="auto")
    path_spacing: float = knob(
        "Length of the pieces of the cut path that carry contact",
        "length",
        default=0.8e-3,
        low=0.0,
    )
    kernel_points: int = knob(
        "Quadrature points of the tip's kernel; 0 chooses by element size",
        default=0,
        low=0.0,
        closed=True,
    )
    integrator: str = knob(
        "March along the path, equilibrium step by step, with inertia, or what the scene needs",
        default="auto",
        choices=("auto", "march", "quasi-static", *DYNAMIC),
    )
    time_step: float = knob(
        "Longest time step; 0: that of half a piece of the path at the motion's speed",
        "time",
        default=0.0,
        low=0.0,
        closed=True,
    )
    rho_inf: float = knob(
        "Generalised-alpha: by what motion that the step can't follow shrinks a step",
        default=0.8,
        low=0.0,
        high=1.0,
        closed=True,
    )
    newmark_gamma: float = knob(
        "Newmark: 0.5 is the average acceleration, more damps; beta goes with it",
        default=0.6,
        low=0.5,
        high=1.0,
        closed=True,
    )
    mass: str = knob(
        "Mass of tissue with inertia, consistent or a lumping that the element has",
        default="consistent",
        choices=("consistent", "row-sum", "hrz"),
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class Rayleigh:
    """Viscous damping ``mass_rate M + stiffness_time K``, or two ratios at two frequencies."""

    mass_rate: float = knob("Damping of velocities", "rate", default=0.0, low=0.0, closed=True)
    stiffness_time: float = knob(
        "Damping of strain rates", "time", default=0.0, low=0.0, closed=True
    )
    frequencies: Coordinates = knob(
        "Two frequencies with known damping, instead", "rate", default=(), low=0.0
    )
    ratios: Coordinates = knob("Shares of critical damping there", default=(), low=0.0, closed=True)
