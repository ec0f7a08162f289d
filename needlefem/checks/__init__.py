"""Checks that any element, law, integrator or scene must pass, and reference problems.

The preflight of a scene raises an error for meshes and needles that do not permit a computation.
Elements, laws and integrators, including those of a user, are checked here. A reference problem
compares quantities with known values. The problems of `verification/` use the parts in this folder.
"""

from typing import TYPE_CHECKING

from needlefem._exports import lazy_exports

if TYPE_CHECKING:
    from needlefem.checks.convergence import (
        LOCKING,
        convergence_study,
        order_answer,
        order_at_least,
        over_interpolant,
        solve_manufactured,
        two_material_bar,
    )
    from needlefem.checks.element_checks import bending_error, inf_sup
    from needlefem.checks.friction_models import EmbeddedShaft, FrictionState, FrictionSystem
    from needlefem.checks.integrator_checks import (
        Oscillator,
        check_integrator,
        energy_drift,
        order,
        period_error,
        principal,
        spectral_radius,
        stability_limit,
    )
    from needlefem.checks.material_checks import check_law
    from needlefem.checks.mesh_checks import (
        patch_error,
        preflight,
        reciprocity,
        rigid_motion,
        spectrum,
        traction_patch_error,
        zero_modes,
    )
    from needlefem.checks.models import (
        GENERAL,
        ISOCHORIC,
        Manufactured,
        distorted_mesh,
        eigenfrequencies,
        for_bent_cells,
        joined,
        mapped_mesh,
        rectangle,
        sliding_box,
        square_mesh,
        tissue,
    )
    from needlefem.checks.qualify import check_element_material, failures
    from needlefem.checks.reference_problem import (
        Curve,
        Problem,
        ProblemResult,
        Quantity,
        Shape,
        Verdict,
        load_problems,
        run_problem,
    )
    from needlefem.checks.result import CheckResult
    from needlefem.checks.work_precision import (
        ELEMENTS,
        INTEGRATORS,
        WAVES,
        Point,
        WorkPrecision,
        elements_race,
        front,
        implicit_and_explicit,
        same_cells,
        seconds_to,
    )

__all__ = [
    "ELEMENTS",
    "GENERAL",
    "INTEGRATORS",
    "ISOCHORIC",
    "LOCKING",
    "WAVES",
    "CheckResult",
    "Curve",
    "EmbeddedShaft",
    "FrictionState",
    "FrictionSystem",
    "Manufactured",
    "Oscillator",
    "Point",
    "Problem",
    "ProblemResult",
    "Quantity",
    "Shape",
    "Verdict",
    "WorkPrecision",
    "bending_error",
    "check_element_material",
    "check_integrator",
    "check_law",
    "convergence_study",
    "distorted_mesh",
    "eigenfrequencies",
    "elements_race",
    "energy_drift",
    "failures",
    "for_bent_cells",
    "front",
    "implicit_and_explicit",
    "inf_sup",
    "joined",
    "load_problems",
    "mapped_mesh",
    "order",
    "order_answer",
    "order_at_least",
    "over_interpolant",
    "patch_error",
    "period_error",
    "preflight",
    "principal",
    "reciprocity",
    "rectangle",
    "rigid_motion",
    "run_problem",
    "same_cells",
    "seconds_to",
    "sliding_box",
    "solve_manufactured",
    "spectral_radius",
    "spectrum",
    "square_mesh",
    "stability_limit",
    "tissue",
    "traction_patch_error",
    "two_material_bar",
    "zero_modes",
]

if not TYPE_CHECKING:
    __getattr__, __dir__ = lazy_exports(
        __name__,
        convergence=(
            "LOCKING convergence_study order_answer order_at_least over_interpolant "
            "solve_manufactured two_material_bar"
        ),
        element_checks="bending_error inf_sup",
        friction_models="EmbeddedShaft FrictionState FrictionSystem",
        integrator_checks=(
            "Oscillator check_integrator energy_drift order period_error principal "
            "spectral_radius stability_limit"
        ),
        material_checks="check_law",
        mesh_checks=(
            "patch_error preflight reciprocity rigid_motion spectrum traction_patch_error "
            "zero_modes"
        ),
        models=(
            "GENERAL ISOCHORIC Manufactured distorted_mesh eigenfrequencies for_bent_cells "
            "joined mapped_mesh rectangle sliding_box square_mesh tissue"
        ),
        qualify="check_element_material failures",
        reference_problem=(
            "Curve Problem ProblemResult Quantity Shape Verdict load_problems run_problem"
        ),
        result="CheckResult",
        work_precision=(
            "ELEMENTS INTEGRATORS Point WAVES WorkPrecision elements_race front "
            "implicit_and_explicit same_cells seconds_to"
        ),
    )
