"""Isotropic linear elasticity."""

import dataclasses

import numpy as np

from needlefem._arrays import Floats
from needlefem._parameter import parameter
from needlefem.materials.linear_elastic import LinearElastic


@dataclasses.dataclass(frozen=True, kw_only=True)
class Isotropic(LinearElastic):
    """Isotropic linear elasticity at small strain (R. Hooke 1678, G. Lame 1852)."""

    youngs_modulus: float = parameter("Stiffness in simple tension", "pressure", low=0.0)
    poissons_ratio: float = parameter(
        "Lateral contraction; 0.5 is incompressible and needs a mixed element",
        low=-0.999,
        high=0.5,
        closed=True,
    )
    density: float = parameter("Mass per volume", "density", default=1000.0, low=0.0, closed=True)

    def compliance(self) -> Floats:
        """See `LinearElastic`."""
        nu = self.poissons_ratio
        matrix = np.diag([1.0 + nu] * 3 + [2.0 * (1.0 + nu)] * 3)
        matrix[:3, :3] -= nu
        scaled: Floats = matrix / self.youngs_modulus
        return scaled

    def lame(self) -> tuple[float, float]:
        """Return the Lame parameters (lambda, mu), Pa; lambda is infinite at nu = 0.5."""
        modulus, nu = self.youngs_modulus, self.poissons_ratio
        shear = modulus / (2.0 * (1.0 + nu))
        return (2.0 * shear * nu / (1.0 - 2.0 * nu) if nu < 0.5 else np.inf), shear
