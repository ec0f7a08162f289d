"""The discretised tissue: function space, stiffness, supports, solvers, stresses.

`TissueModel` is a mesh with laws and supports, ready to be solved on. `BoundaryValueProblem`
solves one static problem of your own, with given displacements and tractions. The compliance
operators give displacements at the needle without a solution for every step.
"""

from typing import TYPE_CHECKING

from needlefem._exports import lazy_exports

if TYPE_CHECKING:
    from needlefem.fem.boundary_value_problem import BoundaryValueProblem, StaticSolution
    from needlefem.fem.compliance import (
        CachedCompliance,
        ComplianceOperator,
        CondensedCorridor,
        Corridor,
        DirectCompliance,
        InverseColumnsOnDemand,
    )
    from needlefem.fem.factorization import (
        CholmodFactor,
        Factor,
        GroupedFactor,
        SuperLUFactor,
        cholmod,
        factorise,
    )
    from needlefem.fem.forms import traction_load
    from needlefem.fem.function_space import FunctionSpace
    from needlefem.fem.interpolation import Interpolation, LinearFunctionals, OutsideError
    from needlefem.fem.recovery import CellFields, stresses
    from needlefem.fem.stiffness import Stiffness
    from needlefem.fem.tissue_model import Support, TissueModel
    from needlefem.fem.two_level_solver import TwoLevelSolver

__all__ = [
    "BoundaryValueProblem",
    "CachedCompliance",
    "CellFields",
    "CholmodFactor",
    "ComplianceOperator",
    "CondensedCorridor",
    "Corridor",
    "DirectCompliance",
    "Factor",
    "FunctionSpace",
    "GroupedFactor",
    "Interpolation",
    "InverseColumnsOnDemand",
    "LinearFunctionals",
    "OutsideError",
    "StaticSolution",
    "Stiffness",
    "SuperLUFactor",
    "Support",
    "TissueModel",
    "TwoLevelSolver",
    "cholmod",
    "factorise",
    "stresses",
    "traction_load",
]

if not TYPE_CHECKING:
    __getattr__, __dir__ = lazy_exports(
        __name__,
        boundary_value_problem="BoundaryValueProblem StaticSolution",
        compliance=(
            "CachedCompliance ComplianceOperator CondensedCorridor Corridor DirectCompliance "
            "InverseColumnsOnDemand"
        ),
        factorization="CholmodFactor Factor GroupedFactor SuperLUFactor cholmod factorise",
        forms="traction_load",
        function_space="FunctionSpace",
        interpolation="Interpolation LinearFunctionals OutsideError",
        recovery="CellFields stresses",
        stiffness="Stiffness",
        tissue_model="Support TissueModel",
        two_level_solver="TwoLevelSolver",
    )
