"""Constitutive laws; a law is one frozen dataclass whose fields carry unit and range.

Laws that few cases name are imported when first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from needlefem.materials.base import Material, MaterialResponse
from needlefem.materials.catalogue import LAWS, law_class
from needlefem.materials.linear_elastic import Isotropic, LinearElastic
from needlefem.materials.relaxation import Branch, branches_of
from needlefem.materials.volumetric_split import (
    VolumetricSplit,
    plane_volumetric_split,
    volumetric_split,
)

if TYPE_CHECKING:
    from needlefem.materials.anisotropic import Orthotropic, TransverselyIsotropic
    from needlefem.materials.viscoelastic import Viscoelastic

__all__ = [
    "LAWS",
    "Branch",
    "Isotropic",
    "LinearElastic",
    "Material",
    "MaterialResponse",
    "Orthotropic",
    "TransverselyIsotropic",
    "Viscoelastic",
    "VolumetricSplit",
    "branches_of",
    "law_class",
    "plane_volumetric_split",
    "volumetric_split",
]

_HOMES = {
    "Orthotropic": "anisotropic",
    "TransverselyIsotropic": "anisotropic",
    "Viscoelastic": "viscoelastic",
}


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(import_module(f"needlefem.materials.{_HOMES[name]}"), name)
    raise AttributeError(f"module 'needlefem.materials' has no attribute '{name}'")
