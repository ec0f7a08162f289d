"""The discretised tissue: a semi-discrete system on a scikit-fem mesh."""

from collections.abc import Mapping
from functools import cached_property

import numpy as np

from needlefem.arrays import Floats, Ints, Points, SkfemMesh, Sparse
from needlefem.elements import ElementRow
from needlefem.errors import CaseError
from needlefem.fem import assembly
from needlefem.fem.factor import Factor, factorise
from needlefem.fem.interpolation import Interpolation
from needlefem.materials import Material
from needlefem.scene import Support


class Model:
    """K, M and what belongs to them; immutable, computed when first asked for.

    Parameters
    ----------
    mesh : skfem.Mesh
        With named subdomains (one material each) and named boundaries.
    element : ElementRow
        Element of the displacement.
    materials : mapping
        Material of every subdomain.
    supports : mapping
        Faces on which components are held at zero.
    axes : sequence of str
        Names of the axes.

    Raises
    ------
    CaseError
        A face or axis that doesn't exist, or rigid motions that no support stops.
    """

    def __init__(
        self,
        mesh: SkfemMesh,
        element: ElementRow,
        materials: Mapping[str, Material],
        supports: Mapping[str, Support],
        axes: tuple[str, ...],
    ) -> None:
        self.mesh, self.element, self.axes = mesh, element, axes
        self.materials, self.supports = materials, supports
        self.dim: int = mesh.dim()
        self.basis = assembly.displacement_basis(mesh, element, element.stiffness_order)
        self.ndofs: int = self.basis.N
        first = self.basis.element_dofs[:: self.dim]
        _, numbers = np.unique(first, return_inverse=True)
        self.cell_nodes: Ints = numbers.reshape(first.shape).T.copy()
        self.nnodes = int(self.cell_nodes.max()) + 1
        self.node_dofs: Ints = np.zeros((self.nnodes, self.dim), dtype=np.intp)
        for axis in range(self.dim):
            self.node_dofs[self.cell_nodes.T, axis] = self.basis.element_dofs[axis :: self.dim]
        self.nodes: Points = self.basis.doflocs[:, self.node_dofs[:, 0]].T
        self.held_dofs = self._held_dofs()
        self.free_dofs: Ints = np.setdiff1d(np.arange(self.ndofs), self.held_dofs)
        self._refuse_rigid_motion()

    def _held_dofs(self) -> Ints:
        held = [np.zeros(0, dtype=np.intp)]
        for name, support in self.supports.items():
            for axis in set(support.fixed) - set(self.axes):
                options = ", ".join(self.axes)
                raise CaseError(f"supports.{name}.fixed", f"no axis '{axis}'", f"one of {options}")
            for face in support.faces:
                if face not in self.mesh.boundaries:
                    options = ", ".join(sorted(self.mesh.boundaries))
                    raise CaseError(f"supports.{name}.faces", f"no face '{face}'", options)
                components = [f"u^{self.axes.index(a) + 1}" for a in support.fixed or self.axes]
                held.append(self.basis.get_dofs(face).all(components))
        return np.unique(np.concatenate(held))

    @cached_property
    def rigid_motions(self) -> Floats:
        """Translations and rotations of all dofs, shape (ndofs, 3 in 2D or 6 in 3D)."""
        centred = (self.nodes - self.nodes.mean(axis=0)) / np.ptp(self.nodes)
        pairs = [(i, j) for i in range(self.dim) for j in range(i + 1, self.dim)]
        motions = np.zeros((self.ndofs, self.dim + len(pairs)))
        for axis in range(self.dim):
            motions[self.node_dofs[:, axis], axis] = 1.0
        for column, (i, j) in enumerate(pairs, start=self.dim):
            motions[self.node_dofs[:, i], column] = -centred[:, j]
            motions[self.node_dofs[:, j], column] = centred[:, i]
        return motions

    def _refuse_rigid_motion(self) -> None:
        motions = self.rigid_motions
        rank = np.linalg.matrix_rank(motions[self.held_dofs]) if len(self.held_dofs) else 0
        free = motions.shape[1] - int(rank)
        if free:
            problem = f"{free} rigid motions of the tissue are free"
            raise CaseError("supports", problem, "hold more faces or more axes")

    @cached_property
    def cell_materials(self) -> Ints:
        """Number of every cell's material, in the order of `materials`, shape (ncells,)."""
        owner = np.full(self.mesh.nelements, -1)
        for number, name in enumerate(self.materials):
            owner[self.mesh.subdomains[name]] = number
        return owner

    def per_cell(self, values: Mapping[str, float]) -> Floats:
        """Spread one number per subdomain over the cells, shape (ncells,)."""
        table = np.array([values[name] for name in self.materials])
        spread: Floats = table[self.cell_materials]
        return spread

    def per_node(self, values: Mapping[str, float]) -> Floats:
        """Return a field that is linear in every cell and continuous, shape (nnodes,).

        One number per subdomain, averaged at the vertices by cell measure: a needle that crosses
        an interface sees no jump.
        """
        corners = self.mesh.t.T
        measure = np.repeat(np.sum(self.basis.dx, axis=1), corners.shape[1])
        value = np.repeat(self.per_cell(values), corners.shape[1])
        where, count = corners.ravel(), self.mesh.nvertices
        weighted = np.bincount(where, measure * value, minlength=count)
        at_vertices = weighted / np.bincount(where, measure, minlength=count)
        places = self.element.make().doflocs
        barycentric = np.column_stack([1.0 - places.sum(axis=1), places])
        field = np.zeros(self.nnodes)
        field[self.cell_nodes] = at_vertices[corners] @ barycentric.T
        return field

    @cached_property
    def lame(self) -> tuple[Floats, Floats]:
        """Lame parameters of every cell, each of shape (ncells,), Pa."""
        pairs = {name: material.lame() for name, material in self.materials.items()}
        lam = self.per_cell({name: pair[0] for name, pair in pairs.items()})
        return lam, self.per_cell({name: pair[1] for name, pair in pairs.items()})

    @cached_property
    def stiffness(self) -> Sparse:
        """K, shape (ndofs, ndofs), N/m (per metre of thickness in 2D)."""
        return assembly.stiffness(self.basis, *self.lame)

    @cached_property
    def density(self) -> Floats:
        """Density of every cell, shape (ncells,), kg/m^3."""
        return self.per_cell({name: m.density for name, m in self.materials.items()})

    @cached_property
    def mass(self) -> Sparse:
        """Consistent M, shape (ndofs, ndofs), kg (per metre of thickness in 2D)."""
        basis = assembly.displacement_basis(self.mesh, self.element, self.element.mass_order)
        return assembly.mass(basis, self.density)

    def lumped_mass(self, scheme: str) -> Floats:
        """Diagonal of the lumped M, shape (ndofs,); see `assembly.lumped_mass`."""
        basis = assembly.displacement_basis(self.mesh, self.element, self.element.mass_order)
        return assembly.lumped_mass(basis, self.density, scheme, self.element)

    def free_block(self, matrix: Sparse) -> Sparse:
        """Return rows and columns of the free dofs."""
        return matrix[self.free_dofs][:, self.free_dofs]

    @cached_property
    def factor(self) -> Factor:
        """Factorisation of K on the free dofs."""
        return factorise(self.free_block(self.stiffness))

    def solve(self, loads: Floats) -> Floats:
        """Return displacements for loads on all dofs, shape (ndofs,) or (ndofs, k)."""
        found = np.zeros_like(loads)
        found[self.free_dofs] = self.factor.solve(np.ascontiguousarray(loads[self.free_dofs]))
        return found

    @cached_property
    def interpolation(self) -> Interpolation:
        """Evaluation of nodal fields anywhere in the tissue."""
        return Interpolation(self.mesh, self.element, self.cell_nodes)

    def nodal(self, dofs: Floats) -> Floats:
        """Return a dof vector as a nodal field, shape (nnodes, dim)."""
        field: Floats = dofs[self.node_dofs]
        return field

    def displacement_at(self, dofs: Floats, points: Points) -> Points:
        """Return u at points anywhere in the tissue, shape (n, dim), m."""
        return self.interpolation.at(points).of(self.nodal(dofs))
