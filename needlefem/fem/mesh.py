"""Meshes of the tissue: boxes of simplices, refined where asked, with named faces and regions."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from skfem import MeshTri

from needlefem.arrays import Floats, Ints, Points, SkfemMesh
from needlefem.contour import Contour
from needlefem.errors import CaseError

BACKGROUND = "background"
"""Name of the subdomain outside all regions."""

SizeField = Callable[[Points], Floats]
"""Wanted element size (m) at points, shape (n, dim); infinity where any size will do."""


def box(
    origin: Sequence[float],
    size: Sequence[float],
    divisions: Sequence[int],
    pattern: str = "diagonal",
) -> SkfemMesh:
    """Return a box of triangles: every square cut into two (diagonal) or four (crossed)."""
    ticks = [
        start + length * np.arange(n + 1) / n
        for start, length, n in zip(origin, size, divisions, strict=True)
    ]
    mesh = MeshTri.init_tensor(*ticks)
    return _crossed(ticks) if pattern == "crossed" else mesh


def _crossed(ticks: list[Floats]) -> SkfemMesh:
    nx, ny = (len(t) for t in ticks)
    corners = np.array(np.meshgrid(*ticks, indexing="ij")).reshape(2, -1)
    middles = [0.5 * (t[1:] + t[:-1]) for t in ticks]
    centres = np.array(np.meshgrid(*middles, indexing="ij")).reshape(2, -1)
    grid = np.arange(nx * ny).reshape(nx, ny)
    ring = [grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]]
    ring = [part.ravel() for part in ring]
    middle = nx * ny + np.arange((nx - 1) * (ny - 1))
    cells = [np.array([ring[i], ring[(i + 1) % 4], middle]) for i in range(4)]
    return MeshTri(np.hstack([corners, centres]), np.hstack(cells).astype(np.int32))


def cell_sizes(mesh: SkfemMesh) -> Floats:
    """Return the size of every cell: the leg of the right isosceles triangle of its area, m."""
    sizes: Floats = np.sqrt(2.0 * np.abs(signed_measures(mesh)))
    return sizes


def signed_measures(mesh: SkfemMesh) -> Floats:
    """Return the signed area of every triangle (positive: counter-clockwise), m^2."""
    a, b, c = (mesh.p[:, mesh.t[i]] for i in range(3))
    u, v = b - a, c - a
    areas: Floats = 0.5 * (u[0] * v[1] - u[1] * v[0])
    return areas


def refine(mesh: SkfemMesh, size: SizeField, limit: int = 20) -> SkfemMesh:
    """Refine adaptively until every cell is at most as large as wanted at its points.

    A cell is judged at its corners and centroid. Regions and faces must be named afterwards.
    """
    for _ in range(limit):
        centroids = mesh.p[:, mesh.t].mean(axis=1)
        wanted = np.minimum(size(mesh.p.T)[mesh.t].min(axis=0), size(centroids.T))
        marked = np.flatnonzero(cell_sizes(mesh) > 1.001 * wanted)
        if not marked.size:
            return mesh
        mesh = mesh.refined(marked)
    raise CaseError(
        "mesh.refine", f"still too coarse after {limit} refinements", "ask for larger elements"
    )


def near_segment(begin: Points, end: Points, halfwidth: float, size: float) -> SizeField:
    """Return a size field: `size` within `halfwidth` of a segment, any size elsewhere."""
    along = end - begin
    length2 = float(along @ along)

    def field(points: Points) -> Floats:
        share = np.clip((points - begin) @ along / length2, 0.0, 1.0)
        away = np.linalg.norm(points - begin - share[:, None] * along, axis=1)
        return np.where(away <= halfwidth * (1 + 1e-9), size, np.inf)

    return field


def near_contour(contour: Contour, size: float) -> SizeField:
    """Return a size field: `size` within twice that of the contour, any size elsewhere."""

    def field(points: Points) -> Floats:
        return np.where(contour.distance(points) <= 2.0 * size, size, np.inf)

    return field


def name_faces(mesh: SkfemMesh, axes: Sequence[str]) -> SkfemMesh:
    """Name the flat outer faces of a box after the axes: y_min, y_max, ..."""
    faces: dict[str, Ints] = {}
    outer = mesh.boundary_facets()
    middle = mesh.p[:, mesh.facets[:, outer]].mean(axis=1)
    for i, axis in enumerate(axes):
        low, high = mesh.p[i].min(), mesh.p[i].max()
        near = 1e-9 * (high - low)
        faces[f"{axis}_min"] = outer[middle[i] < low + near]
        faces[f"{axis}_max"] = outer[middle[i] > high - near]
    return mesh.with_boundaries(faces)


def name_regions(mesh: SkfemMesh, contours: Mapping[str, Contour]) -> SkfemMesh:
    """Name the cells whose centroid lies in a contour; the later of two contours wins.

    The rest is named `BACKGROUND`. Raises a `CaseError` for a region without any cell.
    """
    owner = np.zeros(mesh.nelements, dtype=np.intp)
    centroids = mesh.p[:, mesh.t].mean(axis=1).T
    for number, contour in enumerate(contours.values(), start=1):
        owner[contour.contains(centroids)] = number
    cells = {
        name: np.flatnonzero(owner == number) for number, name in enumerate([BACKGROUND, *contours])
    }
    for name in contours:
        if not cells[name].size:
            remedy = "refine the mesh, enlarge the contour or check its offset"
            raise CaseError(f"regions.{name}", "no mesh cell lies in the contour", remedy)
    return mesh.with_subdomains(cells)
