"""The plan for each element of the catalogue: release point, cost and warnings.

Each plan uses the element sizes of the case, and half of them. With half of the sizes, the plans of
elements that do not lock at the case's Poisson's ratios must agree; the others are listed too.
"""

import time

import numpy as np

from needlefem._arrays import Vector
from needlefem._table import Table
from needlefem.elements import CATALOGUE, element_row
from needlefem.errors import CaseError
from needlefem.materials import volumetric_split
from needlefem.planning.plan import plan
from needlefem.planning.result import Plan, PlanStatus
from needlefem.scene import BoxMesh, Scene, contour_sizes, vary
from needlefem.scene.resolve import resolve, with_element

AGREE = 2e-4
"""Largest distance between refined release points of elements that do not lock, m."""


def study(scene: Scene, other: Scene | None = None) -> list[Table]:
    """Return the table of all elements."""
    del other
    rows: list[list[object]] = []
    fine: dict[str, Vector] = {}
    for name in CATALOGUE:
        coarse_row, _ = _planned(with_element(scene, name), name, "as it is")
        fine_row, found = _planned(with_element(refined(scene), name), name, "halved")
        rows += [coarse_row, fine_row]
        if found is not None and not locks(scene, name):
            fine[name] = found
    points = np.array(list(fine.values())).reshape(-1, scene.dim)
    apart = float(np.max(np.linalg.norm(points[:, None] - points, axis=2), initial=0.0))
    return [
        Table(
            title="planned release point by element",
            columns=(
                "element", "sizes", "dofs", *(f"{axis} (cm)" for axis in scene.axes),
                "seconds", "insertions", "status", "locks", "largest strain",
            ),
            rows=rows,
            passed=apart <= AGREE and len(fine) >= 2,
            note=f"refined, {', '.join(fine)} agree within {100.0 * apart:.4f} cm "
            f"(at most {100.0 * AGREE:g} cm)",
        )
    ]  # fmt: skip


def refined(scene: Scene) -> Scene:
    """Return the scene with half of the element size along the needle and at the contours."""
    if not isinstance(scene.mesh, BoxMesh):
        raise CaseError("mesh.file", "a mesh from a file has the sizes it has", "study a box")
    refine = scene.mesh.refine
    return vary(
        scene,
        {
            "mesh.refine.corridor_size": 0.5 * refine.corridor_size,
            **contour_sizes(scene, 0.5),
        },
    )


def locks(scene: Scene, name: str) -> bool:
    """Return whether an element locks at a Poisson's ratio of the scene."""
    worst = max(volumetric_split(material).poissons_ratio for material in scene.materials.values())
    return worst > element_row(name).poissons_ratio_limit


def _planned(scene: Scene, name: str, sizes: str) -> tuple[list[object], Vector | None]:
    start = time.perf_counter()
    found: Plan = plan(scene)
    seconds = time.perf_counter() - start
    dofs = found.level.model.ndofs
    if found.best is None or found.status is not PlanStatus.PLANNED:
        return [name, sizes, dofs, *[""] * scene.dim, seconds, "", found.status, "", ""], None
    point = found.best.release_point
    strains = None if found.evidence is None else found.evidence.validity
    told = any("locks" in sentence for sentence in resolve(scene).warnings)
    row: list[object] = [
        name, sizes, dofs, *(f"{100.0 * x:.5f}" for x in point), f"{seconds:.1f}",
        found.insertions, found.status, "warned" if told else "",
        "" if strains is None else f"{strains.largest_strain:.2f}",
    ]  # fmt: skip
    return row, point
