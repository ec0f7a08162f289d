"""Accuracy of an element with a law: order of convergence, size of the error, locking."""

import dataclasses
import statistics
import time
from collections.abc import Callable, Sequence

import numpy as np

from needlefem._arrays import Floats, Points
from needlefem.checks.mesh_checks import NEARLY_INCOMPRESSIBLE
from needlefem.checks.models import GENERAL, ISOCHORIC, Manufactured, distorted_mesh, mapped_mesh
from needlefem.checks.reference_problem import Curve, Quantity
from needlefem.checks.result import CheckResult, outcome
from needlefem.elements import ElementType
from needlefem.fem.boundary_value_problem import BoundaryValueProblem, StaticSolution
from needlefem.materials import Isotropic, Material, VolumetricSplit, plane_volumetric_split

LOCKING = 6.0
"""Ratio of the error to that of the interpolant above which an element locks."""
ORDER_WITHIN = 0.15
"""Largest difference between an observed order of convergence and the theory."""
FINE = {1: 32, 2: 16}
"""Divisions of the finer mesh by degree; higher degrees use the last number."""


def solve_manufactured(
    element: ElementType,
    material: Material,
    field: Manufactured,
    divisions: int,
    plane: str = "strain",
) -> StaticSolution:
    """Solve on a distorted square with a traction on one side and fixed displacements elsewhere."""
    law = plane_volumetric_split(material, plane)
    # the field of an incompressible law has constant volume, and no pressure is needed
    stiffness = law.shape if law.compressibility == 0.0 else law.stiffness
    number = np.array([[0, 2], [2, 1]])
    tangent = stiffness[number[:, :, None, None], number[None, None]]

    def traction(points: Points, normals: Points) -> Floats:
        found: Floats = np.einsum("ijkl,nkl,nj->ni", tangent, field.gradient(points), normals)
        return found

    problem = BoundaryValueProblem(
        distorted_mesh(element, divisions, 0.2), element, material, plane
    )
    problem.fix(lambda x: x[:, 0] < 1.0 - 1e-9, field.displacement)
    problem.apply_traction(traction, lambda x: x[:, 0] > 1.0 - 1e-9)
    return problem.apply_body_force(field.body_force(stiffness)).solve()


def convergence(
    element: ElementType, material: Material, plane: str, law: VolumetricSplit
) -> list[CheckResult]:
    """Refine under a manufactured solution; check order and size of the error."""
    field = ISOCHORIC if law.poissons_ratio > 0.45 else GENERAL
    theory = np.array([element.degree + 1.0, element.degree])
    fine = FINE.get(element.degree, FINE[max(FINE)])
    solved = [solve_manufactured(element, material, field, n, plane) for n in (fine // 2, fine)]
    accuracy = over_interpolant(solved[-1], field)
    errors = [_errors(one, field) for one in solved]
    for count in (2 * fine, 4 * fine):  # orders are observed on sufficiently fine meshes only
        if np.all(np.abs(np.log2(errors[-2] / errors[-1]) - theory) <= ORDER_WITHIN):
            break
        errors.append(_errors(solve_manufactured(element, material, field, count, plane), field))
    off = np.abs(np.log2(errors[-2] / errors[-1]) - theory)
    found = [
        outcome(
            f"order, {name}",
            f"the error in {name} falls with power {order:g} of the element size",
            value,
            ORDER_WITHIN,
        )
        for name, order, value in zip(("L2", "H1"), theory, off, strict=True)
    ]
    sentence = f"the error is at most {LOCKING:g} times that of the interpolant"
    return [*found, outcome("accuracy", sentence, accuracy, LOCKING)]


def _errors(solved: StaticSolution, field: Manufactured) -> Floats:
    return np.array([solved.l2_error(field.displacement), solved.h1_error(field.gradient)])


def over_interpolant(solved: StaticSolution, field: Manufactured) -> float:
    """Return the ratio of the L2 error of a solution to that of the exact field's interpolant."""
    nodal = solved.space.dof_vector(field.displacement(solved.space.nodes))
    least = dataclasses.replace(solved, u=nodal).l2_error(field.displacement)
    return solved.l2_error(field.displacement) / least


def no_locking(element: ElementType) -> CheckResult:
    """Check that an element does not lock up to its declared limit of Poisson's ratio."""
    ratio = min(element.poissons_ratio_limit, NEARLY_INCOMPRESSIBLE)
    material = Isotropic(youngs_modulus=1.0, poissons_ratio=ratio)
    solved = solve_manufactured(element, material, ISOCHORIC, 16)
    return outcome(
        "no locking",
        f"at its limit, nu {ratio:g}, the error is at most {LOCKING:g} times the interpolant's",
        over_interpolant(solved, ISOCHORIC),
        LOCKING,
    )


def two_material_bar(
    element: ElementType, contrast: float, stress: float = 2.0
) -> tuple[float, float]:
    """Return the end's displacement of a compressed bar with a stiffer half, and the exact value.

    Uniaxial strain: ``stress (L1 / M1 + L2 / M2)`` with ``M = lambda + 2 mu``.
    """
    mesh = mapped_mesh(element, (8, 4), lambda square: square)
    left = np.flatnonzero(mesh.p[0, mesh.t].mean(axis=0) < 0.5)
    right = np.setdiff1d(np.arange(mesh.nelements), left)
    laws = {
        "left": Isotropic(youngs_modulus=1.0, poissons_ratio=0.3),
        "right": Isotropic(youngs_modulus=contrast, poissons_ratio=0.3),
    }
    named = mesh.with_subdomains({"left": left, "right": right})
    problem = BoundaryValueProblem(named, element, laws)
    problem.fix(lambda x: x[:, 0] < 1e-9, axes=[0])
    problem.fix(lambda x: np.abs(x[:, 1] - 0.5) > 0.5 - 1e-9, axes=[1])
    problem.apply_traction(lambda _, normals: stress * normals, lambda x: x[:, 0] > 1.0 - 1e-9)
    moved = float(problem.solve().at(np.array([[1.0, 0.5]]))[0, 0])
    moduli = [law.lame()[0] + 2.0 * law.lame()[1] for law in laws.values()]
    return moved, stress * (0.5 / moduli[0] + 0.5 / moduli[1])


# Errors under mesh refinement.


LONG_ENOUGH = 0.03
"""Duration from which a single timing is sufficient, s."""


def convergence_study(
    element: str,
    divisions: Sequence[int],
    solve: Callable[[int], StaticSolution],
    errors: Callable[[StaticSolution], dict[str, float]],
    orders: dict[str, float] | None = None,
) -> tuple[dict[str, Curve], StaticSolution]:
    """Solve on meshes with several divisions and return one curve per error.

    Parameters
    ----------
    element : str
    divisions : sequence of int
        Rising; the element size is its reciprocal.
    solve : callable
        Returns the solution on a mesh with a given number of divisions; it is timed.
    errors : callable
        Returns the errors of a solution by name.
    orders : dict, optional
        Theoretical order of each error.

    Returns
    -------
    Curves by the name of their error, and the finest solution.
    """
    rows: list[tuple[int, float, dict[str, float]]] = []
    for count in divisions:
        solved, seconds = _timed(solve, count)
        rows.append((solved.free, seconds, errors(solved)))
    curves = {
        quantity: Curve(
            element=element,
            quantity=quantity,
            sizes=tuple(1.0 / count for count in divisions),
            dofs=tuple(row[0] for row in rows),
            seconds=tuple(row[1] for row in rows),
            errors=tuple(row[2][quantity] for row in rows),
            order=(orders or {}).get(quantity),
        )
        for quantity in rows[0][2]
    }
    return curves, solved


def _timed(solve: Callable[[int], StaticSolution], count: int) -> tuple[StaticSolution, float]:
    """Return a solution and its time in seconds: the median of three if one is too short."""
    spent: list[float] = []
    while len(spent) < 3:
        start = time.perf_counter()
        solved = solve(count)
        spent.append(time.perf_counter() - start)
        if spent[0] > LONG_ENOUGH:
            break
    return solved, statistics.median(spent)


def order_answer(curve: Curve, within: float = 0.15) -> Quantity:
    """Return the observed order of convergence as a quantity with its theoretical value."""
    order = 0.0 if curve.order is None else curve.order
    return Quantity(
        label=f"{curve.element}: order of {curve.quantity}",
        value=curve.observed,
        reference=order,
        tolerance=within / order,
        recorded=False,
    )


def order_at_least(curve: Curve, within: float = 0.15) -> Quantity:
    """Return the observed order of convergence with the theoretical value as lower bound.

    For problems whose errors on coarse meshes are larger than the theory predicts, so that the
    errors decrease faster at first.
    """
    order = 0.0 if curve.order is None else curve.order
    return Quantity(
        label=f"{curve.element}: order of {curve.quantity}, no less",
        value=curve.observed,
        reference=order - within,
        at_least=True,
        recorded=False,
    )
