"""What of a mesh is seen: polygons and lines whose points move with a displacement."""

import numpy as np

from needlefem._arrays import Bools, Floats, Ints, Points
from needlefem.elements.shape_functions import ShapeTable, shape_table
from needlefem.fem.function_space import FunctionSpace

PIECES = 20_000
"""Triangles and quadrilaterals that curved cells are cut into, about."""
FEWEST, MOST = 2, 6
"""Parts of a curved edge: at least through its middle node."""


class SurfaceMesh:
    """The faces of a mesh that are seen, and their edges.

    Of plane tissue these are the cells, of tissue in space the outer faces of its cells:
    triangles and quadrilaterals of any mesh. Where displacement or geometry is quadratic, faces
    are cut into parts, so that edges are drawn as curved as they are.

    Parameters
    ----------
    space : FunctionSpace
    shown : array, shape (ncells,), optional
        The cells to show, all when left out.

    Attributes
    ----------
    rest : array, shape (npoints, dim), m
        The undeformed points.
    polygons : array, shape (n, corners)
        Numbers of points.
    cells : array, shape (n,)
        The cell of every polygon.
    edges : array, shape (m, parts + 1)
        Points along every edge of a cell.
    outline : array, shape (k, parts + 1)
        The same of the edges that belong to one face only: the skin of plane tissue.
    parts : int
        Of an edge; 1 where it is straight.
    """

    def __init__(self, space: FunctionSpace, shown: Bools | None = None) -> None:
        self.space, mesh = space, space.mesh
        self._local = np.arange(len(mesh.t))[None]
        if mesh.dim() == 3:
            self._local = np.array(mesh.elem.refdom.facets)
        owners, kinds = self._faces(np.ones(mesh.nelements, bool) if shown is None else shown)
        corners = mesh.t[self._local[kinds], owners[:, None]]
        curved = space.element.degree > 1 or mesh.p.shape[1] != len(np.unique(mesh.t))
        self.parts = 1
        self._weights: Floats | None = None
        self.rest: Points = mesh.p.T
        self.polygons, self.cells = corners, owners
        along = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2)
        if curved:
            least = np.sqrt(PIECES / max(len(owners), 1))
            self.parts = int(np.clip(least, FEWEST, MOST))
            pattern = _Pattern(corners.shape[1], self.parts)
            numbers = np.arange(len(owners) * pattern.size).reshape(len(owners), pattern.size)
            self._cut(owners, kinds, pattern)
            self.polygons = numbers[:, pattern.pieces].reshape(-1, corners.shape[1])
            self.cells = np.repeat(owners, len(pattern.pieces))
            along = numbers[:, pattern.rim]
        self.edges, alone = _edges(corners, along)
        self.outline: Ints = self.edges[alone]

    def _faces(self, shown: Bools) -> tuple[Ints, Ints]:
        """Return the cell of every face that is seen, and which of the cell's it is."""
        mesh, kept = self.space.mesh, np.flatnonzero(shown)
        if mesh.dim() == 2:
            return kept, np.zeros(len(kept), dtype=np.intp)
        facets = mesh.t2f[:, kept].T
        seen = np.bincount(facets.ravel(), minlength=mesh.nfacets)[facets] == 1
        rows, kinds = np.nonzero(seen)
        return kept[rows], kinds

    def _cut(self, owners: Ints, kinds: Ints, pattern: "_Pattern") -> None:
        """Place the points of cut faces, and find what nodes weigh there."""
        mesh, element = self.space.mesh, self.space.element.make()
        reference = np.asarray(mesh.elem.refdom.p, dtype=float).T
        places = np.array([pattern.weights @ reference[local] for local in self._local])
        flat = places.reshape(-1, places.shape[2])
        ways = len(self._local), pattern.size
        shapes = shape_table(mesh.elem)(flat).reshape(*ways, -1)[kinds]
        found = mesh.doflocs.T[mesh.dofs.element_dofs[:, owners].T]
        self.rest = np.einsum("fpn,fnd->fpd", shapes, found).reshape(-1, mesh.dim())
        self._weights = ShapeTable(element)(flat).reshape(*ways, -1)[kinds]
        self._nodes = self.space.cell_nodes[owners]

    def displaced(self, u: Floats) -> Points:
        """Return how far the points are moved by a displacement, shape (npoints, dim), m.

        Parameters
        ----------
        u : array, shape (ndofs,), m
        """
        if self._weights is None:
            found: Points = u[self.space.basis.nodal_dofs].T
            return found
        nodal = self.space.nodal(u)[self._nodes]
        moved: Points = np.matmul(self._weights, nodal).reshape(self.rest.shape)
        return moved


class _Pattern:
    """How a triangle or quadrilateral is cut, each edge into some parts.

    Attributes
    ----------
    weights : array, shape (size, corners)
        Of the corners at every point.
    pieces : array, shape (parts^2, corners)
        Points of the pieces.
    rim : array, shape (corners, parts + 1)
        Points along the edges.
    """

    def __init__(self, corners: int, parts: int) -> None:
        square = corners == 4
        ticks = range(parts + 1)
        grid = [(i, j) for j in ticks for i in ticks if square or i + j <= parts]
        number = {place: at for at, place in enumerate(grid)}
        x, y = np.array(grid, dtype=float).T / parts
        if square:
            columns = [(1 - x) * (1 - y), x * (1 - y), x * y, (1 - x) * y]
        else:
            columns = [1 - x - y, x, y]
        self.weights, self.size = np.stack(columns, axis=1), len(grid)
        found: list[list[tuple[int, int]]] = []
        for i, j in grid:
            ring = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
            split = [ring] if square else [[ring[0], ring[1], ring[3]], ring[1:]]
            found += [piece for piece in split if all(place in number for place in piece)]
        self.pieces = np.array([[number[place] for place in piece] for piece in found])
        ends = [(0, 0), (parts, 0), (parts, parts), (0, parts)] if square else [
            (0, 0), (parts, 0), (0, parts)]  # fmt: skip
        self.rim = np.array(
            [_along(number, ends[k], ends[(k + 1) % corners], parts) for k in range(corners)]
        )


def _along(
    number: dict[tuple[int, int], int], start: tuple[int, int], end: tuple[int, int], parts: int
) -> list[int]:
    steps = [(end[axis] - start[axis]) // parts for axis in (0, 1)]
    return [number[start[0] + k * steps[0], start[1] + k * steps[1]] for k in range(parts + 1)]


def _edges(corners: Ints, along: Ints) -> tuple[Ints, Bools]:
    """Return every edge once, shape (m, parts + 1), and whether one face only has it."""
    ends = np.sort(np.stack([corners, np.roll(corners, -1, axis=1)], axis=2), axis=2)
    key = ends[..., 0].ravel() * (int(corners.max()) + 1) + ends[..., 1].ravel()
    _, first, count = np.unique(key, return_index=True, return_counts=True)
    return along.reshape(-1, along.shape[2])[first], count == 1
