"""Linear elasticity with preferred directions: fibres and layers."""

import dataclasses

import numpy as np

from needlefem._arrays import Floats
from needlefem.materials.linear_elastic import LinearElastic, local_axes, turned
from needlefem.materials.volumetric_split import split_compliance
from needlefem.validation import parameter


def _orthotropic(moduli: Floats, ratios: Floats, shears: Floats) -> Floats:
    """Return the compliance from (E1, E2, E3), (nu12, nu13, nu23) and (G23, G13, G12).

    ``nu_ij`` is the contraction along j under tension along i (S. G. Lekhnitskii 1963).
    """
    found = np.diag(np.concatenate([1.0 / moduli, 1.0 / shears]))
    for (i, j), ratio in zip(((0, 1), (0, 2), (1, 2)), ratios, strict=True):
        found[i, j] = found[j, i] = -ratio / moduli[i]
    return found


@dataclasses.dataclass(frozen=True, kw_only=True)
class TransverselyIsotropic(LinearElastic):
    """Transversely isotropic law with one fibre direction: muscle, tendon, layered phantoms."""

    modulus_along: float = parameter("Young's modulus along the fibre", "pressure", low=0.0)
    modulus_across: float = parameter("Young's modulus across the fibre", "pressure", low=0.0)
    shear_along: float = parameter(
        "Shear modulus in planes that contain the fibre", "pressure", low=0.0
    )
    ratio_along: float = parameter(
        "Contraction across when pulled along the fibre; 0.5 is incompressible", low=-2.0, high=2.0
    )
    ratio_across: float = parameter(
        "Contraction across when pulled across the fibre; incompressible at 1 - modulus_across / "
        "(2 modulus_along)",
        low=-1.0,
        high=1.0,
    )
    fibre: tuple[float, ...] = parameter("Direction of the fibre", default=(1.0, 0.0))
    density: float = parameter("Mass per volume", "density", default=1000.0, low=0.0, closed=True)

    def check(self) -> None:
        """See `needlefem.validation.Validated`; a law with negative strain energy is an error."""
        split_compliance(self.compliance())

    def compliance(self) -> Floats:
        """See `LinearElastic`."""
        across = self.modulus_across / (2.0 * (1.0 + self.ratio_across))
        local = _orthotropic(
            np.array([self.modulus_along, self.modulus_across, self.modulus_across]),
            np.array([self.ratio_along, self.ratio_along, self.ratio_across]),
            np.array([across, self.shear_along, self.shear_along]),
        )
        return turned(local, local_axes(np.array(self.fibre)))


@dataclasses.dataclass(frozen=True, kw_only=True)
class Orthotropic(LinearElastic):
    """Orthotropic law: three perpendicular directions with different stiffness."""

    modulus_1: float = parameter("Young's modulus along axis 1", "pressure", low=0.0)
    modulus_2: float = parameter("Young's modulus along axis 2", "pressure", low=0.0)
    modulus_3: float = parameter("Young's modulus along axis 3", "pressure", low=0.0)
    ratio_12: float = parameter("Contraction along 2 when pulled along 1", low=-2.0, high=2.0)
    ratio_13: float = parameter("Contraction along 3 when pulled along 1", low=-2.0, high=2.0)
    ratio_23: float = parameter("Contraction along 3 when pulled along 2", low=-2.0, high=2.0)
    shear_23: float = parameter("Shear modulus in the plane 23", "pressure", low=0.0)
    shear_13: float = parameter("Shear modulus in the plane 13", "pressure", low=0.0)
    shear_12: float = parameter("Shear modulus in the plane 12", "pressure", low=0.0)
    axis_1: tuple[float, ...] = parameter("Direction of axis 1", default=(1.0, 0.0))
    axis_2: tuple[float, ...] = parameter(
        "Direction of axis 2, made normal to 1", default=(0.0, 1.0)
    )
    density: float = parameter("Mass per volume", "density", default=1000.0, low=0.0, closed=True)

    def check(self) -> None:
        """See `needlefem.validation.Validated`; a law with negative strain energy is an error."""
        split_compliance(self.compliance())

    def compliance(self) -> Floats:
        """See `LinearElastic`."""
        local = _orthotropic(
            np.array([self.modulus_1, self.modulus_2, self.modulus_3]),
            np.array([self.ratio_12, self.ratio_13, self.ratio_23]),
            np.array([self.shear_23, self.shear_13, self.shear_12]),
        )
        return turned(local, local_axes(np.array(self.axis_1), np.array(self.axis_2)))
