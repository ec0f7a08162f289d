"""How a plan depends on numerical and physical parameters: one function for each study.

Refinement, element, mesh and path parameters, noise as a function of the lateral offset, and plans
that are carried out on another model.
"""

import time

import numpy as np

from needlefem._arrays import Vector
from needlefem._table import Table
from needlefem.elements import CATALOGUE, element_row
from needlefem.errors import CaseError, SimulationError
from needlefem.fem.compliance import CachedCompliance
from needlefem.materials import volumetric_split
from needlefem.planning.plan import plan
from needlefem.planning.planner import carry_out, planner_of
from needlefem.planning.result import Plan, PlanStatus
from needlefem.scene import (
    BoxMesh,
    Refinement,
    Scene,
    contour_sizes,
    field_of,
    one_contour_size,
    vary,
)
from needlefem.scene.resolve import resolve, with_element

# Refinement along the path and at the contours.
#
# Path spacing and kernel quadrature are fixed; the quadrature is sufficient for the finest mesh.
# The plan converges for a tip with a radius. It does not converge for a point tip, because the
# displacement under a point force is unbounded.


LEVELS = 4
KERNEL_POINTS = 800
LAST_MOVE, LAST_SHARE = 5e-5, 1.0 / 3.0
"""Bounds of the last change of the release point: in m, and relative to the first change."""


def convergence(scene: Scene, other: Scene | None = None) -> list[Table]:
    """Return one table for the disc and one for the point tip."""
    del other
    return [refinement(scene, "disc"), refinement(scene, "point")]


def refinement(scene: Scene, tip: str, levels: int = LEVELS) -> Table:
    """Plan on meshes with elements of one tip radius, a half, a quarter, ... along the path."""
    rows: list[list[object]] = []
    points: list[Vector] = []
    for level in range(levels):
        size = scene.needle.tip_radius / 2**level
        changes = {
            "mesh.refine.corridor_size": size,
            **one_contour_size(scene, size),
            "needle.tip": tip,
            "discretization.tip_quadrature_points": KERNEL_POINTS,
        }
        plan = planner_of(vary(scene, changes)).plan()
        cut = plan.level.puncture_depth
        row: list[object] = [1e3 * size, plan.level.model.ndofs, _digits(cut)]
        if plan.status is PlanStatus.PLANNED and plan.best is not None:
            points.append(plan.best.release_point)
            move = f"{100.0 * _move(points):.1e}" if len(points) > 1 else ""
            row += [*map(_digits, points[-1]), move]
        else:
            row += [""] * (scene.dim + 1)
        rows.append([*row, plan.status])
    moves = np.linalg.norm(np.diff(points, axis=0), axis=1)
    converges = len(moves) == levels - 1 and bool(
        moves[-1] <= LAST_MOVE and moves[-1] <= LAST_SHARE * moves[0]
    )
    return Table(
        title=f"planned release point under refinement, {tip} tip",
        columns=(
            "elements (mm)",
            "dofs",
            "skin cut at (cm)",
            *(f"{axis} (cm)" for axis in scene.axes),
            "move (cm)",
            "status",
        ),
        rows=rows,
        passed=converges or tip == "point",
        note="" if tip == "disc" else "a point tip does not converge, and loses its equilibrium",
    )


def _move(points: list[Vector]) -> float:
    return float(np.linalg.norm(points[-1] - points[-2]))


def _digits(length: float | None) -> str:
    return "never" if length is None else f"{100.0 * float(length):.5f}"


# The plan for each element of the catalogue: release point, cost and warnings.
#
# Each plan uses the element sizes of the case, and half of them. With half of the sizes, the plans
# of elements that do not lock at the case's Poisson's ratios must agree; the others are listed too.


AGREE = 2e-4
"""Largest distance between refined release points of elements that do not lock, m."""


def elements(scene: Scene, other: Scene | None = None) -> list[Table]:
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


# Influence of the numerical parameters on the plan.
#
# A plan with the case's own parameters is carried out with others: mesh, path spacing, lateral
# penalty, quadrature. The final position of the seed may change by 0.02 mm at most.


LARGEST_CHANGE = 2e-5
"""Largest change of the final position of the seed, m."""


def independence(scene: Scene, other: Scene | None = None) -> list[Table]:
    """Return the change of the seed's final position for all variations."""
    del other
    plan = planner_of(scene).plan()
    rows = []
    for name, changes in variations(resolve(scene).scene).items():
        reach = carry_out(vary(scene, changes), plan)
        moved = np.inf if reach is None else float(np.linalg.norm(reach.point - plan.target))
        rows.append([name, 100.0 * moved, moved <= LARGEST_CHANGE])
    return [
        Table(
            title="seed of the case's plan, simulated with other numerical parameters",
            columns=("varied", "seed moves (cm)", "at most 0.002 cm"),
            rows=rows,
            passed=all(row[2] for row in rows),
        )
    ]


def variations(scene: Scene) -> dict[str, dict[str, object]]:
    """Return the changes of a resolved scene by name."""
    spacing = scene.discretization.path_spacing
    penalty, points = scene.needle.lateral_penalty, scene.discretization.tip_quadrature_points
    found: dict[str, dict[str, object]] = {"nothing": {}}
    refine = scene.mesh.refine if isinstance(scene.mesh, BoxMesh) else Refinement()
    if refine.corridor_size > 0.0:
        found["elements x 1/2"] = {
            "mesh.refine.corridor_size": 0.5 * refine.corridor_size,
            **contour_sizes(scene, 0.5),
            "discretization.tip_quadrature_points": 4 * points,
        }
    for factor in (2.0, 0.5, 0.25):
        found[f"path spacing x {factor:g}"] = {"discretization.path_spacing": factor * spacing}
    for factor in (0.1, 10.0, 100.0):
        found[f"lateral penalty x {factor:g}"] = {"needle.lateral_penalty": factor * penalty}
    for factor in (2, 4):
        found[f"kernel points x {factor}"] = {
            "discretization.tip_quadrature_points": factor * points
        }
    return found


# Numerical noise in lateral error and depth as functions of the lateral offset.
#
# The second differences for many offsets at small distances show kinks where a contact point
# crosses an element edge. A search cannot resolve differences below this noise.


HEIGHTS = 200
LARGEST_NOISE = {5e-8: 1e-8, 5e-6: 1e-6}
"""Largest second difference (m) by the increment of the lateral offset (m)."""


def smoothness(scene: Scene, other: Scene | None = None) -> list[Table]:
    """Return the largest second differences around the planned lateral offset."""
    del other
    planner = planner_of(scene)
    planner.simulation.responses = CachedCompliance(planner.simulation.model)
    start = planner.plan().solution.height
    rows: list[list[object]] = []
    for apart, bound in LARGEST_NOISE.items():
        values = []
        for number in range(HEIGHTS):
            height = start + number * apart
            reading = planner.read(height).level()
            reach = reading.reach
            if reach is None:
                where = 100.0 * float(height[0])
                raise SimulationError(f"at an offset of {where:+.4g} cm, {reading.sentence}")
            values.append(
                [float((reach.point - planner.target) @ planner.laterals[0]), reach.depth]
            )
        second = np.abs(np.diff(np.array(values), 2, axis=0)).max(axis=0)
        rows.append(
            [
                1e6 * apart,
                100.0 * second[0],
                100.0 * second[1],
                100.0 * bound,
                bool(second.max() <= bound),
            ]
        )
    return [
        Table(
            title=f"largest second difference over {HEIGHTS} lateral offsets",
            columns=("increment (um)", "lateral error (cm)", "depth (cm)", "bound (cm)", "passed"),
            rows=rows,
            passed=all(bool(row[4]) for row in rows),
        )
    ]


# Placement error of a plan that is carried out on other models.
#
# The residual of a plan on its own model is 1e-6 cm, which does not measure its accuracy. Its error
# on another discretisation or with other parameters shows the error that must be expected.


def robust(scene: Scene, other: Scene | None = None) -> list[Table]:
    """Return the final positions of the seed for the case's plan on other models."""
    plan = planner_of(scene).plan()
    if plan.best is None:
        raise SimulationError(f"no plan to carry out: {plan.sentence}")
    elsewhere = {"the case itself": scene} | perturbed(scene)
    if other is not None:
        elsewhere[f"on '{other.title}'"] = other
    rows: list[list[object]] = []
    for name, executed in elsewhere.items():
        reach = carry_out(executed, plan)
        if reach is None:
            rows.append([name, "", "", "not reached"])
            continue
        miss = 100.0 * (reach.point - plan.target)
        rows.append(
            [name, *miss.tolist(), 100.0 * float(np.linalg.norm(reach.point - plan.target))]
        )
    return [
        Table(
            title="robust error: the case's plan, carried out on other models",
            columns=("carried out", *(f"error in {a} (cm)" for a in scene.axes), "error (cm)"),
            rows=rows,
        )
    ]


def perturbed(scene: Scene) -> dict[str, Scene]:
    """Return scenes with one parameter increased or decreased by 10 %."""
    names = {f"stiffness of {n}": f"materials.{n}.youngs_modulus" for n in scene.materials}
    names |= {"cutting force": "needle.cutting_force", "shaft friction": "needle.shaft_friction"}
    found = {}
    for name, path in names.items():
        value = field_of(scene, path)
        for sign, factor in (("+", 1.1), ("-", 0.9)):
            found[f"{name} {sign}10 %"] = vary(scene, {path: factor * value})
    return found
