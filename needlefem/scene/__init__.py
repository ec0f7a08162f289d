"""The scene: all data of a case, as plain frozen dataclasses in SI units.

Its fields are the keys of a case file. `vary` returns a scene with changed fields; `resolve`
fills in element, time integrator and quadrature that a scene leaves open.
"""

from typing import TYPE_CHECKING

from needlefem._exports import lazy_exports
from needlefem.fem.tissue_model import Support

# the module has the name of the function, which has to replace it here
from needlefem.scene.resolve import resolve

if TYPE_CHECKING:
    from needlefem.scene.build import build_mesh
    from needlefem.scene.discretization import (
        DYNAMIC,
        BoxMesh,
        Discretization,
        FileMesh,
        Limits,
        Rayleigh,
        Refinement,
    )
    from needlefem.scene.resolve import (
        Resolved,
        cheapest,
        slowest_wave,
        tip_element_size,
        tip_quadrature_points,
        with_element,
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
    "Discretization",
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
    "Resolved",
    "Scene",
    "Stage",
    "Support",
    "TargetDraw",
    "build_mesh",
    "canonical",
    "cheapest",
    "contour_sizes",
    "field_of",
    "one_contour_size",
    "point_of",
    "resolve",
    "slowest_wave",
    "tip_element_size",
    "tip_quadrature_points",
    "vary",
    "with_element",
]

if not TYPE_CHECKING:
    __getattr__, __dir__ = lazy_exports(
        __name__,
        build="build_mesh",
        discretization="BoxMesh DYNAMIC Discretization FileMesh Limits Rayleigh Refinement",
        resolve=(
            "Resolved cheapest tip_quadrature_points slowest_wave tip_element_size with_element"
        ),
        schema=(
            "Expectation Motion Needle Obstacle Outputs Planning Region Scene Stage "
            "TargetDraw point_of"
        ),
        varying="canonical contour_sizes field_of one_contour_size vary",
    )
