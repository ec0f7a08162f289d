"""Generation of meshes: boxes, refinement, names of faces and regions."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from skfem import MeshQuad, MeshQuad2, MeshTri, MeshTri2

from needlefem._arrays import Floats, Ints, Points, SkfemMesh
from needlefem.errors import CaseError
from needlefem.geometry.contour import Contour
from needlefem.mesh.cell_map import cell_measures, is_simplicial

BACKGROUND = "background"
"""Name of the subdomain outside of all regions."""

COARSEST = 4.5
"""Largest size of a cell, relative to the size at a contour, for which `refine` detects it."""
FARTHEST_CORNER = 0.75
"""Largest distance of a corner from the centroid of a right isosceles triangle, in legs."""

SizeField = Callable[[Points], Floats]
"""Requested element size (m) at points, shape (n, dim); infinity without a request."""


def box(
    origin: Sequence[float],
    size: Sequence[float],
    divisions: Sequence[int],
    pattern: str = "diagonal",
) -> SkfemMesh:
    """Return a box of squares, as two (diagonal) or four (crossed) triangles, or undivided."""
    ticks = [
        start + length * np.arange(n + 1) / n
        for start, length, n in zip(origin, size, divisions, strict=True)
    ]
    if pattern == "crossed":
        return _crossed(ticks)
    kind = MeshQuad if pattern == "quadrilateral" else MeshTri
    mesh: SkfemMesh = kind.init_tensor(*ticks)
    return mesh


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
    mesh: SkfemMesh = MeshTri(np.hstack([corners, centres]), np.hstack(cells).astype(np.int32))
    return mesh


def into_quadrilaterals(mesh: SkfemMesh) -> SkfemMesh:
    """Return each triangle as three quadrilaterals that meet at its centre.

    In this way each refined or fitted mesh of triangles gives one of quadrilaterals. Regions and
    faces must be named again.
    """
    centroids = mesh.p[:, mesh.t].mean(axis=1)
    middles = mesh.p[:, mesh.facets].mean(axis=1)
    points = np.hstack([mesh.p, middles, centroids])
    middle = mesh.nvertices + mesh.t2f  # edges 01, 12, 02
    centre = mesh.nvertices + mesh.nfacets + np.arange(mesh.nelements)
    corners = [(0, 0, 2), (1, 1, 0), (2, 2, 1)]  # corner, the edge after it, the edge before it
    cells = [np.array([mesh.t[c], middle[a], centre, middle[b]]) for c, a, b in corners]
    found: SkfemMesh = MeshQuad(points, np.hstack(cells))
    return found


def curved(mesh: SkfemMesh) -> SkfemMesh:
    """Return the mesh with midside nodes (and centre nodes of quadrilaterals).

    If these are moved to a curve, the edges become curved. Such meshes are for static problems; the
    search for points does not support them.
    """
    found: SkfemMesh = (MeshTri2 if is_simplicial(mesh) else MeshQuad2).from_mesh(mesh)
    return found


def cell_sizes(mesh: SkfemMesh) -> Floats:
    """Return the size of every cell, m.

    The size is the side of a square with the same area, or the leg of a right isosceles triangle.
    """
    sizes: Floats = np.sqrt(cell_measures(mesh) * (2.0 if is_simplicial(mesh) else 1.0))
    return sizes


def signed_measures(mesh: SkfemMesh) -> Floats:
    """Return the signed area of every triangle (positive: counter-clockwise), m^2."""
    a, b, c = (mesh.p[:, mesh.t[i]] for i in range(3))
    u, v = b - a, c - a
    areas: Floats = 0.5 * (u[0] * v[1] - u[1] * v[0])
    return areas


def refine(mesh: SkfemMesh, size: SizeField, limit: int = 20) -> SkfemMesh:
    """Refine adaptively until no cell is larger than the requested size at its points.

    The points are the corners and the centroid. Regions and faces must be named again.
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


def find_contour(mesh: SkfemMesh, contour: Contour, size: float, limit: int = 40) -> SkfemMesh:
    """Refine cells near a contour until `refine` detects the contour.

    `refine` evaluates the size at corners and centroids only, and would miss a contour that is
    small compared to a cell. Cells of up to `COARSEST` times the size need no such refinement.
    """
    for _ in range(limit):
        sizes = cell_sizes(mesh)
        large = np.flatnonzero(sizes > COARSEST * size)
        away = contour.distance(mesh.p[:, mesh.t[:, large]].mean(axis=1).T)
        marked = large[away < FARTHEST_CORNER * sizes[large]]
        if not marked.size:
            return mesh
        mesh = mesh.refined(marked)
    return mesh


def near_segment(begin: Points, end: Points, halfwidth: float, size: float) -> SizeField:
    """Return a size field: `size` within `halfwidth` of a segment, infinity elsewhere."""
    along = end - begin
    length2 = float(along @ along)

    def field(points: Points) -> Floats:
        share = np.clip((points - begin) @ along / length2, 0.0, 1.0)
        away = np.linalg.norm(points - begin - share[:, None] * along, axis=1)
        return np.where(away <= halfwidth * (1 + 1e-9), size, np.inf)

    return field


def near_contour(contour: Contour, size: float) -> SizeField:
    """Return a size field: `size` within twice this distance of the contour, infinity elsewhere."""

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


def group_cells(mesh: SkfemMesh, group: str, key: str) -> Ints:
    """Return the cells of a named group, or raise a `CaseError` with the existing names."""
    present = mesh.subdomains or {}
    if group not in present:
        if group in (mesh.boundaries or {}):
            problem = f"'{group}' is a group of edges, not of cells"
            raise CaseError(key, problem, "use it in supports, and name a group of cells here")
        if not present:
            problem = f"no group '{group}': the mesh names no group of cells"
            raise CaseError(key, problem, "name cells (Gmsh: Physical Surface), or give a contour")
        names = ", ".join(sorted(present))
        raise CaseError(key, f"no group '{group}' in the mesh", f"those present are {names}")
    cells: Ints = np.asarray(present[group])
    return cells


def parts(mesh: SkfemMesh, cells: Ints) -> int:
    """Return the number of parts of a group of cells that are not joined by edges."""
    number = np.full(mesh.nelements, -1)
    number[cells] = np.arange(len(cells))
    one, other = number[mesh.f2t[:, mesh.f2t[1] >= 0]]
    both = (one >= 0) & (other >= 0)
    joined = (np.ones(np.count_nonzero(both), dtype=np.int8), (one[both], other[both]))
    graph = coo_array(joined, shape=(len(cells), len(cells)))
    return int(connected_components(graph, directed=False, return_labels=False))


def outline(mesh: SkfemMesh, cells: Ints) -> Contour:
    """Return the closed polygon of edges around a group that encloses the largest area."""
    edges = np.bincount(mesh.t2f[:, cells].ravel(), minlength=mesh.nfacets) == 1
    neighbours: dict[int, list[int]] = {}
    for a, b in mesh.facets[:, edges].T:
        neighbours.setdefault(int(a), []).append(int(b))
        neighbours.setdefault(int(b), []).append(int(a))
    rings: list[Contour] = []
    while neighbours:
        start = next(iter(neighbours))
        ring, at = [start], start
        while neighbours.get(at):
            after = neighbours[at].pop()
            neighbours[after].remove(at)
            ring.append(after)
            at = after
        for node in ring:
            if not neighbours.get(node, True):
                del neighbours[node]
        rings.append(Contour(mesh.p[:, ring].T))
    return max(rings, key=lambda contour: contour.area)


def name_regions(
    mesh: SkfemMesh,
    contours: Mapping[str, Contour],
    groups: Mapping[str, Ints] | None = None,
) -> SkfemMesh:
    """Name the cells with their centroid in a contour, and groups; the last region has priority.

    All other cells are named `BACKGROUND`. A region without cells raises a `CaseError`.
    """
    owner = np.zeros(mesh.nelements, dtype=np.intp)
    centroids = mesh.p[:, mesh.t].mean(axis=1).T
    chosen = dict(groups or {})
    chosen |= {name: np.flatnonzero(c.contains(centroids)) for name, c in contours.items()}
    if BACKGROUND in chosen:
        problem = "this name is reserved for the tissue outside of all regions"
        raise CaseError(f"regions.{BACKGROUND}", problem, "give the region another name")
    for number, members in enumerate(chosen.values(), start=1):
        owner[members] = number
    cells = {
        name: np.flatnonzero(owner == number) for number, name in enumerate([BACKGROUND, *chosen])
    }
    for name in chosen:
        if not cells[name].size:
            if name in contours and not chosen[name].size:
                size = 0.25e3 * np.sqrt(contours[name].area)
                remedy = f"refine the mesh, to {size:.2g} mm there, or check the contour's offset"
                raise CaseError(f"regions.{name}", "no mesh cell is in the contour", remedy)
            what = "in the contour" if name in contours else "of the group"
            problem = f"all cells {what} are in later regions"
            remedy = "list a region before the regions inside of it; each needs cells of its own"
            raise CaseError(f"regions.{name}", problem, remedy)
    return mesh.with_subdomains(cells)
