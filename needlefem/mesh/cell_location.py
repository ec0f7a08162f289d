"""Which cell points lie in."""

import numpy as np

from needlefem._arrays import Bools, Ints, Points, SkfemMesh
from needlefem.mesh.cell_map import cell_corners, cell_map

INSIDE = 1e-9
"""A point counts as inside a cell when its reference point is at most this far outside."""


class Locator:
    """Finds the cell of points in a mesh with straight edges.

    A uniform grid over the bounding box lists the cells that each bin may meet. A point on a
    shared vertex, edge or face belongs to the cell with the lowest number.
    """

    def __init__(self, mesh: SkfemMesh) -> None:
        self.map = cell_map(mesh)
        corners = cell_corners(mesh)
        self._low = mesh.p.min(axis=1)
        ncells, _, dim = corners.shape
        self._bins = int(np.ceil((4 * ncells) ** (1 / dim)))
        self._width = (mesh.p.max(axis=1) - self._low) / self._bins
        margin = 1e-6 * self._width
        first = self._bin(corners.min(axis=1) - margin)
        last = self._bin(corners.max(axis=1) + margin)
        number, cell = _boxes(first, last, self._bins)
        order = np.lexsort((cell, number))
        self._cells = cell[order]
        self._start = np.searchsorted(number[order], np.arange(self._bins**dim + 1))

    def _bin(self, points: Points) -> Ints:
        index = ((points - self._low) / self._width).astype(np.intp)
        clipped: Ints = np.minimum(np.maximum(index, 0), self._bins - 1)
        return clipped

    def find(self, points: Points) -> tuple[Ints, Points]:
        """Return the cell of every point, shape (n,), -1 outside, and its reference point.

        Parameters
        ----------
        points : array, shape (n, dim), m
        """
        index = self._bin(points)
        number = index[:, 0]
        for axis in range(1, points.shape[1]):
            number = number * self._bins + index[:, axis]
        start = self._start[number]
        count = self._start[number + 1] - start
        owner = np.repeat(np.arange(len(points)), count)
        last = np.cumsum(count)
        place = np.arange(len(owner)) - np.repeat(last - count - start, count)
        cells = self._cells[place]
        local = self.map.invert(cells, points[owner])
        inside = np.flatnonzero(self.map.depth(local) >= -INSIDE)
        hit = inside[::-1]  # reversed: the lowest cell is written last
        found = np.full(len(points), -1)
        reference = np.zeros_like(points)
        found[owner[hit]] = cells[hit]
        reference[owner[hit]] = local[hit]
        return found, reference

    def inside(self, points: Points) -> Bools:
        """Return whether points, shape (n, dim), m, lie in the mesh, shape (n,)."""
        found: Bools = self.find(points)[0] >= 0
        return found


def _boxes(first: Ints, last: Ints, bins: int) -> tuple[Ints, Ints]:
    """Return (bin number, cell) for every bin of every cell's box of bins."""
    span = last - first + 1
    count = np.prod(span, axis=1)
    cell = np.repeat(np.arange(len(first)), count)
    rest = np.arange(len(cell)) - np.repeat(np.cumsum(count) - count, count)
    number = np.zeros(len(cell), dtype=np.intp)
    for axis in range(first.shape[1]):
        number = number * bins + first[cell, axis] + rest % span[cell, axis]
        rest = rest // span[cell, axis]
    return number, cell
