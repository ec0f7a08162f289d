"""Test that a mesh is one body without overlapping cells and coincident nodes.

In 2D the test needs the boundary only. If neighbours are on opposite sides of each common edge,
cells can overlap only if the boundary intersects itself. A repeated node, or a node on the edge of
another cell, has boundary on both sides.
"""

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from needlefem._arrays import Bools, Floats, Ints, SkfemMesh
from needlefem.errors import CaseError
from needlefem.geometry.contour import SegmentTree, along_a_curve, cross, turn
from needlefem.mesh.cell_map import refuse_bad_cells

TOUCHING = 1e-4
"""Largest distance, relative to the edge lengths, at which nodes and edges coincide."""
FLATTEST = 1e4
"""Largest ratio of the squared longest edge of a cell to its smallest Jacobian."""
MERGE = "merge nodes at one place before saving (in Gmsh: BooleanFragments or Coherence)"


def refuse_unsound(mesh: SkfemMesh, key: str) -> None:
    """Raise a `CaseError` unless a mesh with straight edges is one body without overlaps.

    Parameters
    ----------
    mesh : skfem.Mesh
    key : str
        Key or option of the mesh, for error messages.

    Raises
    ------
    CaseError
        Nodes that are not finite or in no cell; flat, concave, crossed, repeated or overlapping
        cells; nodes at one place or on another cell's edge; parts that are not joined.
    """
    points = mesh.p.T
    wrong = np.flatnonzero(~np.all(np.isfinite(points), axis=1))
    if wrong.size:
        text = ", ".join(f"{x:g}" for x in points[wrong[0]])
        _refuse(key, f"node {wrong[0]} is at ({text})", "give every node finite coordinates")
    loose = np.flatnonzero(np.bincount(mesh.t.ravel(), minlength=mesh.nvertices) == 0)
    if loose.size:
        _refuse(key, f"{loose.size} nodes are in no cell, such as {loose[0]}", "leave them out")
    _refuse_bad_shapes(mesh, key)
    _refuse_shared_edges(mesh, key)
    if mesh.dim() == 2:
        ends, tree = _boundary(mesh)
        doubles, hanging = _touching_nodes(mesh, ends, tree)
    else:
        doubles, hanging = _same_nodes(mesh), np.zeros(0, dtype=np.intp)
    parts = _parts(mesh)
    if len(parts) > 1:
        sizes = ", ".join(map(str, parts[:4])) + (", ..." if len(parts) > 4 else "")
        problem = f"the mesh has {len(parts)} parts that are not joined ({sizes} cells)"
        if doubles.size:
            problem += f": {doubles.size} nodes coincide with another, {_at(mesh, doubles)}"
        elif hanging.size:
            problem += f": {hanging.size} nodes lie on another cell's edge, {_at(mesh, hanging)}"
        _refuse(key, problem, MERGE if doubles.size else "join them by edges from node to node")
    if doubles.size:
        problem = f"{doubles.size} nodes coincide with another without being joined to it"
        _refuse(key, f"{problem}, {_at(mesh, doubles)}", MERGE)
    if hanging.size:
        problem = f"{hanging.size} nodes lie on another cell's edge, {_at(mesh, hanging)}"
        _refuse(key, problem, "refine so that cells meet from node to node")
    if mesh.dim() == 2:
        _refuse_crossing_boundary(tree, key)


def _refuse(key: str, problem: str, remedy: str) -> None:
    raise CaseError(key, problem, remedy)


def _place(point: Floats) -> str:
    return "(" + ", ".join(f"{100.0 * x:.4g}" for x in point) + ") cm"


def _at(mesh: SkfemMesh, nodes: Ints) -> str:
    return f"the first at {_place(mesh.p[:, nodes[0]])}"


def _refuse_bad_shapes(mesh: SkfemMesh, key: str) -> None:
    if mesh.dim() != 2:
        refuse_bad_cells(mesh, key)
        return
    corners = mesh.p[:, mesh.t]  # axis, corner, cell
    after = np.roll(corners, -1, axis=1) - corners
    before = np.roll(after, 1, axis=1)
    jacobians = before[0] * after[1] - before[1] * after[0]
    sign = np.sign(jacobians.sum(axis=0))
    longest2 = np.max(after[0] ** 2 + after[1] ** 2, axis=0)
    least = np.min(jacobians, axis=0) if np.all(sign > 0) else np.min(jacobians * sign, axis=0)
    if np.any(least <= 1e-12 * longest2):
        refuse_bad_cells(mesh, key)
    flat = np.flatnonzero(longest2 > FLATTEST * least)
    if flat.size:
        place = _place(corners[:, :, flat[0]].mean(axis=1))
        problem = f"{flat.size} cells are flatter than 1 : {FLATTEST:,.0f}, the first at {place}"
        _refuse(key, problem, "correct the mesh there")


def _refuse_shared_edges(mesh: SkfemMesh, key: str) -> None:
    """Raise an error for facets of more than two cells, and for folded neighbours."""
    count = np.bincount(mesh.t2f.ravel(), minlength=mesh.nfacets)
    remedy = "leave out the cells that lie on others"
    many = np.flatnonzero(count > 2)
    if many.size:
        place = _place(mesh.p[:, mesh.facets[:, many[0]]].mean(axis=1))
        _refuse(key, f"{count[many[0]]} cells share the edge at {place}: they overlap", remedy)
    if mesh.dim() != 2:
        return
    inner = np.flatnonzero(count == 2)
    a, b = (mesh.p[:, mesh.facets[i, inner]].T for i in range(2))
    middles = mesh.p[:, mesh.t].mean(axis=1).T
    sides = [turn(a, b, middles[mesh.f2t[i, inner]]) for i in range(2)]
    folded = np.flatnonzero(np.sign(sides[0]) == np.sign(sides[1]))
    if folded.size:
        place = _place(0.5 * (a[folded[0]] + b[folded[0]]))
        problem = f"cells lie on their neighbours at {folded.size} edges, the first at {place}"
        _refuse(key, problem, remedy)


def _parts(mesh: SkfemMesh) -> list[int]:
    """Return the number of cells of each part that is joined by facets, the largest first."""
    one, other = mesh.f2t[:, mesh.f2t[1] >= 0]
    size = mesh.nelements
    starts = np.append(0, np.cumsum(np.bincount(one, minlength=size)))
    # the row format with floats avoids a conversion in the search
    graph = csr_array((np.ones(len(one)), other[np.argsort(one)], starts), shape=(size, size))
    _, part = connected_components(graph, directed=False)
    return sorted(np.bincount(part).tolist(), reverse=True)


def _boundary(mesh: SkfemMesh) -> tuple[Ints, SegmentTree]:
    """Return the nodes of boundary edges, shape (n, 2), and the positions of the edges."""
    ends = mesh.facets[:, mesh.boundary_facets()].T
    points = mesh.p.T
    ends = ends[along_a_curve(points[ends].mean(axis=1))]
    return ends, SegmentTree(points[ends[:, 0]], points[ends[:, 1]])


def _touching_nodes(mesh: SkfemMesh, ends: Ints, tree: SegmentTree) -> tuple[Ints, Ints]:
    """Return boundary nodes that coincide with an earlier node, and those on edges of others."""
    length = np.linalg.norm(tree.end - tree.begin, axis=1)
    near = np.full(mesh.nvertices, np.inf)
    for column in ends.T:
        np.minimum.at(near, column, TOUCHING * length)
    nodes = np.unique(ends)
    points, reach = mesh.p.T[nodes], near[nodes, None]
    doubles: list[Ints] = []
    hanging: list[Ints] = []
    for asked, near_by in tree.meeting(points - reach, points + reach):
        foreign = ~np.any(ends[near_by] == nodes[asked, None], axis=1)
        query, edge = asked[foreign], near_by[foreign]
        at = points[query]
        within = np.minimum(reach[query, 0], TOUCHING * length[edge])
        at_end = again = np.zeros(len(query), dtype=bool)
        for tip, node in zip((tree.begin, tree.end), ends.T, strict=True):
            same = np.linalg.norm(tip[edge] - at, axis=1) <= within
            at_end, again = at_end | same, again | (same & (node[edge] < nodes[query]))
        along = (tree.end - tree.begin)[edge] / length[edge, None]
        share = np.sum((at - tree.begin[edge]) * along, axis=1)
        beside = np.abs(turn(np.zeros_like(along), along, at - tree.begin[edge]))
        on_edge: Bools = (beside <= within) & (share > within) & (share < length[edge] - within)
        doubles.append(nodes[query[again]])
        hanging.append(nodes[query[on_edge & ~at_end]])
    none = np.zeros(0, dtype=np.intp)
    return np.unique(np.concatenate([none, *doubles])), np.unique(np.concatenate([none, *hanging]))


def _same_nodes(mesh: SkfemMesh) -> Ints:
    """Return coincident nodes of a 3D mesh."""
    size = float(np.max(np.ptp(mesh.p, axis=1)))
    places = np.round(mesh.p.T / (1e-9 * size))
    _, owner, count = np.unique(places, axis=0, return_inverse=True, return_counts=True)
    twice: Ints = np.flatnonzero(count[owner.ravel()] > 1)
    return twice


def _refuse_crossing_boundary(tree: SegmentTree, key: str) -> None:
    begin, end = tree.begin, tree.end
    for query, edge in tree.meeting(np.minimum(begin, end), np.maximum(begin, end)):
        once = query < edge
        one, other = query[once], edge[once]
        met = np.flatnonzero(cross(begin[one], end[one], begin[other], end[other]))
        if met.size:
            place = _place(0.5 * (begin[one[met[0]]] + end[one[met[0]]]))
            problem = f"cells overlap: edges of the boundary cross near {place}"
            _refuse(key, problem, "leave out the cells that lie on others")
