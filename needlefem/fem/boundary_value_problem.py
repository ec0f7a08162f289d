"""Static boundary value problems: supports, tractions, body forces and the equilibrium."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from needlefem._arrays import Bools, Floats, Ints, Points, SkfemMesh, Vector
from needlefem.elements import ElementType
from needlefem.fem import forms
from needlefem.fem.forms import Field
from needlefem.fem.function_space import FunctionSpace, NodalFrames, frame_along
from needlefem.fem.recovery import stresses
from needlefem.fem.stiffness import Stiffness
from needlefem.materials import Material, plane_volumetric_split, volumetric_split

Where = Callable[[Points], Bools] | None
"""Selects outer facets by their midpoints, shape (n, dim); None selects all outer facets."""


@dataclasses.dataclass(frozen=True, eq=False)
class StaticSolution:
    """Displacement of a tissue in equilibrium.

    Parameters
    ----------
    space : FunctionSpace
    stiffness : Stiffness
    u : array, shape (ndofs,), m
    pressure : array, shape (npressures,), Pa
        Tension positive; empty unless the element is mixed.
    free : int
        Number of unknowns that were solved for, including those of the pressure.
    """

    space: FunctionSpace
    stiffness: Stiffness
    u: Floats
    pressure: Floats
    free: int

    def at(self, points: Points) -> Points:
        """Return the displacement at points, shape (n, dim), m."""
        return self.space.displacement_at(self.u, np.asarray(points, dtype=float))

    def l2_error(self, exact: Field, order: int = 8) -> float:
        """Return the L2 error of the displacement, relative to the norm of the exact one."""
        return self._error(exact, order, gradient=False)

    def h1_error(self, exact: Callable[[Points], Floats], order: int = 8) -> float:
        """Return the relative L2 error of the gradient; `exact` returns (n, dim, dim)."""
        return self._error(exact, order, gradient=True)

    def _error(self, exact: Callable[[Points], Floats], order: int, *, gradient: bool) -> float:
        basis = forms.fine_basis(self.space.mesh, self.space.element, order)
        found = basis.interpolate(self.u)
        values = np.asarray(found.grad if gradient else found)
        where = np.asarray(basis.global_coordinates())
        dim, *shape = where.shape
        known = exact(where.reshape(dim, -1).T)
        known = np.moveaxis(known, 0, -1).reshape(*values.shape[: values.ndim - 2], *shape)
        axes = tuple(range(values.ndim - 2))
        off, whole = (np.sum(part**2, axis=axes) for part in (values - known, known))
        return float(np.sqrt(np.sum(off * basis.dx) / np.sum(whole * basis.dx)))

    def stress(self, reference: Points) -> Floats:
        """Return Voigt stresses at reference points of all cells; see `fem.recovery.stresses`."""
        return stresses(self.space, self.stiffness, self.u, self.pressure, reference)

    def at_vertices(self) -> Points:
        """Return the displacement of the mesh's points, shape (npoints, dim), m.

        Zero at points that are not vertices (midpoints of curved edges).
        """
        mesh = self.space.mesh
        found = np.zeros((mesh.p.shape[1], mesh.dim()))
        found[mesh.t.T] = self.space.nodal(self.u)[self.space.cell_nodes[:, : len(mesh.t)]]
        return found

    def vertex(self, point: Points) -> int:
        """Return the number of the vertex nearest to a point."""
        mesh = self.space.mesh
        vertices = np.unique(mesh.t)
        away = np.sum((mesh.p[:, vertices].T - point) ** 2, axis=1)
        return int(vertices[np.argmin(away)])

    def vertex_stress(self, point: Points) -> Floats:
        """Return the mean Voigt stress of the cells at the vertex nearest to a point, Pa."""
        mesh = self.space.mesh
        corner, cell = np.nonzero(mesh.t == self.vertex(point))
        corners = mesh.elem().doflocs[: len(mesh.t)]
        found: Floats = self.stress(corners)[cell, corner].mean(axis=0)
        return found


class BoundaryValueProblem:
    """Equilibrium of a tissue; its methods add one load or support each.

    Parameters
    ----------
    mesh : skfem.Mesh
        Named subdomains are required if there are several materials.
    element : ElementType
    materials : Material or mapping of names to them
    plane : str
        Plane 'strain' or 'stress'.
    space : FunctionSpace, optional
        An existing function space of the element on the mesh.
    """

    def __init__(
        self,
        mesh: SkfemMesh,
        element: ElementType,
        materials: Material | Mapping[str, Material],
        plane: str = "strain",
        space: FunctionSpace | None = None,
    ) -> None:
        self.space = FunctionSpace(mesh, element) if space is None else space
        several = materials if isinstance(materials, Mapping) else {"": materials}
        owner = np.zeros(mesh.nelements, dtype=np.intp)
        if isinstance(materials, Mapping):
            for number, name in enumerate(materials):
                owner[(mesh.subdomains or {})[name]] = number
        splits = [
            volumetric_split(material)
            if mesh.dim() == 3
            else plane_volumetric_split(material, plane)
            for material in several.values()
        ]
        self.stiffness = Stiffness(self.space, splits, owner)
        self._held: Floats = np.full(self.space.ndofs, np.nan)
        self._inclined: dict[int, list[tuple[Vector, float]]] = {}
        self._load: Floats = np.zeros(self.space.ndofs)

    def facets(self, where: Where = None) -> Ints:
        """Return the outer facets whose midpoints are selected."""
        mesh = self.space.mesh
        outer: Ints = mesh.boundary_facets()
        if where is None:
            return outer
        return outer[where(mesh.p[:, mesh.facets[:, outer]].mean(axis=1).T)]

    def fix(
        self,
        where: Where = None,
        field: Field | None = None,
        axes: Sequence[int] | None = None,
        direction: Sequence[float] | None = None,
    ) -> "BoundaryValueProblem":
        """Prescribe some components of the displacement on facets; zero without a field.

        Parameters
        ----------
        where : callable, optional
            Selects outer facets by their midpoints; all of them if omitted.
        field : callable, optional
            Displacement (m) at points, shape (n, dim).
        axes : sequence of int, optional
            Axes of the prescribed components; all if omitted.
        direction : sequence of float, optional
            Direction of the only prescribed component, instead of `axes`: the normal of an
            inclined plane of rollers.
        """
        dofs = self.space.dofs_on(self.facets(where), axes)
        nodal = np.zeros((self.space.nnodes, self.space.dim))
        if field is not None:
            nodal = field(self.space.nodes)
        if direction is not None:
            unit = np.array(direction, dtype=float) / np.linalg.norm(direction)
            for node in np.unique(self.space.node_of[dofs]).tolist():
                value = float(nodal[node] @ unit)
                self._inclined.setdefault(node, []).append((unit, value))
            return self
        self._held[dofs] = self.space.dof_vector(nodal)[dofs]
        return self

    def fix_node(self, node: int, value: Sequence[float | None]) -> "BoundaryValueProblem":
        """Prescribe the displacement components of a node; None leaves a component free."""
        for axis, number in enumerate(value):
            if number is not None:
                self._held[self.space.node_dofs[node, axis]] = number
        return self

    def apply_traction(
        self, traction: Callable[[Points, Points], Floats], where: Where = None
    ) -> "BoundaryValueProblem":
        """Apply a traction (Pa), a function of points and outward unit normals, on facets."""
        space = self.space
        self._load += forms.traction_load(space.mesh, space.element, self.facets(where), traction)
        return self

    def apply_body_force(self, force: Field, order: int = 8) -> "BoundaryValueProblem":
        """Apply a force per volume, N/m^3."""
        basis = forms.fine_basis(self.space.mesh, self.space.element, order)
        self._load += forms.body_load(basis, force)
        return self

    def solve(self) -> StaticSolution:
        """Return the displacement and pressure in equilibrium."""
        held, frames = self._held, None
        if self._inclined:
            held, frames = self._in_frames()
        free = np.flatnonzero(np.isnan(held))
        u, pressure = self.stiffness.solve(free, self._load, np.nan_to_num(held), frames)
        return StaticSolution(self.space, self.stiffness, u, pressure, len(free) + len(pressure))

    def _in_frames(self) -> tuple[Floats, NodalFrames]:
        """Return prescribed components, NaN where free, with frames at inclined supports.

        At a node that several supports fix, the prescribed components follow from all of them.
        """
        held, frames = self._held.copy(), {}
        for node, inclined in self._inclined.items():
            dofs = self.space.node_dofs[node]
            along_axes = np.flatnonzero(~np.isnan(held[dofs]))
            directions = np.vstack([np.eye(len(dofs))[along_axes], [unit for unit, _ in inclined]])
            values = np.append(held[dofs[along_axes]], [value for _, value in inclined])
            frame, count = frame_along(directions)
            held[dofs] = np.nan
            held[dofs[:count]] = np.linalg.lstsq(directions @ frame[:count].T, values)[0]
            frames[node] = frame
        return held, NodalFrames(frames, self.space.node_dofs)
