"""Constitutive laws, and the library of tissues.

A law is one frozen dataclass whose fields carry unit and range; a case names it and its
constants. Laws are linear today: isotropic, transversely isotropic, orthotropic, viscoelastic.
"""

from typing import TYPE_CHECKING

from needlefem._exports import lazy_exports

# the module has the name of the function, which has to replace it here
from needlefem.materials.volumetric_split import volumetric_split

if TYPE_CHECKING:
    from needlefem.materials.base import Material, MaterialResponse
    from needlefem.materials.catalogue import LAWS, example, law_class, library, tissue_table
    from needlefem.materials.linear_elastic import (
        Branch,
        HasBranches,
        Isotropic,
        LinearElastic,
        MaxwellState,
        Orthotropic,
        TransverselyIsotropic,
        branches_of,
        load_factor,
        local_axes,
        relaxation_factor,
        turned,
    )
    from needlefem.materials.linearity import refuse_nonlinear
    from needlefem.materials.viscoelastic import Viscoelastic
    from needlefem.materials.voigt import tangent_matrix, tangent_tensor
    from needlefem.materials.volumetric_split import (
        HasCompliance,
        VolumetricSplit,
        plane_volumetric_split,
    )

__all__ = [
    "LAWS",
    "Branch",
    "HasBranches",
    "HasCompliance",
    "Isotropic",
    "LinearElastic",
    "Material",
    "MaterialResponse",
    "MaxwellState",
    "Orthotropic",
    "TransverselyIsotropic",
    "Viscoelastic",
    "VolumetricSplit",
    "branches_of",
    "example",
    "law_class",
    "library",
    "load_factor",
    "local_axes",
    "plane_volumetric_split",
    "refuse_nonlinear",
    "relaxation_factor",
    "tangent_matrix",
    "tangent_tensor",
    "tissue_table",
    "turned",
    "volumetric_split",
]

if not TYPE_CHECKING:
    __getattr__, __dir__ = lazy_exports(
        __name__,
        base="Material MaterialResponse",
        catalogue="LAWS example law_class library tissue_table",
        linear_elastic=(
            "Branch HasBranches Isotropic LinearElastic MaxwellState Orthotropic "
            "TransverselyIsotropic branches_of load_factor local_axes relaxation_factor turned"
        ),
        linearity="refuse_nonlinear",
        viscoelastic="Viscoelastic",
        voigt="tangent_matrix tangent_tensor",
        volumetric_split="HasCompliance VolumetricSplit plane_volumetric_split",
    )
