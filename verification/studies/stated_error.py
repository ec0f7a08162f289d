"""Compare the stated error of a case's own plan with its error on a reference tissue.

The reference tissue is the finest that is feasible; for a mesh from a file it is this mesh after
two uniform refinements. Its path spacing is at most a quarter of that of the plan.
"""

import numpy as np

from needlefem import build_model, plan
from needlefem.errors import CaseError
from needlefem.insertion import Simulation
from needlefem.mesh import uniformly_refined
from needlefem.planning import Plan, reference, true_error
from needlefem.planning.error_estimate import KERNEL
from needlefem.scene import FileMesh, Scene, vary
from needlefem.studies import Table

PATH = 0.25
"""Path spacing on a refined mesh relative to that of the plan."""


def study(scene: Scene, other: Scene | None = None) -> list[Table]:
    """Return the estimate, the stated error and the true error of the case's own plan."""
    del other
    found = plan(scene)
    if found.evidence is None or found.evidence.estimate is None:
        raise CaseError("planning", f"no estimate to judge: {found.sentence}", "see the plan")
    said, error = found.evidence.estimate, true_error(exact(scene, found), found)
    own = found.insertion.model
    lengths = [1e3 * length for length in (said.error, said.at_most, error)]
    row = [own.element.name, len(own.free_dofs), *lengths, error / said.error]
    return [
        Table(
            title=f"{scene.title}: the stated error of its plan",
            columns=(
                "element", "unknowns", "estimate (mm)", "stated (mm)", "error (mm)",
                "error / estimate",
            ),
            rows=[row],
            passed=error <= said.at_most,
            note=f"the error is to be below {lengths[1]:.2g} mm",
        )
    ]  # fmt: skip


def exact(scene: Scene, found: Plan) -> Simulation:
    """Return the reference tissue for a plan."""
    concrete = found.insertion.scene
    if not isinstance(concrete.mesh, FileMesh):
        turned = vary(scene, {"motion.direction": concrete.motion.direction})
        return reference(turned, np.array(found.target))
    chosen = concrete.discretization
    finer = {
        "discretization.path_spacing": PATH * chosen.path_spacing,
        "discretization.tip_quadrature_points": KERNEL * chosen.tip_quadrature_points,
    }
    mesh = uniformly_refined(uniformly_refined(found.insertion.model.mesh))
    refined = vary(concrete, finer)
    return Simulation(refined, build_model(refined, mesh))
