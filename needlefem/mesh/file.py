"""Contents of mesh files in any format, and the plane meshes in them."""

import dataclasses
import warnings
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path

import numpy as np
from skfem import MeshQuad, MeshTri

from needlefem._arrays import Floats, Ints, SkfemMesh
from needlefem._inputfile import require_file
from needlefem.errors import CaseError
from needlefem.mesh.soundness import refuse_unsound

FLAT = 1e-6
"""Largest distance of nodes from the plane, relative to the size of a plane mesh."""
BENT = 1e-6
"""Largest distance of a midside node from its straight edge, relative to the size of the mesh."""
FARTHEST, SMALLEST = 1e60, 1e-60
"""Largest coordinate and smallest size in units of the file; their products do not overflow."""
AXES = "xyz"


class UnreadableMeshError(Exception):
    """Reason why a mesh file can't be read, and remedy; the caller adds the file's name."""

    def __init__(self, problem: str, remedy: str) -> None:
        self.problem, self.remedy = problem, remedy
        super().__init__(f"{problem}; {remedy}")


def printable(name: str) -> str:
    """Return a group's name with "?" for characters that are not allowed in case files."""
    return "".join(letter if letter.isprintable() else "?" for letter in name)


@dataclasses.dataclass(frozen=True, eq=False)
class CellBlock:
    """Cells of one type that are in the same groups.

    Parameters
    ----------
    dim, corners, order : int
        Dimension of the cell, number of its corners, polynomial order of its edges.
    nodes : array, shape (n, nodes of a cell)
        Rows of `Contents.points`: corners first, then `order` - 1 nodes per edge, then others.
    groups : frozenset of str
    """

    dim: int
    corners: int
    order: int
    nodes: Ints
    groups: frozenset[str] = frozenset()


@dataclasses.dataclass(frozen=True, eq=False)
class Contents:
    """Nodes, cells and groups of a mesh file.

    Parameters
    ----------
    points : array, shape (n, 3)
        In units of the file.
    numbers : array, shape (n,)
        Node numbers in the file.
    cells : tuple of CellBlock
    notes : tuple of str
        Sentences about the reading of the file.
    node_groups : mapping
        Rows of `points` by name, for formats that define edges by their nodes.
    facet_groups : mapping
        Pairs of rows of `points`, shape (n, 2), by name.
    """

    points: Floats
    numbers: Ints
    cells: tuple[CellBlock, ...]
    notes: tuple[str, ...] = ()
    node_groups: Mapping[str, Ints] = dataclasses.field(default_factory=dict)
    facet_groups: Mapping[str, Ints] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass(frozen=True, eq=False)
class PlaneMesh:
    """The mesh of a file, and sentences about its reading.

    Parameters
    ----------
    mesh : skfem.Mesh
        Subdomains and boundaries are the file's groups; cells in no group are in no subdomain.
    axes : tuple of str
        Axes of the file that are the two coordinates.
    notes : tuple of str
        Sentences about the reading; `repairs` are those about changes.
    repairs : tuple of str
    """

    mesh: SkfemMesh
    axes: tuple[str, str]
    notes: tuple[str, ...] = ()
    repairs: tuple[str, ...] = ()


def plane_mesh(contents: Contents, unit: float) -> PlaneMesh:
    """Return the plane mesh of a file.

    Curved edges become straight, a mixture of triangles and quadrilaterals becomes triangles,
    repeated cells are taken once, and nodes without a cell are omitted.

    Parameters
    ----------
    contents : Contents
    unit : float, m
        Length of one unit of the file's coordinates.

    Raises
    ------
    UnreadableMeshError
        No cells of two dimensions, nodes outside of a plane, or nodes that are not finite.
    """
    notes, repairs = list(contents.notes), []
    areas = [block for block in contents.cells if block.dim == 2 and len(block.nodes)]
    if not areas:
        _refuse_without_cells(contents)
    shapes = {block.corners for block in areas}
    if not shapes <= {3, 4}:
        _refuse("it has polygons of more than four corners", "save triangles or quadrilaterals")
    _refuse_no_place(contents, areas)
    used = np.unique(np.concatenate([block.nodes[:, : block.corners].ravel() for block in areas]))
    points, axes = _plane(contents, used)
    bent = max(_bent(contents.points, block) for block in areas)
    if bent > BENT * float(np.max(np.ptp(points, axis=0))):
        repairs.append(
            f"Edges are curved by up to {bent:.3g} units of the file: they are read as straight."
        )
    if len(shapes) == 2:
        notes.append("Triangles and quadrilaterals are mixed: quadrilaterals are cut in two.")
        areas = [part for block in areas for part in _as_triangles(contents.points, block)]
    corners = np.vstack([block.nodes[:, : block.corners] for block in areas])
    cells, members, again = _once(corners, areas)
    if again:
        repairs.append(f"{again} cells are duplicated: each is used once.")
    number = np.full(len(contents.points), -1)
    number[used] = np.arange(len(used))
    kind = MeshTri if cells.shape[1] == 3 else MeshQuad
    mesh = kind(np.ascontiguousarray(unit * points.T), np.ascontiguousarray(number[cells].T))
    mesh = mesh.with_subdomains(members) if members else mesh
    faces, lost = _faces(mesh, contents, number)
    if lost:
        notes.append("Not on edges of cells, and left out: " + ", ".join(sorted(lost)) + ".")
    points_only = {name for block in contents.cells if block.dim == 0 for name in block.groups}
    points_only -= faces.keys() | members.keys()
    if points_only:
        named = ", ".join(sorted(points_only))
        notes.append(f"Groups of points are not used: {named}.")
    mesh = mesh.with_boundaries(faces) if faces else mesh
    return PlaneMesh(mesh, axes, tuple(notes), tuple(repairs))


def _refuse(problem: str, remedy: str) -> None:
    raise UnreadableMeshError(problem, remedy)


def _refuse_without_cells(contents: Contents) -> None:
    if any(block.dim == 3 and len(block.nodes) for block in contents.cells):
        _refuse("it contains only cells of a volume", "save a plane section as triangles")
    count = sum(len(block.nodes) for block in contents.cells if block.dim == 1)
    problem = f"it holds {count} lines and no cells" if count else "it contains no cells"
    _refuse(problem, "mesh the surface, and save triangles or quadrilaterals")


def _refuse_no_place(contents: Contents, areas: list[CellBlock]) -> None:
    """Raise an error for nodes that are not finite, midside nodes included."""
    used = np.unique(np.concatenate([block.nodes.ravel() for block in areas]))
    points = contents.points[used]
    wrong = np.flatnonzero(~np.all(np.abs(points) < FARTHEST, axis=1))
    if wrong.size:
        number = contents.numbers[used[wrong[0]]]
        place = ", ".join(f"{x:g}" for x in points[wrong[0]])
        _refuse(f"node {number} is at ({place})", "give every node finite coordinates")


def _plane(contents: Contents, used: Ints) -> tuple[Floats, tuple[str, str]]:
    """Return the plane coordinates of the used nodes, shape (n, 2), and their axes."""
    points = contents.points[used]
    extent = np.ptp(points, axis=0)
    if not extent.max() > SMALLEST:
        text = " x ".join(f"{x:g}" for x in extent)
        _refuse(f"its nodes fill {text} units", "give the nodes' coordinates")
    flat = np.flatnonzero(extent <= FLAT * extent.max())
    if not flat.size:
        text = " x ".join(f"{x:.4g}" for x in extent)
        problem = f"its cells are not in one plane of x, y and z (they fill {text} units)"
        _refuse(problem, "turn the plane mesh into one, or save a plane section of the surface")
    drop = int(flat[-1])  # z where there is a choice
    axes = [axis for axis in range(3) if axis != drop]
    return points[:, axes], (AXES[axes[0]], AXES[axes[1]])


def _bent(points: Floats, block: CellBlock) -> float:
    """Return the largest distance of midside nodes from the chord, in units of the file."""
    most = 0.0
    for edge in range(block.corners if block.order > 1 else 0):
        start = points[block.nodes[:, edge]]
        along = points[block.nodes[:, (edge + 1) % block.corners]] - start
        length2 = np.maximum(np.sum(along**2, axis=1), 1e-300)
        first = block.corners + edge * (block.order - 1)
        for column in range(first, first + block.order - 1):
            apart = points[block.nodes[:, column]] - start
            share = np.sum(apart * along, axis=1) / length2
            beside = np.linalg.norm(apart - share[:, None] * along, axis=1)
            most = max(most, float(np.max(beside, initial=0.0)))
    return most


def _as_triangles(points: Floats, block: CellBlock) -> list[CellBlock]:
    """Return a block of quadrilaterals as triangles, divided along the shorter diagonal."""
    if block.corners == 3:
        return [block]
    a, b, c, d = block.nodes[:, :4].T
    one = np.linalg.norm(points[a] - points[c], axis=1)
    other = np.linalg.norm(points[b] - points[d], axis=1)
    short = one <= other
    halves = (
        np.where(short[:, None], np.stack([a, b, c], axis=1), np.stack([a, b, d], axis=1)),
        np.where(short[:, None], np.stack([a, c, d], axis=1), np.stack([b, c, d], axis=1)),
    )
    return [CellBlock(2, 3, 1, half, block.groups) for half in halves]


def _once(corners: Ints, areas: list[CellBlock]) -> tuple[Ints, dict[str, Ints], int]:
    """Return each cell once, the cells of each group, and the number of repeated cells.

    Version 2.2 of Gmsh's format repeats a cell for each of its groups.
    """
    key = np.sort(corners, axis=1)
    _, first, owner = np.unique(key, axis=0, return_index=True, return_inverse=True)
    kept = np.sort(first)
    position = np.searchsorted(kept, first)[owner.ravel()]
    members: dict[str, list[Ints]] = {}
    at = 0
    seen: dict[frozenset[str], Ints] = {}
    again = 0
    for block in areas:
        cells = position[at : at + len(block.nodes)]
        at += len(block.nodes)
        before = seen.get(block.groups, np.zeros(0, dtype=np.intp))
        seen[block.groups] = np.union1d(before, cells)
        again += len(before) + len(cells) - len(seen[block.groups])
        for name in block.groups:
            members.setdefault(name, []).append(cells)
    groups = {name: np.unique(np.concatenate(parts)) for name, parts in members.items()}
    return corners[kept], groups, again


def _faces(mesh: SkfemMesh, contents: Contents, number: Ints) -> tuple[dict[str, Ints], set[str]]:
    """Return the facets of each group of edges, and groups that are not on edges of cells."""
    ends = np.sort(mesh.facets, axis=0).astype(np.int64)
    code = ends[0] * mesh.nvertices + ends[1]
    order = np.argsort(code)
    pairs: dict[str, list[Ints]] = {}
    for block in contents.cells:
        for name in block.groups if block.dim == 1 else ():
            pairs.setdefault(name, []).append(block.nodes[:, :2])
    for name, lines in contents.facet_groups.items():
        pairs.setdefault(name, []).append(lines)
    found: dict[str, Ints] = {}
    for name, parts in pairs.items():
        lines = np.sort(number[np.vstack(parts)], axis=1).astype(np.int64)
        wanted = lines[:, 0] * mesh.nvertices + lines[:, 1]
        place = order[np.minimum(np.searchsorted(code[order], wanted), len(code) - 1)]
        hit = (lines[:, 0] >= 0) & (code[place] == wanted)
        found[name] = np.unique(place[hit])
    outer = mesh.boundary_facets()
    for name, nodes in contents.node_groups.items():
        inside = np.zeros(mesh.nvertices, dtype=bool)
        inside[number[nodes][number[nodes] >= 0]] = True
        found.setdefault(name, outer[np.all(inside[mesh.facets[:, outer]], axis=0)])
    lost = {name for name, facets in found.items() if not facets.size}
    return {name: facets for name, facets in found.items() if name not in lost}, lost


# Reading: Gmsh's files by `gmsh_format`, all others with meshio by `foreign_formats`.


KEY = "mesh.file"


def read_mesh(path: Path, unit: float) -> SkfemMesh:
    """Read a plane mesh of triangles or quadrilaterals with its named groups.

    Parameters
    ----------
    path : Path
        Gmsh's .msh, or any format of meshio; docs/how-to/own-mesh.md describes their groups.
    unit : float, m
        Length of one unit of the file's coordinates.

    Returns
    -------
    skfem.Mesh
        Subdomains and boundaries are the file's groups; cells in no group are in no subdomain.

    Raises
    ------
    CaseError
        The file can't be read, or it does not contain one plane body of valid cells.

    Warns
    -----
    UserWarning
        Changes of the mesh, such as straight instead of curved edges.
    """
    found = read_plane_mesh(path, unit)
    if found.repairs:
        warnings.warn(f"{path.name}: {' '.join(found.repairs)}", stacklevel=1)
    return found.mesh


def read_plane_mesh(path: Path, unit: float, key: str = KEY) -> PlaneMesh:
    """Read a mesh file with sentences about its reading; see `read_mesh`.

    The last file is cached, because a case needs its mesh for outlines and for the model.
    """
    require_file(path, key, remedy="give a mesh file, such as Gmsh's .msh")
    try:
        status = path.stat()
        found = _read(path, status.st_mtime_ns, status.st_size)
        mesh = found.mesh
        mesh = dataclasses.replace(mesh, doflocs=unit * mesh.doflocs)
    except OSError as error:
        problem = f"can't read '{path}' ({error.strerror or error})"
        raise CaseError(key, problem, "give a mesh file, such as Gmsh's .msh") from None
    except UnreadableMeshError as error:
        raise CaseError(key, f"can't use '{path}': {error.problem}", error.remedy) from None
    refuse_unsound(mesh, key)
    return dataclasses.replace(found, mesh=mesh)


@lru_cache(maxsize=1)
def _read(path: Path, _changed: int, _size: int) -> PlaneMesh:
    """Return the mesh in units of the file; the last arguments identify the version of the file."""
    # format readers are imported here, because scenes with a box do not need them
    from needlefem.mesh.gmsh_format import is_msh, read_msh  # noqa: PLC0415

    with path.open("rb") as file:
        start = file.read(4096)
        if is_msh(start):
            return plane_mesh(read_msh(start + file.read()), 1.0)
    if path.suffix.lower() == ".msh" and not start.lstrip().startswith(b"("):  # as Fluent's do
        problem = "it is empty" if not start.strip() else "it does not begin as Gmsh's files do"
        raise UnreadableMeshError(problem, "save it as Gmsh's version 4.1 or 2.2")
    from needlefem.mesh.foreign_formats import read_foreign  # noqa: PLC0415

    return plane_mesh(read_foreign(path), 1.0)
