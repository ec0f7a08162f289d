"""Checks of an element on its reference cell and two cells, and with a law in the plane."""

import dataclasses

import numpy as np
from scipy.linalg import eigh

from needlefem._arrays import Floats, Points
from needlefem.checks.mesh_checks import (
    patch_error,
    rigid_motion,
    traction_patch_error,
    zero_modes,
)
from needlefem.checks.models import (
    BOX,
    Manufactured,
    box_frequencies,
    distorted_mesh,
    eigenfrequencies,
    rectangle,
    sliding_box,
)
from needlefem.checks.result import CheckResult, outcome
from needlefem.elements import ElementType
from needlefem.elements.shape_functions import gauss, shape_table, simplex
from needlefem.errors import CaseError
from needlefem.fem.boundary_value_problem import BoundaryValueProblem
from needlefem.fem.function_space import FunctionSpace
from needlefem.materials import Isotropic, Material, VolumetricSplit, plane_volumetric_split
from needlefem.mesh.cell_map import refuse_bad_cells

SIMPLEX = ("triangle", "tetrahedron")


def check_shape(element: ElementType) -> tuple[CheckResult, ...]:
    """Return the results of all checks of an element's shape functions and quadrature rules."""
    return (
        nodal_functions(element),
        shape_gradients(element),
        completeness(element),
        continuity(element),
        rules(element),
        mass_rule(element),
    )


def _inside(element: ElementType) -> Points:
    """Return points inside the reference cell, shape (20, dim)."""
    random = np.random.default_rng(5)
    dim = element.nodes.shape[1]
    if element.cell in SIMPLEX:
        return random.dirichlet(np.ones(dim + 1), 20)[:, 1:]
    return random.uniform(0.0, 1.0, (20, dim))


def _values(element: ElementType, points: Points) -> Floats:
    scalar = element.skfem_element()
    return np.stack([scalar.lbasis(points.T, i)[0] for i in range(len(element.nodes))], axis=1)


def nodal_functions(element: ElementType) -> CheckResult:
    """Check that each function is 1 at its node, 0 at the others, and that their sum is 1."""
    at_nodes = np.abs(_values(element, element.nodes) - np.eye(len(element.nodes))).max()
    sums = np.abs(_values(element, _inside(element)).sum(axis=1) - 1.0).max()
    return CheckResult(
        name="nodal functions",
        requirement="each function is 1 at its own node, 0 at the others; the sum of all is 1",
        value=float(max(at_nodes, sums)),
        bound=1e-12,
    )


def shape_gradients(element: ElementType) -> CheckResult:
    """Check the gradients of the functions against central differences."""
    scalar, points, step = element.skfem_element(), _inside(element), 1e-5
    worst = 0.0
    for i in range(len(element.nodes)):
        gradient = np.broadcast_to(scalar.lbasis(points.T, i)[1], points.T.shape)
        for axis, move in enumerate(step * np.eye(points.shape[1])):
            ahead = scalar.lbasis((points + move).T, i)[0]
            behind = scalar.lbasis((points - move).T, i)[0]
            off = (ahead - behind) / (2.0 * step) - gradient[axis]
            worst = max(worst, float(np.abs(off).max()))
    return CheckResult(
        name="shape gradients",
        requirement="gradients are the derivatives of the functions",
        value=worst,
        bound=1e-7,
    )


def completeness(element: ElementType) -> CheckResult:
    """Check that polynomials of the declared degree are represented exactly."""
    points, worst = _inside(element), 0.0
    for power in np.ndindex(*[element.degree + 1] * points.shape[1]):
        if sum(power) <= element.degree:
            at_nodes = np.prod(element.nodes ** np.array(power), axis=1)
            exact = np.prod(points ** np.array(power), axis=1)
            worst = max(worst, float(np.abs(_values(element, points) @ at_nodes - exact).max()))
    return CheckResult(
        name="completeness",
        requirement="polynomials of the declared degree are represented exactly",
        value=worst,
        bound=1e-12,
    )


def continuity(element: ElementType) -> CheckResult:
    """Check that displacements are continuous across each edge for any dofs (2D)."""
    mesh = distorted_mesh(element, 3)
    space = FunctionSpace(mesh, element)
    field = np.random.default_rng(2).normal(size=space.nnodes)
    inner = np.flatnonzero(mesh.f2t[1] >= 0)
    ends = mesh.p[:, mesh.facets[:, inner]]
    shape = shape_table(element.skfem_element)
    worst = 0.0
    for share in (0.211, 0.5, 0.9):
        points = ((1.0 - share) * ends[:, 0] + share * ends[:, 1]).T
        sides = []
        for cells in mesh.f2t[:, inner]:
            local = space.interpolation.locator.map.invert(cells, points)
            sides.append(np.einsum("nk,nk->n", shape(local), field[space.cell_nodes[cells]]))
        worst = max(worst, float(np.abs(sides[0] - sides[1]).max()))
    return CheckResult(
        name="continuity",
        requirement="displacements of neighbouring cells agree on their common edge",
        value=worst,
        bound=1e-10,
    )


def _measure(element: ElementType) -> float:
    return {"triangle": 0.5, "tetrahedron": 1.0 / 6.0}.get(element.cell, 1.0)


def rules(element: ElementType) -> CheckResult:
    """Check that the weights of each rule sum to the measure of the reference cell."""
    used = [element.stiffness_rule, element.mass_rule, element.volume_rule]
    off = [abs(rule()[1].sum() / _measure(element) - 1.0) for rule in used if rule is not None]
    return CheckResult(
        name="quadrature weights",
        requirement="the weights of each rule sum to the measure of the reference cell",
        value=float(max(off)),
        bound=1e-12,
    )


def mass_rule(element: ElementType) -> CheckResult:
    """Check that the rule of M integrates products of shape functions exactly."""
    dim, high = element.nodes.shape[1], 2 * element.skfem_element().maxdeg
    fine = simplex(high, dim) if element.cell in SIMPLEX else gauss(high, dim)
    matrices = []
    for points, weights in (element.mass_rule(), fine()):
        values = _values(element, points.T)
        matrices.append(np.einsum("qi,q,qj->ij", values, weights, values))
    off = np.abs(matrices[0] - matrices[1]).max() / np.abs(matrices[1]).max()
    return CheckResult(
        name="mass rule",
        requirement="the rule of M integrates products of functions exactly",
        value=float(off),
        bound=1e-12,
    )


# Checks of an element together with a law, in the plane.


DISPERSION = {1: 0.3, 2: 5e-3}
"""Relative error of a frequency over ``(wave number times element size)^(2 degree)``.

A quarter above the largest of P1 and P2, the least accurate ones of their degrees, at nu = 0.45.
"""


def patches(
    element: ElementType, material: Material, plane: str, law: VolumetricSplit
) -> list[CheckResult]:
    """Return the patch tests (B. Irons, A. Razzaque 1972) for the element's degree."""
    mesh = distorted_mesh(element, 4)
    # round-off grows with the condition number of the system, about kappa over shear modulus
    bound = 1e-13 * max(10.0, law.kappa / law.shear)
    found = [
        outcome(
            "patch, displacement",
            "a linear displacement of the boundary gives a constant strain inside",
            patch_error(mesh, element, material, plane),
            bound,
        ),
        outcome(
            "patch, traction",
            "constant tractions give a constant strain",
            traction_patch_error(mesh, element, material, plane),
            10.0 * bound,
        ),
    ]
    if element.degree >= 2:
        found.append(
            outcome(
                "patch, bending",
                "a quadratic displacement of the boundary is represented exactly inside",
                bending_error(element, material, plane),
                bound,
            )
        )
    return found


def bending_error(element: ElementType, material: Material, plane: str = "strain") -> float:
    """Return the largest relative error of pure bending on a distorted mesh.

    ``u = x y, v = -(x^2 + b y^2) / 2`` with b from the law: the strain along x is linear in y, and
    the stress along y is zero (S. P. Timoshenko).
    """
    law = plane_volumetric_split(material, plane)
    stiffness = law.stiffness
    ratio = float(stiffness[0, 1] / stiffness[1, 1])
    field = Manufactured(
        lambda p: np.stack([p[:, 0] * p[:, 1], -0.5 * (p[:, 0] ** 2 + ratio * p[:, 1] ** 2)], 1),
        lambda p: np.zeros((len(p), 2, 2)),
        lambda p: np.broadcast_to(
            np.array([[[0.0, 1.0], [1.0, 0.0]], [[-1.0, 0.0], [0.0, -ratio]]]), (len(p), 2, 2, 2)
        ),
    )
    problem = BoundaryValueProblem(distorted_mesh(element, 4), element, material, plane)
    problem.fix(None, field.displacement).apply_body_force(field.body_force(stiffness))
    solved = problem.solve()
    exact = solved.space.dof_vector(field.displacement(solved.space.nodes))
    return float(np.abs(solved.u - exact).max() / np.abs(exact).max())


def modes(element: ElementType, material: Material, plane: str) -> list[CheckResult]:
    """Check the number of zero modes, and the force due to rigid motions."""
    model = rectangle(element, material, 3, plane=plane)
    return [
        outcome(
            "zero modes",
            "two translations and a rotation cause no force, all other motions do",
            abs(zero_modes(model) - 3),
            0.0,
        ),
        rigid_motion(model),
    ]


def masses(element: ElementType, material: Material, plane: str) -> list[CheckResult]:
    """Check total and sign of consistent and admissible lumped masses."""
    heavy = dataclasses.replace(material, density=1000.0)  # type: ignore[type-var]
    model = rectangle(element, heavy, 3, plane=plane)
    total = 1000.0 * model.dim
    off, least = [abs(model.mass.sum() / total - 1.0)], []
    for scheme in element.lumpings:
        lumped = model.lumped_mass(scheme)
        off.append(abs(lumped.sum() / total - 1.0))
        least.append(float(lumped.min() / lumped.max()))
    values = np.linalg.eigvalsh(model.mass.toarray())
    least.append(float(values[0] / values[-1]))
    return [
        outcome(
            "mass total",
            "the sum of consistent and lumped mass is that of the body",
            max(off),
            1e-12,
        ),
        outcome(
            "mass positive",
            "consistent and admissible lumped masses are positive",
            float(min(least) < 1e-9),
            0.0,
        ),
    ]


def bad_cells_refused(element: ElementType) -> CheckResult:
    """Check that concave, crossed or flat cells raise an error."""
    mesh = distorted_mesh(element, 3, 0.0)
    points = mesh.p.copy()
    points[:, mesh.t[0, 4]] = points[:, mesh.t[1 if mesh.t.shape[0] == 3 else 2, 4]]
    try:
        refuse_bad_cells(dataclasses.replace(mesh, doflocs=points), "mesh")
        passed = False
    except CaseError:
        passed = True
    return outcome(
        "bad cells refused", "flat, concave and crossed cells are refused", not passed, 0.0
    )


def inf_sup(element: ElementType, divisions: int) -> float:
    """Return the inf-sup constant of a mixed element on a square with fixed boundary.

    It is the square root of the smallest eigenvalue of ``B inv(A) B'`` relative to the mass matrix
    of the pressure, without the constant pressure (D. Chapelle, K.-J. Bathe 1993).
    """
    material = Isotropic(youngs_modulus=3.0, poissons_ratio=0.0)
    stiffness = BoundaryValueProblem(
        distorted_mesh(element, divisions), element, material
    ).stiffness
    space = BoundaryValueProblem(distorted_mesh(element, divisions), element, material).space
    free = np.setdiff1d(np.arange(space.ndofs), space.dofs_on(space.mesh.boundary_facets()))
    coupling = stiffness.coupling.tocsr()[:, free].toarray()
    inner = stiffness.matrix.tocsr()[free][:, free].toarray()
    mass = stiffness.pressures.mass(np.ones(space.mesh.nelements)).toarray()
    schur: Floats = coupling @ np.linalg.solve(inner, coupling.T)
    values = eigh(0.5 * (schur + schur.T), mass, eigvals_only=True)
    return float(np.sqrt(max(values[1], 0.0)))


def pressure_stability(element: ElementType) -> CheckResult:
    """Check that the pressure of a mixed element stays stable under refinement."""
    coarse, fine = inf_sup(element, 4), inf_sup(element, 8)
    return outcome(
        "pressure stability",
        "the inf-sup constant is not zero and does not decrease under refinement",
        coarse / fine if fine > 1e-6 else np.inf,
        1.25,
    )


def frequencies(element: ElementType, material: Material, plane: str) -> CheckResult:
    """Check the six lowest frequencies of a box with sliding sides against plane waves."""
    heavy = dataclasses.replace(material, density=1000.0)  # type: ignore[type-var]
    model = sliding_box(element, heavy, 16, plane)
    found = eigenfrequencies(model, 6)
    exact, number = box_frequencies(plane_volumetric_split(heavy, plane).stiffness, 1000.0, 6)
    degree = min(element.degree, max(DISPERSION))
    size = max(BOX) / 16.0
    allowed = DISPERSION[degree] * (number * size) ** (2 * degree)
    return outcome(
        "frequencies",
        "the six lowest frequencies of a sliding box are those of plane waves, up to dispersion",
        float(np.max(np.abs(found / exact - 1.0) / allowed)),
        1.0,
    )
