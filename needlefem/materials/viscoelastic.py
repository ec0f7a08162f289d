"""Isotropic linear viscoelasticity with relaxation of the shear modulus."""

import dataclasses

import numpy as np

from needlefem._arrays import Floats
from needlefem.errors import CaseError
from needlefem.materials import voigt
from needlefem.materials.linear_elastic import Branch, Isotropic
from needlefem.validation import parameter


def deviator() -> Floats:
    """Return the stiffness, shape (6, 6), of a law ``stress = 2 G dev(strain)`` for G = 1."""
    m = voigt.volumetric(3)
    found: Floats = np.diag([2.0] * 3 + [1.0] * 3) - 2.0 / 3.0 * np.outer(m, m)
    return found


@dataclasses.dataclass(frozen=True, kw_only=True)
class Viscoelastic(Isotropic):
    """Generalised Maxwell solid, isotropic at small strain (J. C. Maxwell 1867, E. Wiechert 1889).

    ``G(t) = G (1 + sum of r_i exp(-t / T_i))``, with ``r_i = g_i / (1 - sum of g)``. Young's
    modulus and Poisson's ratio are those of the relaxed tissue; `shares` g_i are fractions of the
    instantaneous shear modulus (the Prony series of other programs). The bulk modulus is constant.
    """

    shares: tuple[float, ...] = parameter(
        "Share of the instantaneous shear modulus that every branch loses",
        low=0.0,
        high=1.0,
    )
    times: tuple[float, ...] = parameter("Relaxation time of every branch", "time", low=0.0)

    def check(self) -> None:
        """See `needlefem.validation.Validated`."""
        if len(self.shares) != len(self.times):
            problem = f"{len(self.shares)} shares and {len(self.times)} times"
            raise CaseError("material", problem, "give one share and one time per branch")
        if sum(self.shares) >= 1.0:
            problem = f"shares add up to {sum(self.shares):g}"
            raise CaseError("material", problem, "keep the sum below 1")

    def branches(self) -> tuple[Branch, ...]:
        """See `needlefem.materials.linear_elastic.HasBranches`."""
        return tuple(
            Branch(time, modulus * deviator())
            for time, modulus in zip(self.times, self._moduli, strict=True)
        )

    @property
    def _moduli(self) -> Floats:
        """Shear modulus of every branch, Pa."""
        shear = self.lame()[1]
        found: Floats = shear * np.array(self.shares) / (1.0 - sum(self.shares))
        return found

    def shear_modulus(self, time: float) -> float:
        """Return the relaxed shear modulus at a time (s) after a sudden strain, Pa."""
        left = np.exp(-time / np.array(self.times))
        return float(self.lame()[1] + self._moduli @ left)

    def complex_shear_modulus(self, frequency: float) -> complex:
        """Return storage and loss modulus at a frequency (Hz) as a complex number, Pa."""
        turn = 2j * np.pi * frequency * np.array(self.times)
        return complex(self.lame()[1] + self._moduli @ (turn / (1.0 + turn)))
