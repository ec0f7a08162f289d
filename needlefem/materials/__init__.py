"""Constitutive laws; a law is one frozen dataclass whose fields carry unit and range."""

from needlefem.materials.anisotropic import Orthotropic, TransverselyIsotropic
from needlefem.materials.catalogue import LAWS, law_class
from needlefem.materials.isotropic import Isotropic
from needlefem.materials.linear import LinearElastic
from needlefem.materials.protocol import Material, Response
from needlefem.materials.relaxation import Branch, branches_of
from needlefem.materials.split import Split, plane_split, split
from needlefem.materials.viscoelastic import Viscoelastic

__all__ = [
    "LAWS",
    "Branch",
    "Isotropic",
    "LinearElastic",
    "Material",
    "Orthotropic",
    "Response",
    "Split",
    "TransverselyIsotropic",
    "Viscoelastic",
    "branches_of",
    "law_class",
    "plane_split",
    "split",
]
