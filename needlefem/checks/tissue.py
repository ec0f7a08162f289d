"""Properties of a discretised tissue: patch test, null space, reciprocity, energy identity."""

import numpy as np

from needlefem.arrays import Floats, SkfemMesh, Vector
from needlefem.checks.result import CheckResult
from needlefem.elements import ElementRow
from needlefem.fem import assembly
from needlefem.fem.factor import factorise
from needlefem.fem.model import Model
from needlefem.materials import Isotropic, Material


def linear_field(points: Floats) -> Floats:
    """Return a linear displacement with all strains and a rotation, at points (n, dim)."""
    dim = points.shape[1]
    gradient = 1e-2 * (np.arange(1, dim * dim + 1).reshape(dim, dim) - 2.5) / dim
    field: Floats = points @ gradient.T + 1e-3 * np.arange(1, dim + 1)
    return field


def patch_error(mesh: SkfemMesh, element: ElementRow, material: Material) -> float:
    """Return the largest relative error of a linear field prescribed on the whole boundary.

    The strain is then constant and must be met exactly inside, whatever the mesh
    (B. Irons, A. Razzaque 1972; O. C. Zienkiewicz, R. L. Taylor, The Finite Element Method).
    """
    basis = assembly.displacement_basis(mesh, element, element.stiffness_order)
    lam, mu = (np.full(mesh.nelements, value) for value in material.lame())
    matrix = assembly.stiffness(basis, lam, mu)
    exact = np.empty(basis.N)
    field = linear_field(basis.doflocs.T)
    components = np.empty(basis.N, dtype=np.intp)
    for axis in range(mesh.dim()):
        components[basis.element_dofs[axis :: mesh.dim()]] = axis
    exact = field[np.arange(basis.N), components]
    outer = basis.get_dofs().all()
    inner = np.setdiff1d(np.arange(basis.N), outer)
    rows = matrix[inner]
    solved = factorise(rows[:, inner]).solve(-(rows[:, outer] @ exact[outer]))
    return float(np.max(np.abs(solved - exact[inner])) / np.max(np.abs(exact)))


def patch(mesh: SkfemMesh, element: ElementRow, poissons_ratio: float) -> CheckResult:
    """Check the patch test with a uniform material.

    The bound leaves room for the round-off of large and stretched meshes; a wrong element
    misses by a thousandth and more.
    """
    material = Isotropic(youngs_modulus=1e4, poissons_ratio=poissons_ratio)
    return CheckResult(
        name="patch",
        requirement="a constant strain is met exactly, whatever the mesh",
        value=patch_error(mesh, element, material),
        bound=1e-9,
    )


def rigid_motion(model: Model) -> CheckResult:
    """Check that rigid motions of the tissue as it is cost no force."""
    matrix, motions = model.stiffness, model.rigid_motions
    force = np.linalg.norm(matrix @ motions, axis=0)
    scale = float(np.abs(matrix.data).max()) * np.linalg.norm(motions, axis=0)
    return CheckResult(
        name="rigid motion",
        requirement="translations and rotations cost no force",
        value=float(np.max(force / scale)),
        bound=1e-12,
    )


def zero_modes(model: Model) -> int:
    """Return how many eigenvalues of K, unsupported, are zero (below 1e-12 of the largest)."""
    values = np.linalg.eigvalsh(model.stiffness.toarray())
    return int(np.sum(np.abs(values) < 1e-12 * values[-1]))


def _mean_load(model: Model, point: Vector, direction: Vector) -> Floats:
    weights = model.interpolation.at(point[None])
    load = np.zeros(model.ndofs)
    load[model.node_dofs[weights.nodes]] = weights.rows[0][:, None] * direction
    return load


def _probe_loads(model: Model) -> Floats:
    """Return loads at two cells' centroids, one along every axis, shape (ndofs, 2 dim)."""
    count = model.mesh.nelements
    cells = [count // 3, (2 * count) // 3]
    centroids = model.mesh.p[:, model.mesh.t[:, cells]].mean(axis=1).T
    pairs = [(point, axis) for point in centroids for axis in np.eye(model.dim)]
    return np.stack([_mean_load(model, point, axis) for point, axis in pairs], axis=1)


def reciprocity(model: Model) -> CheckResult:
    """Check Betti's theorem: the response at A to a force at B is that at B to one at A."""
    forces = _probe_loads(model)
    responses = forces.T @ model.solve(forces)
    apart = np.abs(responses - responses.T).max() / np.abs(responses).max()
    return CheckResult(
        name="reciprocity",
        requirement="responses between two points are symmetric (Betti)",
        value=float(apart),
        bound=1e-9,
    )


def energy_identity(model: Model) -> CheckResult:
    """Check that strain energy changes by the mean force's work between two loaded states."""
    forces = _probe_loads(model)[:, :2] @ np.array([[1.0, 2.0], [3.0, -1.0]])
    moved = model.solve(forces)
    energy = 0.5 * np.einsum("ij,ij->j", moved, model.stiffness @ moved)
    work = 0.5 * (forces[:, 0] + forces[:, 1]) @ (moved[:, 1] - moved[:, 0])
    return CheckResult(
        name="energy identity",
        requirement="strain energy changes by the work of the mean force",
        value=float(abs(energy[1] - energy[0] - work) / np.max(energy)),
        bound=1e-10,
    )


def covering(model: Model) -> CheckResult:
    """Check that the cells cover the tissue once: their measures add up to what they enclose.

    scikit-fem takes the absolute value of the Jacobian, so that a cell which is turned over,
    and lies on its neighbours, passes silently.
    """
    mesh, dim = model.mesh, model.dim
    corners = np.moveaxis(mesh.p[:, mesh.t], 2, 0)
    cells = np.abs(np.linalg.det(corners[:, :, 1:] - corners[:, :, :1])).sum()
    outer = mesh.boundary_facets()
    facets = np.moveaxis(mesh.p[:, mesh.facets[:, outer]], 2, 0) - mesh.p.mean(axis=1)[:, None]
    inside = mesh.p[:, mesh.t[:, mesh.f2t[0, outer]]].mean(axis=1).T - mesh.p.mean(axis=1)
    local = np.concatenate([facets[:, :, 1:], inside[:, :, None]], axis=2) - facets[:, :, :1]
    enclosed = float(np.sum(np.sign(np.linalg.det(local)) * np.linalg.det(facets)) * (-1) ** dim)
    return CheckResult(
        name="covering",
        requirement="the cells cover the tissue once: none is turned over",
        value=float(abs(cells - enclosed) / cells),
        bound=1e-9,
    )


def cell_shape(model: Model) -> CheckResult:
    """Check that no cell is flat: its longest edge over its smallest height, roughly."""
    corners = np.moveaxis(model.mesh.p[:, model.mesh.t], 2, 0)
    edges = corners[:, :, 1:] - corners[:, :, :1]
    measure = np.abs(np.linalg.det(edges))
    longest = np.max(np.linalg.norm(edges, axis=1), axis=1)
    flatness = longest**model.dim / np.maximum(measure, 1e-300)
    return CheckResult(
        name="cell shape",
        requirement="no cell is flatter than 1 : 10,000",
        value=float(np.max(flatness)),
        bound=1e4,
    )


def preflight(model: Model) -> tuple[CheckResult, ...]:
    """Run the checks that a tissue must pass before it is planned on, in milliseconds."""
    ratio = max(material.poissons_ratio for material in _isotropic(model))
    return (
        covering(model),
        cell_shape(model),
        patch(model.mesh, model.element, ratio),
        rigid_motion(model),
        reciprocity(model),
        energy_identity(model),
    )


def _isotropic(model: Model) -> list[Isotropic]:
    return [material for material in model.materials.values() if isinstance(material, Isotropic)]
