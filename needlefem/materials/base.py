"""What a constitutive law is to the rest of the package."""

import dataclasses
from typing import Any, Protocol, runtime_checkable

from needlefem._arrays import Floats


@dataclasses.dataclass(frozen=True, eq=False)
class MaterialResponse:
    """What a law answers to a displacement gradient.

    Parameters
    ----------
    stress : array, shape (..., 3, 3), Pa
        First Piola-Kirchhoff stress, the one that the weak form contracts with ``grad v``; at
        small strain simply the stress.
    tangent : array, shape (..., 3, 3, 3, 3), Pa
        Derivative of the stress by the gradient.
    energy : array, shape (...,), J/m^3
        Stored energy, whose derivative by the gradient is the stress of an elastic law.
    state : object
        Internal variables at the end of the step; None for a law without any.
    """

    stress: Floats
    tangent: Floats
    energy: Floats
    state: Any = None


@runtime_checkable
class Material(Protocol):
    """A constitutive law: always in three dimensions, plane problems are made from it.

    A frozen dataclass whose fields are declared with `needlefem.validation.parameter` can be in a
    case. Linear laws are easiest written as a `LinearElastic`.
    """

    @property
    def density(self) -> float:
        """Mass per volume, kg/m^3."""
        ...

    def respond(self, gradient: Floats, state: Any = None, step: float = 0.0) -> MaterialResponse:
        """Answer a displacement gradient.

        Parameters
        ----------
        gradient : array, shape (..., 3, 3)
            ``du_i / dX_j``; the deformation gradient is ``I + gradient``.
        state : object
            Internal variables at the start of the step; None in the virgin tissue.
        step : float, s
            Duration of the step, over which the strain changes evenly: 0 is at once, infinity
            leaves time to relax. Only laws with a memory depend on it.
        """
        ...
