"""Properties that an element and a law have together, in the plane."""

import dataclasses

import numpy as np
from scipy.linalg import eigh

from needlefem._arrays import Floats
from needlefem.checks.manufactured import Manufactured
from needlefem.checks.mesh_checks import (
    patch_error,
    rigid_motion,
    traction_patch_error,
    zero_modes,
)
from needlefem.checks.modal import BOX, box_frequencies, eigenfrequencies, sliding_box
from needlefem.checks.models import distorted_mesh, rectangle
from needlefem.checks.result import CheckResult, outcome
from needlefem.elements import ElementType
from needlefem.errors import CaseError
from needlefem.fem.boundary_value_problem import BoundaryValueProblem
from needlefem.materials import Isotropic, Material, VolumetricSplit, plane_volumetric_split
from needlefem.mesh.cell_map import refuse_bad_cells

DISPERSION = {1: 0.3, 2: 5e-3}
"""Relative error of a frequency over ``(wave number times element size)^(2 degree)``.

A quarter above the largest of P1 and P2, the least accurate of their degrees, at nu = 0.45.
"""


def patches(
    element: ElementType, material: Material, plane: str, law: VolumetricSplit
) -> list[CheckResult]:
    """Run the patch tests (B. Irons, A. Razzaque 1972) that the element's degree allows."""
    mesh = distorted_mesh(element, 4)
    # round-off grows with the condition of the system, which is kappa over shear
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
                "a quadratic displacement of the boundary is met exactly inside",
                bending_error(element, material, plane),
                bound,
            )
        )
    return found


def bending_error(element: ElementType, material: Material, plane: str = "strain") -> float:
    """Return the largest error of pure bending on a distorted mesh, relative.

    ``u = x y, v = -(x^2 + b y^2) / 2`` with b from the law: strain linear in y along x, no
    stress along y (S. P. Timoshenko).
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
    """Count the motions that cost nothing, and measure the force of rigid ones."""
    model = rectangle(element, material, 3, plane=plane)
    return [
        outcome(
            "zero modes",
            "two translations and a rotation cost nothing, and nothing else does",
            abs(zero_modes(model) - 3),
            0.0,
        ),
        rigid_motion(model),
    ]


def masses(element: ElementType, material: Material, plane: str) -> list[CheckResult]:
    """Check total and sign of consistent and admitted lumped masses."""
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
        outcome("mass total", "consistent and lumped mass add up to the body's", max(off), 1e-12),
        outcome(
            "mass positive",
            "consistent and admitted lumped masses are positive",
            float(min(least) < 1e-9),
            0.0,
        ),
    ]


def bad_cells_refused(element: ElementType) -> CheckResult:
    """Check that concave, crossed or flat cells of the element's mesh are refused."""
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
    """Return the inf-sup constant of a mixed element on a held square.

    The square root of the smallest eigenvalue of ``B inv(A) B'`` against the pressure's mass,
    the constant pressure left out (D. Chapelle, K.-J. Bathe 1993).
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
        "the inf-sup constant does not vanish, nor fall under refinement",
        coarse / fine if fine > 1e-6 else np.inf,
        1.25,
    )


def frequencies(element: ElementType, material: Material, plane: str) -> CheckResult:
    """Check the six lowest frequencies of a box whose sides slide, against plane waves."""
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
