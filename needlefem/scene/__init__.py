"""The scene: all that a case says, as plain frozen dataclasses in SI units."""

from needlefem.fem.tissue_model import Support
from needlefem.scene.discretization import (
    DYNAMIC,
    BoxMesh,
    Discretisation,
    FileMesh,
    Limits,
    Rayleigh,
    Refinement,
)
from needlefem.scene.schema import (
    Expectation,
    Motion,
    Needle,
    Obstacle,
    Outputs,
    Planning,
    Region,
    Scene,
    Stage,
    TargetDraw,
    point_of,
)
from needlefem.scene.varying import canonical, contour_sizes, field_of, one_contour_size, vary

__all__ = [
    "DYNAMIC",
    "BoxMesh",
    "Discretisation",
    "Expectation",
    "FileMesh",
    "Limits",
    "Motion",
    "Needle",
    "Obstacle",
    "Outputs",
    "Planning",
    "Rayleigh",
    "Refinement",
    "Region",
    "Scene",
    "Stage",
    "Support",
    "TargetDraw",
    "canonical",
    "contour_sizes",
    "field_of",
    "one_contour_size",
    "point_of",
    "vary",
]
