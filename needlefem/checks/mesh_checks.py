"""Properties of a discretised tissue: patch test, null space, reciprocity, energy identity."""

from collections.abc import Iterator, Mapping
from itertools import combinations
from typing import Protocol

import numpy as np

from needlefem._arrays import Floats, SkfemMesh, Vector
from needlefem.checks.result import CheckResult
from needlefem.elements import ElementType
from needlefem.fem.boundary_value_problem import BoundaryValueProblem, StaticSolution
from needlefem.fem.function_space import FunctionSpace
from needlefem.fem.stiffness import Stiffness
from needlefem.fem.tissue_model import TissueModel
from needlefem.geometry.contour import Contour
from needlefem.materials import Isotropic, Material, plane_volumetric_split, volumetric_split
from needlefem.materials.voigt import IN_PLANE, strain, tensor
from needlefem.mesh.cell_map import cell_corners, cell_measures, corner_jacobians
from needlefem.mesh.generation import cell_sizes
from needlefem.mesh.soundness import refuse_unsound
from needlefem.mesh.surface import Entry
from needlefem.scene import BoxMesh, Scene

NEARLY_INCOMPRESSIBLE = 0.499999
"""Stands for incompressible tissue where a check changes its volume."""
NO_RESPONSE = (
    "hold the tissue in [supports.NAME], but not all of it, and check the units of the moduli; "
    "if they are right, take smaller elements or another element"
)
"""What to do where responses of the tissue are wrong or none."""


def linear_gradient(dim: int) -> Floats:
    """Return the gradient of `linear_field`: all strains and a rotation."""
    return 1e-2 * (np.arange(1, dim * dim + 1).reshape(dim, dim) - 2.5) / dim


def linear_field(points: Floats) -> Floats:
    """Return a linear displacement with all strains and a rotation, at points (n, dim)."""
    dim = points.shape[1]
    field: Floats = points @ linear_gradient(dim).T + 1e-3 * np.arange(1, dim + 1)
    return field


def constant_stress(material: Material, gradient: Floats, plane: str = "strain") -> Floats:
    """Return the stress tensor, shape (dim, dim), of a displacement gradient, from the law."""
    dim = len(gradient)
    law = (
        volumetric_split(material) if dim == 3 else plane_volumetric_split(material, plane)
    ).stiffness
    whole = np.zeros((3, 3))
    whole[:dim, :dim] = gradient
    rows = np.arange(6) if dim == 3 else np.array(IN_PLANE)
    voigt = np.zeros(6)
    voigt[rows] = law @ strain(whole)[rows]
    found: Floats = tensor(voigt)[:dim, :dim]
    return found


def patch_error(
    mesh: SkfemMesh,
    element: ElementType,
    material: Material,
    plane: str = "strain",
    space: FunctionSpace | None = None,
) -> float:
    """Return the largest relative error of a linear field prescribed on the whole boundary.

    The strain is then constant and must be met exactly inside, whatever the mesh
    (B. Irons, A. Razzaque 1972; O. C. Zienkiewicz, R. L. Taylor, The Finite Element Method).
    """
    problem = BoundaryValueProblem(mesh, element, material, plane, space)
    return _off(problem.fix(None, linear_field).solve())


def traction_patch_error(
    mesh: SkfemMesh, element: ElementType, material: Material, plane: str = "strain"
) -> float:
    """Return the largest relative error of a linear field that tractions alone produce.

    Only rigid motions are held, at two nodes (three in space).
    """
    problem = BoundaryValueProblem(mesh, element, material, plane)
    stress = constant_stress(material, linear_gradient(mesh.dim()), plane)
    problem.apply_traction(lambda _, normals: normals @ stress.T)
    for node, axes in statically_determinate(problem.space.nodes):
        value = linear_field(problem.space.nodes[[node]])[0]
        problem.fix_node(node, [value[i] if i in axes else None for i in range(mesh.dim())])
    return _off(problem.solve())


def statically_determinate(nodes: Floats) -> list[tuple[int, tuple[int, ...]]]:
    """Return nodes and the axes to hold there, so that rigid motions alone are stopped."""
    dim = nodes.shape[1]
    low = int(np.argmin(nodes.sum(axis=1)))
    along = int(np.argmax(nodes[:, 0] - np.abs(nodes[:, 1:] - nodes[low, 1:]).sum(axis=1)))
    if dim == 2:
        return [(low, (0, 1)), (along, (1,))]
    beside = int(np.argmax(nodes[:, 1] - np.abs(nodes[:, [0, 2]] - nodes[low, [0, 2]]).sum(axis=1)))
    return [(low, (0, 1, 2)), (along, (1, 2)), (beside, (2,))]


def _off(solved: StaticSolution) -> float:
    exact = solved.space.dof_vector(linear_field(solved.space.nodes))
    return float(np.max(np.abs(solved.u - exact)) / np.max(np.abs(exact)))


def patch(model: TissueModel) -> CheckResult:
    """Check the patch test on the model's mesh with its least compressible law throughout.

    The bound leaves room for the round-off of large and stretched meshes; a wrong element
    misses by a thousandth and more.
    """
    worst = max(model.materials.values(), key=lambda m: volumetric_split(m).poissons_ratio)
    if plane_volumetric_split(worst, model.plane).compressibility == 0.0:
        worst = Isotropic(youngs_modulus=1e4, poissons_ratio=NEARLY_INCOMPRESSIBLE)
    return CheckResult(
        name="patch",
        requirement="a constant strain is met exactly, whatever the mesh",
        value=patch_error(model.mesh, model.element, worst, model.plane, model),
        bound=1e-9,
    )


def rigid_motion(model: TissueModel) -> CheckResult:
    """Check that rigid motions of the tissue as it is cost no force."""
    stiffness, motions = model.stiffness, model.rigid_motions
    force = np.linalg.norm(stiffness.matrix @ motions, axis=0)
    scale = float(np.abs(stiffness.matrix.data).max()) * np.linalg.norm(motions, axis=0)
    if not model.element.definite:  # nor do they change the volume
        gained = np.linalg.norm(stiffness.coupling @ motions, axis=0)
        volume = float(np.abs(stiffness.coupling.data).max()) * np.linalg.norm(motions, axis=0)
        force, scale = np.append(force, gained), np.append(scale, volume)
    return CheckResult(
        name="rigid motion",
        requirement="translations and rotations cost no force",
        value=float(np.max(force / scale)),
        bound=1e-12,
    )


def spectrum(stiffness: Stiffness) -> Floats:
    """Return the eigenvalues of K, unsupported, over the largest, rising (small problems)."""
    dense = stiffness.dense()
    values = np.linalg.eigvalsh(0.5 * (dense + dense.T))
    return np.asarray(values / values[-1], dtype=float)


def zero_modes(model: TissueModel) -> int:
    """Return how many eigenvalues of K, unsupported, are zero (below 1e-12 of the largest)."""
    return int(np.sum(np.abs(spectrum(model.stiffness)) < 1e-12))


def _probe_loads(model: TissueModel) -> Floats:
    """Return loads at two cells' centroids, one along every axis, shape (ndofs, 2 dim).

    The first cells from a third and from two thirds of the mesh on of which nothing is held.
    """
    held = np.zeros(model.ndofs, dtype=bool)
    held[model.held_dofs] = True
    loose = np.flatnonzero(~held[model.node_dofs[model.cell_nodes]].any(axis=(1, 2)))
    if not loose.size:
        loose = np.arange(model.mesh.nelements)
    wanted = np.arange(1, 3) * model.mesh.nelements // 3
    cells = loose[np.minimum(np.searchsorted(loose, wanted), len(loose) - 1)]
    weights = model.interpolation.at(model.mesh.p[:, model.mesh.t[:, cells]].mean(axis=1).T)
    loads = np.zeros((model.ndofs, 2, model.dim))
    for axis, dofs in enumerate(model.node_dofs[weights.nodes].T):
        loads[dofs, :, axis] = weights.rows.T
    return loads.reshape(model.ndofs, -1)


def _relative(error: float, largest: float) -> float:
    """Return a relative error; not a number where tissue that does not move has no response."""
    return float(error / largest) if largest > 0.0 else float("nan")


def reciprocity(model: TissueModel) -> CheckResult:
    """Check Betti's theorem: the response at A to a force at B is that at B to one at A."""
    forces = _probe_loads(model)
    return _reciprocity(forces, model.solve(forces))


def _reciprocity(forces: Floats, moved: Floats) -> CheckResult:
    responses = forces.T @ moved
    apart = _relative(np.abs(responses - responses.T).max(), np.abs(responses).max())
    return CheckResult(
        name="reciprocity",
        requirement="responses between two points are symmetric (Betti)",
        value=apart,
        bound=1e-9,
        remedy=NO_RESPONSE,
    )


def energy_identity(model: TissueModel) -> CheckResult:
    """Check that strain energy changes by the mean force's work between two loaded states."""
    loads = _probe_loads(model)[:, :2]
    return _energy_identity(model, loads, model.solve(loads))


def _energy_identity(model: TissueModel, loads: Floats, responses: Floats) -> CheckResult:
    states = np.array([[1.0, 2.0], [3.0, -1.0]])
    forces, moved = loads @ states, responses @ states
    energy = model.stiffness.energy(moved)
    work = 0.5 * (forces[:, 0] + forces[:, 1]) @ (moved[:, 1] - moved[:, 0])
    return CheckResult(
        name="energy identity",
        requirement="strain energy changes by the work of the mean force",
        value=_relative(abs(energy[1] - energy[0] - work), np.max(energy)),
        bound=1e-10,
        remedy=NO_RESPONSE,
    )


def covering(model: TissueModel) -> CheckResult:
    """Check that the cells cover the tissue once: their measures add up to what they enclose.

    scikit-fem takes the absolute value of the Jacobian, so that a cell which is turned over,
    and lies on its neighbours, passes silently.
    """
    mesh, dim = model.mesh, model.dim
    cells = cell_measures(mesh).sum()
    outer = mesh.boundary_facets()
    facets = np.moveaxis(mesh.p[:, mesh.facets[:, outer]], 2, 0) - mesh.p.mean(axis=1)[:, None]
    facets = facets[:, :, :dim]
    inside = mesh.p[:, mesh.t[:, mesh.f2t[0, outer]]].mean(axis=1).T - mesh.p.mean(axis=1)
    local = np.concatenate([facets[:, :, 1:], inside[:, :, None]], axis=2) - facets[:, :, :1]
    enclosed = float(np.sum(np.sign(np.linalg.det(local)) * np.linalg.det(facets)) * (-1) ** dim)
    enclosed /= 2.0 if dim == 2 else 6.0
    return CheckResult(
        name="covering",
        requirement="the cells cover the tissue once: none is turned over",
        value=float(abs(cells - enclosed) / cells),
        bound=1e-9,
    )


def cell_shape(model: TissueModel) -> CheckResult:
    """Check that no cell is flat or concave: squared longest edge over the smallest Jacobian."""
    corners = cell_corners(model.mesh)
    longest = np.max(np.linalg.norm(corners - corners[:, :1], axis=2), axis=1)
    jacobians = corner_jacobians(model.mesh)
    least = np.min(jacobians * np.sign(jacobians.sum(axis=1))[:, None], axis=1)
    flatness = longest**model.dim / np.maximum(least, 1e-300)
    return CheckResult(
        name="cell shape",
        requirement="no cell is concave, or flatter than 1 : 10,000",
        value=float(np.max(flatness)),
        bound=1e4,
    )


def overlaps(mesh: SkfemMesh, contours: Mapping[str, Contour]) -> Iterator[str]:
    """Yield a sentence for regions that overlap by more than a cell, neither in the other.

    A region inside an earlier one is meant to replace it there and is not told.

    Parameters
    ----------
    mesh : skfem.Mesh
    contours : mapping of str to Contour
        Of the regions, in the order of the case.
    """
    centroids: Floats | None = None
    for (one, first), (other, second) in combinations(contours.items(), 2):
        low = np.maximum(first.points.min(axis=0), second.points.min(axis=0))
        high = np.minimum(first.points.max(axis=0), second.points.max(axis=0))
        if np.any(low >= high):
            continue
        if centroids is None:
            centroids = mesh.p[:, mesh.t].mean(axis=1).T
        later = second.contains(centroids)
        both = later & first.contains(centroids)
        if np.count_nonzero(both) > 1 and np.count_nonzero(later & ~both) > 1:
            area = 1e6 * float(cell_measures(mesh)[both].sum())
            yield (
                f"regions '{one}' and '{other}' overlap in {np.count_nonzero(both)} cells "
                f"({area:.3g} mm^2), which belong to '{other}', the later one"
            )


def preflight(model: TissueModel) -> tuple[CheckResult, ...]:
    """Run the checks that a tissue must pass before it is planned on, in milliseconds.

    Raises
    ------
    CaseError
        The mesh is not one body whose cells cover it once; see `refuse_unsound`.
    """
    refuse_unsound(model.mesh, "mesh")
    first = covering(model), cell_shape(model), patch(model), rigid_motion(model)
    loads = _probe_loads(model)
    responses = model.solve(loads)
    return (
        *first,
        _reciprocity(loads, responses),
        _energy_identity(model, loads[:, :2], responses[:, :2]),
    )


# Properties of a scene's needle on its mesh, and what these checks know of a simulation.


SAMPLES = 200
"""Points of the needle's line at which cells are looked up."""


class NeedleInTissue(Protocol):
    """A scene's needle and tissue, ready for insertions."""

    scene: Scene
    model: TissueModel
    direction: Vector

    def reach(self, entry: Entry) -> float:
        """Return the largest depth of the scene's motion that is in the tissue, m."""
        ...


def sizes_along(simulation: NeedleInTissue, entry: Entry) -> Vector:
    """Return the sizes of the cells that a needle meets, m; empty if it meets none.

    The cells on its line count, as deep as the scene's motion goes.
    """
    model = simulation.model
    depths = np.linspace(0.0, simulation.reach(entry), SAMPLES)[1:]
    line = entry.point + depths[:, None] * simulation.direction
    cells = model.interpolation.locator.find(line)[0]
    found: Vector = cell_sizes(model.mesh)[np.unique(cells[cells >= 0])]
    return found


def needle_resolution(simulation: NeedleInTissue, entry: Entry) -> CheckResult:
    """Check that the mesh is not blind to the needle: elements of at most four tip radii.

    Accurate answers need nodes half a tip radius apart, of which `resolve` warns; beyond four
    radii the mesh alone decides where the needle goes. The cells on the needle's own line count.
    """
    radius, largest = simulation.scene.needle.tip_radius, sizes_along(simulation, entry)
    size = float(largest.max(initial=0.0)) if largest.size else np.inf
    if isinstance(simulation.scene.mesh, BoxMesh):
        finer = f'set mesh.refine.corridor_size to "{5e2 * radius:.2g} mm"'
    else:
        finer = "make the mesh file finer there, or check mesh.unit"
    return CheckResult(
        name="needle resolution",
        requirement="elements along the needle are at most four tip radii large",
        value=size / radius,
        bound=4.0,
        remedy=f"the elements there have up to {1e3 * size:.3g} mm, the tip's radius is "
        f"{1e3 * radius:.3g} mm: {finer}",
    )
