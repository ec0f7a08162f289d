"""The function space of a displacement element on a mesh: dofs, nodes, values at points."""

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from needlefem._arrays import Floats, Ints, Points, SkfemMesh
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

    def __getstate__(self) -> dict[str, Any]:
        """Return the state for pickling, without factorisations, matrices and basis."""
        return lasting_state(self, "basis")

    def __setstate__(self, state: dict[str, Any]) -> None:
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
