"""Plain tissues for checks and reference problems."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from needlefem._arrays import Bools, Points, SkfemMesh
from needlefem.elements import ElementType
from needlefem.elements.quadrature import gauss, simplex
from needlefem.fem.tissue_model import TissueModel
from needlefem.materials import Material
from needlefem.mesh.generation import BACKGROUND, box, curved, name_faces, name_regions
from needlefem.scene import Support

ONE_SIDE: Mapping[str, Support] = {"one side": Support(faces=("y_min",))}


def square_mesh(
    element: ElementType, divisions: int, size: tuple[float, float] = (1.0, 1.0)
) -> SkfemMesh:
    """Return a rectangle at the origin of triangles or quadrilaterals, as the element needs."""
    pattern = "quadrilateral" if element.cell == "quadrilateral" else "diagonal"
    return box((0.0, 0.0), size, (divisions, divisions), pattern)


def mapped_mesh(
    element: ElementType,
    divisions: tuple[int, int],
    place: Callable[[Points], Points],
    *,
    bent: bool = False,
) -> SkfemMesh:
    """Return the unit square's grid moved by a function of its points, (n, 2) to (n, 2).

    Polar coordinates, a tapered panel, a graded square: anything with four sides. `bent` also
    moves the middles of edges, so that cells follow curved sides.
    """
    pattern = "quadrilateral" if element.cell == "quadrilateral" else "diagonal"
    mesh = box((0.0, 0.0), (1.0, 1.0), divisions, pattern)
    mesh = curved(mesh) if bent else mesh
    return type(mesh)(np.ascontiguousarray(place(mesh.p.T).T), mesh.t)


def for_bent_cells(element: ElementType) -> ElementType:
    """Return the element with a finer rule: on curved cells its own is a reduced integration."""
    rule = simplex(6) if element.cell == "triangle" else gauss(4)
    return dataclasses.replace(element, stiffness_rule=rule)


def joined(parts: Sequence[SkfemMesh]) -> SkfemMesh:
    """Return one mesh of several that share whole edges: points that coincide become one."""
    points = np.hstack([part.p for part in parts])
    starts = np.cumsum([0, *(part.nvertices for part in parts)])
    cells = np.hstack([part.t + start for part, start in zip(parts, starts, strict=False)])
    near = np.round(points / np.ptp(points), 9) + 0.0  # -0.0 and 0.0 are one number
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
    """Return a uniform rectangle of the element's cells, `divisions` along every side."""
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
    """Return a tissue of one material on any mesh, held where its outer edges' middles say.

    Without `held` it floats.
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
