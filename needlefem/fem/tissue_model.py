"""The discretised tissue with its supports: stiffness, mass and free dofs."""

import dataclasses
from collections.abc import Mapping
from functools import cached_property

import numpy as np

from needlefem._arrays import Floats, Ints, SkfemMesh, Sparse
from needlefem.elements import ElementType
from needlefem.elements.shape_functions import shape_table
from needlefem.errors import CaseError, nearest, short
from needlefem.fem import forms
from needlefem.fem.factorization import Factor
from needlefem.fem.function_space import FunctionSpace, NodalFrames, frame_along
from needlefem.fem.stiffness import Stiffness
from needlefem.materials import (
    Material,
    VolumetricSplit,
    branches_of,
    plane_volumetric_split,
    volumetric_split,
)
from needlefem.mesh.cell_map import cell_measures
from needlefem.validation import Validated, parameter, unit


@dataclasses.dataclass(frozen=True, kw_only=True)
class Support(Validated):
    """Faces and regions in which displacement components are zero."""

    TABLE = "supports.NAME"

    faces: tuple[str, ...] = parameter("Named faces of the mesh", default=())
    regions: tuple[str, ...] = parameter("Regions fixed as a whole, such as bone", default=())
    fixed: tuple[str, ...] = parameter(
        "Axes of the fixed displacement components; all if omitted", default=()
    )
    direction: tuple[float, ...] = parameter(
        "Direction of the only fixed displacement component, instead of `fixed`: the normal of an "
        "inclined plane of rollers",
        default=(),
    )

    def check(self) -> None:
        """See `Validated`; the direction is made a unit vector."""
        if not self.direction:
            return
        if self.fixed:
            problem = "given together with a direction, which replaces it"
            raise CaseError(f"{self.TABLE}.fixed", problem, "write one of them")
        if not any(self.direction):
            problem = f"{short(self.direction)} has no length"
            raise CaseError(f"{self.TABLE}.direction", problem, "give a vector such as [0.5, 1]")
        direction = unit(self.direction, f"{self.TABLE}.direction")
        object.__setattr__(self, "direction", direction)


def _fixed_directions(
    supports: Mapping[str, Support], nodes: Mapping[str, Ints], axes: tuple[str, ...]
) -> dict[int, Floats]:
    """Return the fixed directions of all nodes with a support along another than the axes.

    Each node has an array of shape (ndirections, dim), which contains the directions of its other
    supports as well.
    """
    found: dict[int, list[Floats]] = {
        node: []
        for name, support in supports.items()
        if support.direction
        for node in nodes[name].tolist()
    }
    for name, support in supports.items() if found else ():
        if support.direction:
            directions = [np.array(support.direction)]
        else:
            directions = [np.eye(len(axes))[axes.index(axis)] for axis in support.fixed or axes]
        for node in nodes[name].tolist():
            if node in found:
                found[node] += directions
    return {node: np.array(directions) for node, directions in found.items()}


def _supported_nodes(space: FunctionSpace, support: Support, name: str) -> Ints:
    """Return the nodes of a support's faces and regions in rising order."""
    nodes = [np.zeros(0, dtype=np.intp)]
    regions = space.mesh.subdomains or {}
    nodes += [space.cell_nodes[regions[r]].ravel() for r in support.regions]
    for face in support.faces:
        facets = space.face(face, f"supports.{name}.faces")
        nodes.append(space.node_of[space.dofs_on(facets)])
    return np.unique(np.concatenate(nodes))


def supported_dofs(
    space: FunctionSpace, supports: Mapping[str, Support], axes: tuple[str, ...]
) -> tuple[Ints, NodalFrames | None]:
    """Return the fixed dofs of all supports in rising order, and the frames of inclined supports.

    The dofs of a node with a frame are its components in that frame.

    Parameters
    ----------
    space : FunctionSpace
    supports : mapping
        Supports by their names in the case.
    axes : tuple of str
        Names of the axes.

    Raises
    ------
    CaseError
        A face or an axis does not exist.
    """
    held, nodes = [np.zeros(0, dtype=np.intp)], dict[str, Ints]()
    for name, support in supports.items():
        for axis in set(support.fixed) - set(axes):
            raise CaseError(f"supports.{name}.fixed", f"no axis {short(axis)}", nearest(axis, axes))
        if support.direction and len(support.direction) != space.dim:
            problem = f"{len(support.direction)} components in {space.dim} dimensions"
            raise CaseError(f"supports.{name}.direction", problem, "give one for each axis")
        nodes[name] = _supported_nodes(space, support, name)
        if not support.direction:
            components = [axes.index(axis) for axis in support.fixed or axes]
            held.append(space.node_dofs[nodes[name]][:, components].ravel())
    inclined = _fixed_directions(supports, nodes, axes)
    if not inclined:
        return np.unique(np.concatenate(held)), None
    frames = {node: frame_along(directions) for node, directions in inclined.items()}
    own = space.node_dofs[list(frames)].ravel()
    along_axes = np.setdiff1d(np.concatenate(held), own)
    held = [along_axes, *(space.node_dofs[node, :count] for node, (_, count) in frames.items())]
    turned = {node: frame for node, (frame, _) in frames.items()}
    return np.unique(np.concatenate(held)), NodalFrames(turned, space.node_dofs)


class TissueModel(FunctionSpace):
    """The semi-discrete tissue; its matrices are computed when they are first used.

    Parameters
    ----------
    mesh : skfem.Mesh
        With named subdomains (one material each) and named faces.
    element : ElementType
        Element of the displacement.
    materials : mapping
        Material of each subdomain.
    supports : mapping
        Faces and subdomains whose displacement components are zero.
    axes : sequence of str
        Names of the axes.
    plane : str
        Plane 'strain' or plane 'stress' (2D only).
    floating : bool
        Whether rigid motions are allowed, for vibration modes and dynamics.

    Raises
    ------
    CaseError
        A face or axis does not exist, or the supports leave a rigid motion free.
    """

    def __init__(
        self,
        mesh: SkfemMesh,
        element: ElementType,
        materials: Mapping[str, Material],
        supports: Mapping[str, Support],
        axes: tuple[str, ...],
        *,
        plane: str = "strain",
        floating: bool = False,
    ) -> None:
        super().__init__(mesh, element)
        self.axes, self.plane = axes, plane
        self.materials, self.supports = materials, supports
        self.held_dofs, self.frames = supported_dofs(self, supports, axes)
        self.free_dofs: Ints = np.setdiff1d(np.arange(self.ndofs), self.held_dofs)
        if not floating:
            self._refuse_rigid_motion()

    def _refuse_rigid_motion(self) -> None:
        motions = self.rigid_motions
        if self.frames is not None:
            motions = self.frames.matrix.T @ motions
        rank = np.linalg.matrix_rank(motions[self.held_dofs]) if len(self.held_dofs) else 0
        free = motions.shape[1] - int(rank)
        if free:
            problem = f"the supports leave {free} rigid motions of the tissue free"
            raise CaseError("supports", problem, "fix more faces or more axes")

    @cached_property
    def cell_materials(self) -> Ints:
        """Number of each cell's material in the order of `materials`, shape (ncells,)."""
        owner = np.full(self.mesh.nelements, -1)
        for number, name in enumerate(self.materials):
            owner[(self.mesh.subdomains or {})[name]] = number
        return owner

    def per_cell(self, values: Mapping[str, float]) -> Floats:
        """Return one value per subdomain as a field of cells, shape (ncells,)."""
        table = np.array([values[name] for name in self.materials])
        spread: Floats = table[self.cell_materials]
        return spread

    def per_node(self, values: Mapping[str, float]) -> Floats:
        """Return one value per subdomain as a continuous nodal field, shape (nnodes,).

        At a vertex the values are averaged with the measures of the cells. The field is linear in
        each cell, so that a needle that crosses an interface meets no jump.
        """
        if len(set(values.values())) == 1:
            return np.full(self.nnodes, next(iter(values.values())))
        corners = self.mesh.t.T
        measure = np.repeat(cell_measures(self.mesh), corners.shape[1])
        value = np.repeat(self.per_cell(values), corners.shape[1])
        where, count = corners.ravel(), self.mesh.nvertices
        weighted = np.bincount(where, measure * value, minlength=count)
        at_vertices = weighted / np.bincount(where, measure, minlength=count)
        between = shape_table(self.mesh.elem)(self.element.nodes)
        field = np.zeros(self.nnodes)
        field[self.cell_nodes] = at_vertices[corners] @ between.T
        return field

    @cached_property
    def stiffness(self) -> Stiffness:
        """K of all dofs, fixed dofs included."""
        return Stiffness(self, [part for part, _ in self.laws()], self.cell_materials)

    def laws(self) -> list[tuple[VolumetricSplit, float]]:
        """Return law and density of each subdomain in the order of `materials`."""
        return [
            (
                volumetric_split(law) if self.dim == 3 else plane_volumetric_split(law, self.plane),
                float(law.density),
            )
            for law in self.materials.values()
        ]

    @cached_property
    def branches(self) -> tuple[tuple[float, Sparse], ...]:
        """Relaxation times (s) of viscoelastic branches with their stiffness matrices.

        Matrices of shape (ndofs, ndofs); empty for elastic tissue.
        """
        size = 3 if self.dim == 2 else 6
        laws: dict[float, Floats] = {}
        for number, material in enumerate(self.materials.values()):
            for branch in branches_of(material, self.dim, self.plane):
                law = laws.setdefault(branch.time, np.zeros((size, size, self.mesh.nelements)))
                law[:, :, self.cell_materials == number] += branch.stiffness[:, :, None]
        return tuple((time, forms.stiffness(self.basis, laws[time])) for time in sorted(laws))

    def body_load(self, force: forms.Field, order: int = 6) -> Floats:
        """Return the load of a force per volume (N/m^3) on all dofs, shape (ndofs,), N (N/m)."""
        return forms.body_load(forms.fine_basis(self.mesh, self.element, order), force)

    def face_load(self, face: str, traction: forms.Field) -> Floats:
        """Return the load of a traction (Pa) on a named face, shape (ndofs,), N (N/m).

        Raises
        ------
        CaseError
            The face does not exist.
        """
        facets = self.face(face, "face")
        return forms.traction_load(self.mesh, self.element, facets, lambda x, _: traction(x))

    @cached_property
    def density(self) -> Floats:
        """Density of each cell, shape (ncells,), kg/m^3."""
        return self.per_cell({name: m.density for name, m in self.materials.items()})

    @cached_property
    def mass(self) -> Sparse:
        """Consistent mass matrix, shape (ndofs, ndofs), kg (per metre of thickness in 2D)."""
        return forms.mass(self._mass_basis, self.density)

    def lumped_mass(self, scheme: str) -> Floats:
        """Diagonal of the lumped mass matrix, shape (ndofs,); see `forms.lumped_mass`."""
        return forms.lumped_mass(self._mass_basis, self.density, scheme, self.element)

    @cached_property
    def _mass_basis(self) -> object:
        return forms.displacement_basis(self.mesh, self.element, self.element.mass_rule)

    def local_matrix(self, matrix: Sparse) -> Sparse:
        """Return a matrix between dof vectors as the matrix between the components in frames."""
        if self.frames is None:
            return matrix
        return self.frames.local_matrix(matrix)

    def free_block(self, matrix: Sparse) -> Sparse:
        """Return the rows and columns of the unknowns of a matrix between dof vectors."""
        return self.local_matrix(matrix)[self.free_dofs][:, self.free_dofs]

    def unknowns(self, vectors: Floats) -> Floats:
        """Return the unknowns of dof vectors, shape (nfree,) or (nfree, k).

        Parameters
        ----------
        vectors : array, shape (ndofs,) or (ndofs, k)
            Loads, or fields that satisfy the supports.
        """
        if self.frames is not None:
            vectors = self.frames.matrix.T @ vectors
        found: Floats = vectors[self.free_dofs]
        return found

    def dof_vectors(self, unknowns: Floats) -> Floats:
        """Return unknowns, shape (nfree,) or (nfree, k), as dof vectors; zero at fixed dofs."""
        found = np.zeros((self.ndofs, *unknowns.shape[1:]))
        found[self.free_dofs] = unknowns
        return found if self.frames is None else self.frames.matrix @ found

    @cached_property
    def factor(self) -> Factor:
        """Factorisation of K on the free dofs."""
        return self.stiffness.factor(self.free_dofs, frames=self.frames)

    def solve(self, loads: Floats) -> Floats:
        """Return displacements for loads on all dofs, both of shape (ndofs,) or (ndofs, k)."""
        return self.dof_vectors(self.factor.solve(np.ascontiguousarray(self.unknowns(loads))))
