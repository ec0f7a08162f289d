"""The interface of a constitutive law."""

import dataclasses
from typing import Protocol, runtime_checkable

from needlefem._arrays import Floats


@dataclasses.dataclass(frozen=True, eq=False)
class MaterialResponse:
    """Stress, tangent and energy of a law for a displacement gradient.

    Parameters
    ----------
    stress : array, shape (..., 3, 3), Pa
        First Piola-Kirchhoff stress, which the weak form contracts with ``grad v``; at small
        strain it equals the Cauchy stress.
    tangent : array, shape (..., 3, 3, 3, 3), Pa
        Derivative of the stress with respect to the gradient.
    energy : array, shape (...,), J/m^3
        Stored energy. For an elastic law its derivative with respect to the gradient is the stress.
    state : object
        Internal variables at the end of the step; None for a law without internal variables.
    """

    stress: Floats
    tangent: Floats
    energy: Floats
    state: object = None


@runtime_checkable
class Material(Protocol):
    """A constitutive law in three dimensions; plane laws are derived from it.

    A frozen dataclass whose fields are declared with `needlefem.validation.parameter` can be used
    in a case. For linear laws, `LinearElastic` is the simplest base class.
    """

    @property
    def density(self) -> float:
        """Mass per volume, kg/m^3."""
        ...

    def evaluate(
        self, gradient: Floats, state: object = None, step: float = 0.0
    ) -> MaterialResponse:
        """Return the response to a displacement gradient.

        Parameters
        ----------
        gradient : array, shape (..., 3, 3)
            ``du_i / dX_j``; the deformation gradient is ``I + gradient``.
        state : object
            Internal variables at the start of the step; None in tissue that was never deformed.
        step : float, s
            Duration of the step, in which the strain changes linearly. 0 is a sudden change;
            infinity leaves time for complete relaxation. Elastic laws do not depend on it.
        """
        ...
