"""Constitutive laws; a law is one frozen dataclass whose fields carry unit and range."""

import dataclasses
from typing import Protocol, runtime_checkable

from needlefem.errors import CaseError, nearest
from needlefem.knobs import knob


@runtime_checkable
class Material(Protocol):
    """A linear elastic law, isotropic: what the stiffness and mass forms need to know."""

    @property
    def density(self) -> float:
        """Mass per volume, kg/m^3."""
        ...

    def lame(self) -> tuple[float, float]:
        """Return the Lame parameters (lambda, mu), Pa."""
        ...


@dataclasses.dataclass(frozen=True, kw_only=True)
class Isotropic:
    """Isotropic linear elasticity at small strain (in 2D: plane strain)."""

    youngs_modulus: float = knob("Stiffness in simple tension", "pressure", low=0.0)
    poissons_ratio: float = knob("Lateral contraction; 0.5 is incompressible", low=-1.0, high=0.5)
    density: float = knob("Mass per volume", "density", default=1000.0, low=0.0, closed=True)

    def lame(self) -> tuple[float, float]:
        """Return the Lame parameters (lambda, mu), Pa."""
        modulus, nu = self.youngs_modulus, self.poissons_ratio
        shear = modulus / (2.0 * (1.0 + nu))
        return 2.0 * shear * nu / (1.0 - 2.0 * nu), shear


LAWS: dict[str, type[Isotropic]] = {"isotropic": Isotropic}


def law_class(name: str, key: str) -> type[Isotropic]:
    """Return the dataclass of a law, or raise a `CaseError` with the nearest name."""
    if name not in LAWS:
        raise CaseError(key, f"no law '{name}'", nearest(name, LAWS))
    return LAWS[name]
