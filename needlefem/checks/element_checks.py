"""Properties of an element's own functions and rules, on its reference cell and two cells."""

import numpy as np

from needlefem._arrays import Floats, Points
from needlefem.checks.models import distorted_mesh
from needlefem.checks.result import CheckResult
from needlefem.elements import ElementType
from needlefem.elements.quadrature import gauss, simplex
from needlefem.elements.shape_functions import shape_table
from needlefem.fem.function_space import FunctionSpace

SIMPLEX = ("triangle", "tetrahedron")


def check_shape(element: ElementType) -> tuple[CheckResult, ...]:
    """Run all checks of an element's functions and rules."""
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
    scalar = element.make()
    return np.stack([scalar.lbasis(points.T, i)[0] for i in range(len(element.nodes))], axis=1)


def nodal_functions(element: ElementType) -> CheckResult:
    """Check that every function is 1 at its node, 0 at the others, and that they add up to 1."""
    at_nodes = np.abs(_values(element, element.nodes) - np.eye(len(element.nodes))).max()
    sums = np.abs(_values(element, _inside(element)).sum(axis=1) - 1.0).max()
    return CheckResult(
        name="nodal functions",
        requirement="each function is 1 at its own node, 0 at the others; all add up to 1",
        value=float(max(at_nodes, sums)),
        bound=1e-12,
    )


def shape_gradients(element: ElementType) -> CheckResult:
    """Check the gradients of the functions against central differences."""
    scalar, points, step = element.make(), _inside(element), 1e-5
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
    """Check that polynomials of the declared degree are met exactly."""
    points, worst = _inside(element), 0.0
    for power in np.ndindex(*[element.degree + 1] * points.shape[1]):
        if sum(power) <= element.degree:
            at_nodes = np.prod(element.nodes ** np.array(power), axis=1)
            exact = np.prod(points ** np.array(power), axis=1)
            worst = max(worst, float(np.abs(_values(element, points) @ at_nodes - exact).max()))
    return CheckResult(
        name="completeness",
        requirement="polynomials of the declared degree are met exactly",
        value=worst,
        bound=1e-12,
    )


def continuity(element: ElementType) -> CheckResult:
    """Check that displacements of any dofs agree on both sides of every edge (2D)."""
    mesh = distorted_mesh(element, 3)
    space = FunctionSpace(mesh, element)
    field = np.random.default_rng(2).normal(size=space.nnodes)
    inner = np.flatnonzero(mesh.f2t[1] >= 0)
    ends = mesh.p[:, mesh.facets[:, inner]]
    shape = shape_table(element.make)
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
        requirement="neighbouring cells agree on their common edge",
        value=worst,
        bound=1e-10,
    )


def _measure(element: ElementType) -> float:
    return {"triangle": 0.5, "tetrahedron": 1.0 / 6.0}.get(element.cell, 1.0)


def rules(element: ElementType) -> CheckResult:
    """Check that the weights of every rule add up to the reference cell."""
    used = [element.stiffness_rule, element.mass_rule, element.volume_rule]
    off = [abs(rule()[1].sum() / _measure(element) - 1.0) for rule in used if rule is not None]
    return CheckResult(
        name="quadrature weights",
        requirement="the weights of every rule add up to the reference cell",
        value=float(max(off)),
        bound=1e-12,
    )


def mass_rule(element: ElementType) -> CheckResult:
    """Check that the rule of M integrates products of functions exactly on the reference cell."""
    dim, high = element.nodes.shape[1], 2 * element.make().maxdeg
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
