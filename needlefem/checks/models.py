"""Simple tissues, manufactured solutions and eigenfrequencies for checks and problems."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from needlefem._arrays import Bools, Floats, Points, SkfemMesh
from needlefem.dynamics import TissueSystem
from needlefem.dynamics.system import modes
from needlefem.elements import ElementType
from needlefem.elements.shape_functions import gauss, simplex
from needlefem.fem.tissue_model import TissueModel
from needlefem.materials import Material
from needlefem.mesh.generation import BACKGROUND, box, curved, name_faces, name_regions
from needlefem.scene import Support

ONE_SIDE: Mapping[str, Support] = {"one side": Support(faces=("y_min",))}


def square_mesh(
    element: ElementType, divisions: int, size: tuple[float, float] = (1.0, 1.0)
) -> SkfemMesh:
    """Return a mesh of a rectangle at the origin with the element's kind of cells."""
    pattern = "quadrilateral" if element.cell == "quadrilateral" else "diagonal"
    return box((0.0, 0.0), size, (divisions, divisions), pattern)


def mapped_mesh(
    element: ElementType,
    divisions: tuple[int, int],
    place: Callable[[Points], Points],
    *,
    bent: bool = False,
) -> SkfemMesh:
    """Return a grid of the unit square, mapped by a function from (n, 2) to (n, 2).

    Any shape with four sides is possible. With `bent`, midside nodes are mapped as well, so that
    cells have curved edges.
    """
    pattern = "quadrilateral" if element.cell == "quadrilateral" else "diagonal"
    mesh = box((0.0, 0.0), (1.0, 1.0), divisions, pattern)
    mesh = curved(mesh) if bent else mesh
    return type(mesh)(np.ascontiguousarray(place(mesh.p.T).T), mesh.t)


def for_bent_cells(element: ElementType) -> ElementType:
    """Return the element with a finer rule; on curved cells its own would be a reduced one."""
    rule = simplex(6) if element.cell == "triangle" else gauss(4)
    return dataclasses.replace(element, stiffness_rule=rule)


def joined(parts: Sequence[SkfemMesh]) -> SkfemMesh:
    """Return one mesh of several meshes with common edges; coincident points are merged."""
    points = np.hstack([part.p for part in parts])
    starts = np.cumsum([0, *(part.nvertices for part in parts)])
    cells = np.hstack([part.t + start for part, start in zip(parts, starts, strict=False)])
    near = np.round(points / np.ptp(points), 9) + 0.0  # -0.0 and 0.0 become equal
    _, first, number = np.unique(near, axis=1, return_index=True, return_inverse=True)
    return type(parts[0])(np.ascontiguousarray(points[:, first]), number.ravel()[cells])


def distorted_mesh(element: ElementType, divisions: int, share: float = 0.3) -> SkfemMesh:
    """Return the unit square with inner vertices moved by up to `share` of a division."""
    mesh = square_mesh(element, divisions)
    inner = np.setdiff1d(np.arange(mesh.nvertices), mesh.boundary_nodes())
    points = mesh.p.copy()
    moves = np.random.default_rng(1).uniform(-1.0, 1.0, (2, len(inner)))
    points[:, inner] += share / divisions * moves
    return type(mesh)(points, mesh.t)


def rectangle(
    element: ElementType,
    material: Material,
    divisions: int,
    size: tuple[float, float] = (1.0, 1.0),
    supports: Mapping[str, Support] = ONE_SIDE,
    *,
    plane: str = "strain",
) -> TissueModel:
    """Return a uniform rectangle of the element's cells with `divisions` along each side."""
    mesh = square_mesh(element, divisions, size)
    named = name_faces(name_regions(mesh, {}), ("y", "z"))
    return TissueModel(named, element, {BACKGROUND: material}, supports, ("y", "z"), plane=plane)


def tissue(
    mesh: SkfemMesh,
    element: ElementType,
    material: Material,
    held: Callable[[Points], Bools] | None = None,
    *,
    plane: str = "strain",
) -> TissueModel:
    """Return a tissue of one material on a mesh, fixed at outer edges selected by midpoints.

    Without `held` the tissue has no supports.
    """
    named = name_regions(mesh, {})
    if held is None:
        return TissueModel(named, element, {BACKGROUND: material}, {}, ("y", "z"), plane=plane,
                     floating=True)  # fmt: skip
    outer = mesh.boundary_facets()
    chosen = outer[held(mesh.p[:, mesh.facets[:, outer]].mean(axis=1).T)]
    named = named.with_boundaries({"held": chosen})
    supports = {"held": Support(faces=("held",))}
    return TissueModel(named, element, {BACKGROUND: material}, supports, ("y", "z"), plane=plane)


# Smooth displacement fields with known derivatives. Each of them is an exact solution under its own
# body force (manufactured solutions, P. J. Roache 2002).


PI = np.pi


@dataclasses.dataclass(frozen=True)
class Manufactured:
    """A displacement field on the unit square.

    Parameters
    ----------
    displacement : callable
        At points (n, 2), shape (n, 2).
    gradient : callable
        ``du_i / dx_j``, shape (n, 2, 2).
    hessian : callable
        ``d2u_i / dx_j dx_k``, shape (n, 2, 2, 2).
    """

    displacement: Callable[[Points], Floats]
    gradient: Callable[[Points], Floats]
    hessian: Callable[[Points], Floats]

    def body_force(self, stiffness: Floats) -> Callable[[Points], Floats]:
        """Return the body force of the field for a Voigt stiffness (3, 3), at points (n, 2)."""
        number = np.array([[0, 2], [2, 1]])
        tangent = stiffness[number[:, :, None, None], number[None, None]]

        def force(points: Points) -> Floats:
            found: Floats = -np.einsum("ijkl,nkjl->ni", tangent, self.hessian(points))
            return found

        return force


def _waves(points: Points) -> tuple[Floats, Floats, Floats, Floats, Floats, Floats]:
    x, y = points.T
    return x, y, np.sin(PI * x), np.cos(PI * x), np.sin(PI * y), np.cos(PI * y)


def _displacement(points: Points) -> Floats:
    x, y, sx, cx, sy, _ = _waves(points)
    return np.stack([sx * sy + x * y / 5.0, cx * y * (1.0 - y) + x**2 / 3.0], axis=1)


def _gradient(points: Points) -> Floats:
    x, y, sx, cx, sy, cy = _waves(points)
    first = np.stack([PI * cx * sy + y / 5.0, PI * sx * cy + x / 5.0], axis=1)
    second = np.stack([-PI * sx * y * (1.0 - y) + 2.0 * x / 3.0, cx * (1.0 - 2.0 * y)], axis=1)
    return np.stack([first, second], axis=1)


def _hessian(points: Points) -> Floats:
    _, y, sx, cx, sy, cy = _waves(points)
    one = PI**2 * cx * cy + 0.2
    two = -PI * sx * (1.0 - 2.0 * y)
    first = [[-(PI**2) * sx * sy, one], [one, -(PI**2) * sx * sy]]
    second = [[-(PI**2) * cx * y * (1.0 - y) + 2.0 / 3.0, two], [two, -2.0 * cx]]
    return np.moveaxis(np.array([first, second]), 3, 0)


GENERAL = Manufactured(_displacement, _gradient, _hessian)
"""``(sin pi x sin pi y + x y / 5, cos pi x y (1 - y) + x^2 / 3)``: general, with volume change."""


def _turning(points: Points) -> Floats:
    _, _, sx, cx, sy, cy = _waves(points)
    return np.stack([sx * cy, -cx * sy], axis=1)


def _turning_gradient(points: Points) -> Floats:
    _, _, sx, cx, sy, cy = _waves(points)
    rows = [[cx * cy, -sx * sy], [sx * sy, -cx * cy]]
    return PI * np.moveaxis(np.array(rows), 2, 0)


def _turning_hessian(points: Points) -> Floats:
    _, _, sx, cx, sy, cy = _waves(points)
    first = [[-sx * cy, -cx * sy], [-cx * sy, -sx * cy]]
    second = [[cx * sy, sx * cy], [sx * cy, cx * sy]]
    return PI**2 * np.moveaxis(np.array([first, second]), 3, 0)


ISOCHORIC = Manufactured(_turning, _turning_gradient, _turning_hessian)
"""``(sin pi x cos pi y, -cos pi x sin pi y)``: constant volume, for the detection of locking."""


# Eigenfrequencies of a tissue.


def eigenfrequencies(model: TissueModel, count: int) -> Floats:
    """Return the lowest angular frequencies of the supported tissue, shape (count,), 1/s."""
    return modes(TissueSystem(model), count)[0]


BOX = (1.5, 1.0)
"""Sides of the sliding box; its lowest frequencies are all different."""


def sliding_box(
    element: ElementType, material: Material, divisions: int, plane: str = "strain"
) -> TissueModel:
    """Return a box whose sides slide without friction."""
    supports = {
        "across": Support(faces=("y_min", "y_max"), fixed=("y",)),
        "along": Support(faces=("z_min", "z_max"), fixed=("z",)),
    }
    return rectangle(element, material, divisions, BOX, supports, plane=plane)


def box_frequencies(stiffness: Floats, density: float, count: int) -> tuple[Floats, Floats]:
    """Return the lowest angular frequencies of the sliding box, 1/s, and wave numbers, 1/m.

    ``(A sin kx x cos ky y, B cos kx x sin ky y)`` satisfies all conditions if shear and normal
    strains are not coupled: two waves for each pair of wave numbers (E. B. Christoffel 1877).
    """
    waves: list[tuple[float, float]] = []
    for i, j in np.ndindex(count + 1, count + 1):
        k, m = np.pi * i / BOX[0], np.pi * j / BOX[1]
        mixed = (stiffness[0, 1] + stiffness[2, 2]) * k * m
        first = stiffness[0, 0] * k**2 + stiffness[2, 2] * m**2
        second = stiffness[1, 1] * m**2 + stiffness[2, 2] * k**2
        if i and j:
            both = np.linalg.eigvalsh([[first, mixed], [mixed, second]])
            waves += [(float(square), float(np.hypot(k, m))) for square in both]
        elif i or j:  # a pressure wave along an axis; the shear wave violates the side conditions
            waves.append((float(first if i else second), float(np.hypot(k, m))))
    lowest = np.array(sorted(waves)[:count])
    return np.sqrt(lowest[:, 0] / density), lowest[:, 1]
