"""The function space of a displacement element on a mesh: dofs, nodes, values at points."""

from collections.abc import Mapping, Sequence
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array, diags_array

from needlefem._arrays import Floats, Ints, Points, SkfemMesh, Sparse
from needlefem.elements import ElementType
from needlefem.errors import CaseError, nearest, short
from needlefem.fem import forms
from needlefem.fem.factorization import lasting_state
from needlefem.fem.interpolation import Interpolation

CELLS = {
    (2, 3): "triangle",
    (2, 4): "quadrilateral",
    (3, 4): "tetrahedron",
    (3, 8): "hexahedron",
}
"""Cell shape by dimension and number of vertices."""


SAME_DIRECTION = 1e-9
"""Sine of the angle up to which two directions are the same."""


def frame_along(directions: Floats) -> tuple[Floats, int]:
    """Return a frame, shape (dim, dim), whose first rows span some directions, and their number.

    Parameters
    ----------
    directions : array, shape (ndirections, dim)
        Unit vectors; some of them may be the same.
    """
    _, sizes, frame = np.linalg.svd(directions)
    return frame, int(np.sum(sizes > SAME_DIRECTION))


class NodalFrames:
    """Orthonormal frames of the nodes whose supports act along other directions than the axes.

    The unknowns of such a node are its displacement components in the frame. The first of them are
    fixed by the supports, the others are free. All fields, loads and matrices outside of a linear
    system have components along the axes.

    Parameters
    ----------
    frames : mapping
        Number of each node and its frame, shape (dim, dim), with the unit vectors as rows.
    node_dofs : array, shape (nnodes, dim)
        Dofs of all nodes.
    """

    def __init__(self, frames: Mapping[int, Floats], node_dofs: Ints) -> None:
        nnodes, dim = node_dofs.shape
        nodes = np.array(list(frames), dtype=np.intp)
        self._frames: Floats = np.array(list(frames.values()))
        self._number: Ints = np.full(nnodes, -1)
        self._number[nodes] = np.arange(len(nodes))
        dofs = node_dofs[nodes]
        entries = np.ones(nnodes * dim)
        entries[dofs] = 0.0
        rows = np.repeat(dofs[:, None, :], dim, axis=1)  # components along the axes
        columns = np.repeat(dofs[:, :, None], dim, axis=2)  # components in the frame
        rotated = csr_array(
            (self._frames.ravel(), (rows.ravel(), columns.ravel())), shape=(nnodes * dim,) * 2
        )
        self.matrix: Sparse = (rotated + diags_array(entries)).tocsr()
        """Dof vectors along the axes of unit unknowns, shape (ndofs, ndofs)."""

    def local_matrix(self, matrix: Sparse) -> Sparse:
        """Return a matrix between dof vectors, shape (ndofs, ndofs), as one between unknowns."""
        return (self.matrix.T @ matrix @ self.matrix).tocsr()

    def local_loads(self, nodes: Ints, loads: Floats) -> Floats:
        """Return loads on nodes as loads on their unknowns.

        Parameters
        ----------
        nodes : array, shape (k,)
        loads : array, shape (n, k dim)
            Components along the axes, ordered by node.
        """
        return self._turned(nodes, loads, self._frames)

    def along_axes(self, nodes: Ints, values: Floats) -> Floats:
        """Return the displacement of nodes, shape (k, dim), from their unknowns in that shape."""
        back = self._frames.transpose(0, 2, 1)
        return self._turned(nodes, values.reshape(1, -1), back).reshape(values.shape)

    def _turned(self, nodes: Ints, values: Floats, matrices: Floats) -> Floats:
        number = self._number[nodes]
        own = np.flatnonzero(number >= 0)
        if not own.size:
            return values
        blocks = values.reshape(len(values), len(nodes), -1).copy()
        blocks[:, own] = np.einsum("kij,nkj->nki", matrices[number[own]], blocks[:, own])
        return blocks.reshape(values.shape)


class FunctionSpace:
    """The displacement fields of one element on one mesh.

    Parameters
    ----------
    mesh : skfem.Mesh
        With straight edges.
    element : ElementType

    Raises
    ------
    CaseError
        The element is not defined on cells of this shape.
    """

    def __init__(self, mesh: SkfemMesh, element: ElementType) -> None:
        shape = CELLS.get((mesh.dim(), mesh.t.shape[0]), "other cell")
        if element.cell != shape:
            remedy = f"use a mesh of {element.cell}s or another element"
            problem = f"{element.name} is not defined on {shape}s"
            raise CaseError("discretization.element", problem, remedy)
        self.mesh, self.element = mesh, element
        self.dim: int = mesh.dim()
        self.basis = forms.displacement_basis(mesh, element, element.stiffness_rule)
        self.ndofs: int = self.basis.N
        first = self.basis.element_dofs[:: self.dim]
        _, numbers = np.unique(first, return_inverse=True)
        self.cell_nodes: Ints = numbers.reshape(first.shape).T.copy()
        self.nnodes = int(self.cell_nodes.max()) + 1
        self.node_dofs: Ints = np.zeros((self.nnodes, self.dim), dtype=np.intp)
        for axis in range(self.dim):
            self.node_dofs[self.cell_nodes.T, axis] = self.basis.element_dofs[axis :: self.dim]
        self.nodes: Points = self.basis.doflocs[:, self.node_dofs[:, 0]].T

    def __getstate__(self) -> dict[str, object]:
        """Return the state for pickling, without factorisations, matrices and basis."""
        return lasting_state(self, "basis")

    def __setstate__(self, state: dict[str, object]) -> None:
        """Restore a space; the basis is built again with the same numbers of dofs."""
        vars(self).update(state)
        element = self.element
        self.basis = forms.displacement_basis(self.mesh, element, element.stiffness_rule)

    @cached_property
    def node_of(self) -> Ints:
        """Node of every dof, shape (ndofs,)."""
        node = np.empty(self.ndofs, dtype=np.intp)
        node[self.node_dofs] = np.arange(self.nnodes)[:, None]
        return node

    def dofs_on(self, facets: Ints, axes: Sequence[int] | None = None) -> Ints:
        """Return the dofs of all nodes on facets; of some components only if `axes` is given."""
        chosen = np.zeros(self.ndofs, dtype=bool)
        chosen[self.basis.get_dofs(facets).all()] = True
        wanted = np.arange(self.dim) if axes is None else np.array(axes, dtype=np.intp)
        dofs = self.node_dofs[:, wanted].ravel()
        found: Ints = np.sort(dofs[chosen[dofs]])
        return found

    @cached_property
    def rigid_motions(self) -> Floats:
        """Translations and rotations as dof vectors, shape (ndofs, 3 in 2D or 6 in 3D)."""
        centred = (self.nodes - self.nodes.mean(axis=0)) / np.ptp(self.nodes)
        pairs = [(i, j) for i in range(self.dim) for j in range(i + 1, self.dim)]
        motions = np.zeros((self.ndofs, self.dim + len(pairs)))
        for axis in range(self.dim):
            motions[self.node_dofs[:, axis], axis] = 1.0
        for column, (i, j) in enumerate(pairs, start=self.dim):
            motions[self.node_dofs[:, i], column] = -centred[:, j]
            motions[self.node_dofs[:, j], column] = centred[:, i]
        return motions

    @cached_property
    def interpolation(self) -> Interpolation:
        """Interpolation of nodal fields at any point of the tissue."""
        return Interpolation(self.mesh, self.element, self.cell_nodes)

    def locate_as(self, other: "FunctionSpace") -> None:
        """Use the point search of another function space on the same mesh, to share its tables."""
        found = Interpolation(self.mesh, self.element, self.cell_nodes, other.interpolation.locator)
        self.interpolation = found

    def nodal(self, dofs: Floats) -> Floats:
        """Return a dof vector as a nodal field, shape (nnodes, dim)."""
        field: Floats = dofs[self.node_dofs]
        return field

    def dof_vector(self, field: Floats) -> Floats:
        """Return a nodal field, shape (nnodes, dim), as a dof vector."""
        dofs = np.empty(self.ndofs)
        dofs[self.node_dofs] = field
        return dofs

    def displacement_at(self, dofs: Floats, points: Points) -> Points:
        """Return the displacement at points of the tissue, shape (n, dim), m."""
        return self.interpolation.at(points).of(self.nodal(dofs))

    def face(self, name: str, key: str) -> Ints:
        """Return the facets of a named face; error messages name `key`, the place of the name."""
        present = self.mesh.boundaries or {}
        if not present:
            remedy = "name groups of edges in the mesh file (docs/how-to/own-mesh.md)"
            raise CaseError(key, f"no face {short(name)}: the mesh names no edges", remedy)
        if name not in present:
            raise CaseError(key, f"no face {short(name)}", nearest(name, present))
        facets: Ints = present[name]
        return facets
