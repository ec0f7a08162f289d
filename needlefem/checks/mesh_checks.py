"""Checks of a discretised tissue (the preflight), and of a needle on its mesh."""

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
"""Poisson's ratio instead of 1/2 in checks that change the volume of incompressible tissue."""
NO_RESPONSE = (
    "add supports [supports.NAME] that leave a part of the tissue free, and check the units of the "
    "moduli; if they are correct, use smaller elements or another element"
)
"""Remedy if the compliance of the tissue is wrong or zero."""


def linear_gradient(dim: int) -> Floats:
    """Return the gradient of `linear_field`, which contains all strains and a rotation."""
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
    """Return the largest relative error for a linear field prescribed on the boundary.

    The strain is then constant and must be represented exactly inside of any mesh
    (B. Irons, A. Razzaque 1972; O. C. Zienkiewicz, R. L. Taylor, The Finite Element Method).
    """
    problem = BoundaryValueProblem(mesh, element, material, plane, space)
    return _off(problem.fix(None, linear_field).solve())


def traction_patch_error(
    mesh: SkfemMesh, element: ElementType, material: Material, plane: str = "strain"
) -> float:
    """Return the largest relative error of a linear field that is caused by tractions alone.

    Only rigid motions are fixed, at two nodes (three in 3D).
    """
    problem = BoundaryValueProblem(mesh, element, material, plane)
    stress = constant_stress(material, linear_gradient(mesh.dim()), plane)
    problem.apply_traction(lambda _, normals: normals @ stress.T)
    for node, axes in statically_determinate(problem.space.nodes):
        value = linear_field(problem.space.nodes[[node]])[0]
        problem.fix_node(node, [value[i] if i in axes else None for i in range(mesh.dim())])
    return _off(problem.solve())


def statically_determinate(nodes: Floats) -> list[tuple[int, tuple[int, ...]]]:
    """Return nodes and axes whose supports prevent rigid motions only."""
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
    """Check the patch test on the model's mesh, with its least compressible law everywhere.

    The bound allows for the round-off of large and distorted meshes; the error of a wrong element
    is a thousandth or more.
    """
    worst = max(model.materials.values(), key=lambda m: volumetric_split(m).poissons_ratio)
    if plane_volumetric_split(worst, model.plane).compressibility == 0.0:
        worst = Isotropic(youngs_modulus=1e4, poissons_ratio=NEARLY_INCOMPRESSIBLE)
    return CheckResult(
        name="patch",
        requirement="a constant strain is represented exactly on any mesh",
        value=patch_error(model.mesh, model.element, worst, model.plane, model),
        bound=1e-9,
    )


def rigid_motion(model: TissueModel) -> CheckResult:
    """Check that rigid motions of the unsupported tissue cause no force."""
    stiffness, motions = model.stiffness, model.rigid_motions
    force = np.linalg.norm(stiffness.matrix @ motions, axis=0)
    scale = float(np.abs(stiffness.matrix.data).max()) * np.linalg.norm(motions, axis=0)
    if not model.element.definite:  # they must not change the volume either
        gained = np.linalg.norm(stiffness.coupling @ motions, axis=0)
        volume = float(np.abs(stiffness.coupling.data).max()) * np.linalg.norm(motions, axis=0)
        force, scale = np.append(force, gained), np.append(scale, volume)
    return CheckResult(
        name="rigid motion",
        requirement="translations and rotations cause no force",
        value=float(np.max(force / scale)),
        bound=1e-12,
    )


def spectrum(stiffness: Stiffness) -> Floats:
    """Return the eigenvalues of K without supports, relative to the largest, rising (small K)."""
    dense = stiffness.dense()
    values = np.linalg.eigvalsh(0.5 * (dense + dense.T))
    return np.asarray(values / values[-1], dtype=float)


def zero_modes(model: TissueModel) -> int:
    """Return the number of zero eigenvalues of K without supports (below 1e-12 of the largest)."""
    return int(np.sum(np.abs(spectrum(model.stiffness)) < 1e-12))


def _probe_loads(model: TissueModel) -> Floats:
    """Return unit loads along all axes at the centroids of two cells, shape (ndofs, 2 dim).

    The cells are the first free ones after a third and after two thirds of the mesh.
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
    """Return a relative error, or NaN if the tissue does not move."""
    return float(error / largest) if largest > 0.0 else float("nan")


def reciprocity(model: TissueModel) -> CheckResult:
    """Check Betti's theorem: displacement at A due to a force at B, and the reverse, are equal."""
    forces = _probe_loads(model)
    return _reciprocity(forces, model.solve(forces))


def _reciprocity(forces: Floats, moved: Floats) -> CheckResult:
    responses = forces.T @ moved
    apart = _relative(np.abs(responses - responses.T).max(), np.abs(responses).max())
    return CheckResult(
        name="reciprocity",
        requirement="the compliance between two points is symmetric (Betti)",
        value=apart,
        bound=1e-9,
        remedy=NO_RESPONSE,
    )


def energy_identity(model: TissueModel) -> CheckResult:
    """Check that the change of strain energy equals the work of the mean force."""
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
    """Check that the sum of the cells' measures equals the measure of the enclosed region.

    scikit-fem uses the absolute value of the Jacobian, so that an inverted cell, which overlaps its
    neighbours, would not be detected.
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
        requirement="the cells cover the tissue once: none is inverted",
        value=float(abs(cells - enclosed) / cells),
        bound=1e-9,
    )


def cell_shape(model: TissueModel) -> CheckResult:
    """Check that no cell is flat or concave, by squared longest edge over smallest Jacobian."""
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
    """Yield a sentence for each pair of regions that overlap by more than a cell.

    A region inside of an earlier one replaces it there on purpose; no sentence is returned.

    Parameters
    ----------
    mesh : skfem.Mesh
    contours : mapping of str to Contour
        Contours of the regions in the order of the case.
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
    """Return the results of the checks before an insertion or a plan; they take milliseconds.

    Raises
    ------
    CaseError
        The mesh is not one body without overlaps; see `refuse_unsound`.
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


# Checks of a scene's needle on its mesh.


SAMPLES = 200
"""Number of points on the insertion axis whose cells are searched."""


class NeedleInTissue(Protocol):
    """A scene's needle and tissue for insertions."""

    scene: Scene
    model: TissueModel
    direction: Vector

    def reach(self, entry: Entry) -> float:
        """Return the largest depth of the scene's motion inside of the tissue, m."""
        ...


def sizes_along(simulation: NeedleInTissue, entry: Entry) -> Vector:
    """Return the sizes of the cells on the insertion axis, m; empty if there are none.

    Cells up to the largest depth of the scene's motion are considered.
    """
    model = simulation.model
    depths = np.linspace(0.0, simulation.reach(entry), SAMPLES)[1:]
    line = entry.point + depths[:, None] * simulation.direction
    cells = model.interpolation.locator.find(line)[0]
    found: Vector = cell_sizes(model.mesh)[np.unique(cells[cells >= 0])]
    return found


def needle_resolution(simulation: NeedleInTissue, entry: Entry) -> CheckResult:
    """Check that the elements along the needle are at most four tip radii large.

    Accurate results need a node distance of half a tip radius, for which `resolve` gives a warning.
    Above four radii the mesh determines the path of the needle. Only cells on the insertion axis
    are considered.
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
