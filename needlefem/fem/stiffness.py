"""The stiffness of a discretised tissue, with a pressure field for mixed elements.

The stiffness of a mixed element is ``K = A + B' inv(C) B``. A is the resistance to a change of
shape, B the change of volume due to a displacement, and C the compressibility of the pressure
functions. K itself is a full matrix. Therefore the system ``[[A, B'], [B, -C]]`` is solved instead,
which exists for incompressible tissue (C = 0) as well. All other elements have K alone.

The pressure is continuous within a material and discontinuous between two. At the interface of two
laws the strain has a jump, and so has the pressure; a continuous function would smear it.
"""

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from scipy.sparse import block_array, vstack
from skfem import Basis

from needlefem._arrays import Floats, Ints, Points, SkfemMesh, Sparse
from needlefem.elements import BBAR, DISPLACEMENT, ElementType
from needlefem.elements.shape_functions import shape_table
from needlefem.errors import CaseError, SimulationError
from needlefem.fem import forms
from needlefem.fem.factorization import Factor, factorise, lasting_state
from needlefem.fem.function_space import FunctionSpace, NodalFrames
from needlefem.materials import VolumetricSplit
from needlefem.materials.voigt import volumetric


class Pressures:
    """Pressure functions of a mixed element; each material has its own.

    Parameters
    ----------
    mesh : skfem.Mesh
    element : ElementType
        A mixed element.
    owner : array, shape (ncells,)
        Number of the law of each cell.
    """

    def __init__(self, mesh: SkfemMesh, element: ElementType, owner: Ints) -> None:
        self._element = element
        self._basis = forms.pressure_basis(mesh, element)
        self._parts = [np.flatnonzero(owner == number) for number in range(int(owner.max()) + 1)]
        self._parts = [cells for cells in self._parts if cells.size]
        self._used = [np.unique(self._basis.element_dofs[:, cells]) for cells in self._parts]
        starts = np.cumsum([0, *(len(used) for used in self._used)])
        self.count = int(starts[-1])
        self.cell_dofs: Ints = np.empty_like(self._basis.element_dofs, dtype=np.intp)
        for cells, used, start in zip(self._parts, self._used, starts[:-1], strict=True):
            local = np.searchsorted(used, self._basis.element_dofs[:, cells])
            self.cell_dofs[:, cells] = start + local

    def coupling(self, basis: Basis) -> Sparse:
        """Return B, shape (count, ndofs), for the basis of the displacement."""
        rows = []
        for cells, used in zip(self._parts, self._used, strict=True):
            whole = forms.coupling(basis.with_elements(cells), self._basis.with_elements(cells))
            rows.append(whole.tocsr()[used])
        found: Sparse = vstack(rows).tocsr()
        return found

    def mass(self, weight: Floats) -> Sparse:
        """Return the mass matrix with one weight per cell, shape (count, count)."""
        blocks = []
        for cells, used in zip(self._parts, self._used, strict=True):
            whole = forms.pressure_mass(self._basis.with_elements(cells), weight[cells])
            blocks.append(whole.tocsr()[used][:, used])
        n = len(blocks)
        diagonal = [[blocks[i] if i == j else None for j in range(n)] for i in range(n)]
        found: Sparse = block_array(diagonal).tocsr()
        return found

    def at(self, dofs: Floats, reference: Points) -> Floats:
        """Return the pressure at reference points (n, dim) of all cells, shape (ncells, n), Pa."""
        if self._element.pressure is None:  # `pressure_basis` has already raised the error
            raise TypeError
        shape = shape_table(self._element.pressure)(reference)
        found: Floats = np.einsum("kc,nk->cn", dofs[self.cell_dofs], shape)
        return found


class Stiffness:
    """Stiffness of an element with given laws on a mesh.

    Parameters
    ----------
    space : FunctionSpace
    splits : sequence of VolumetricSplit
        Laws of the materials, in the plane or in space.
    owner : array, shape (ncells,)
        Number of the law of each cell.

    Attributes
    ----------
    law : array, shape (n, n, ncells), Pa
        Voigt stiffness of each cell; without the volumetric part if that is integrated
        separately.
    compressibility : array, shape (ncells,), 1/Pa
    poissons_ratio : float
        The largest Poisson's ratio of isotropic laws with the same compressibility and shear.

    Raises
    ------
    CaseError
        Incompressible tissue with an element that has no pressure field.
    """

    def __init__(
        self, space: FunctionSpace, splits: Sequence[VolumetricSplit], owner: Ints
    ) -> None:
        # no reference to the space, which owns this object: both are freed together
        self._mesh, self._element, self._basis = space.mesh, space.element, space.basis
        self._node_of = space.node_of
        splits, owner = _different(splits, owner)
        self._owner = owner
        shape = np.stack([part.shape for part in splits], axis=2)
        self.compressibility: Floats = np.array([p.compressibility for p in splits])[owner]
        if self._element.definite and self.compressibility.min() == 0.0:
            remedy = "use a mixed element: P2-P1, Q2-Q1 or MINI"
            problem = f"{self._element.name} can't be used for incompressible tissue"
            raise CaseError("discretization.element", problem, remedy)
        if self._element.volume == DISPLACEMENT:
            m = volumetric(space.dim)
            kappas = np.array([part.kappa for part in splits])
            shape = shape + kappas * np.outer(m, m)[:, :, None]
        self.law: Floats = shape[:, :, owner]
        self.poissons_ratio = max(part.poissons_ratio for part in splits)

    def __getstate__(self) -> dict[str, object]:
        """Return the state for pickling, without factorisations, matrices and basis."""
        return lasting_state(self, "_basis")

    def __setstate__(self, state: dict[str, object]) -> None:
        """Restore a stiffness; the basis is built again."""
        vars(self).update(state)
        rule = self._element.stiffness_rule
        self._basis = forms.displacement_basis(self._mesh, self._element, rule)

    @cached_property
    def matrix(self) -> Sparse:
        """K, or A for a mixed element, shape (ndofs, ndofs)."""
        found = forms.stiffness(self._basis, self.law)
        rule = self._element.volume_rule
        if self._element.volume == BBAR and rule is not None:
            basis = forms.displacement_basis(self._mesh, self._element, rule)
            found = found + forms.volume_stiffness(basis, 1.0 / self.compressibility)
        return found

    @cached_property
    def pressures(self) -> Pressures:
        """The pressure functions of a mixed element."""
        return Pressures(self._mesh, self._element, self._owner)

    @cached_property
    def coupling(self) -> Sparse:
        """B, shape (npressures, ndofs)."""
        return self.pressures.coupling(self._basis)

    @cached_property
    def volume(self) -> Sparse:
        """C, shape (npressures, npressures)."""
        return self.pressures.mass(self.compressibility)

    def pressure(self, u: Floats) -> Floats:
        """Return the dofs of the pressure (tension positive) for given displacements, Pa.

        The shape is (npressures,), or (npressures, k) for k displacements in columns.

        Raises
        ------
        SimulationError
            Some tissue is incompressible: the pressure does not follow from the displacement.
        """
        if self.compressibility.min() == 0.0:
            raise SimulationError("the pressure of incompressible tissue depends on its loads")
        found: Floats = self._volume_factor.solve(np.asarray(self.coupling @ u))
        return found

    @cached_property
    def _volume_factor(self) -> Factor:
        return factorise(self.volume)

    def force(self, u: Floats) -> Floats:
        """Return K u for one displacement or for several in columns."""
        found: Floats = self.matrix @ u
        if not self._element.definite:
            found = found + self.coupling.T @ self.pressure(u)
        return found

    def energy(self, u: Floats) -> Floats:
        """Return the strain energy of displacements in columns, shape (k,), J (J/m in 2D).

        In incompressible cells the change of volume stores no energy.
        """
        found: Floats = 0.5 * np.einsum("ij,ij->j", u, self.matrix @ u)
        if not self._element.definite:
            gained = np.asarray(self.coupling @ u)
            some = np.flatnonzero(self.volume.diagonal() > 0.0)
            if some.size:
                pressure = factorise(self.volume.tocsr()[some][:, some]).solve(gained[some])
                found = found + 0.5 * np.einsum("ij,ij->j", gained[some], pressure)
        return found

    def dense(self) -> Floats:
        """Return K as a dense array (for small problems)."""
        return self.force(np.eye(self._basis.N))

    def factor(
        self,
        free: Ints,
        stiffness: float = 1.0,
        mass: Sparse | None = None,
        frames: NodalFrames | None = None,
    ) -> Factor:
        """Return the factor of ``stiffness K + mass`` on free dofs; mass: shape (ndofs, ndofs).

        Parameters
        ----------
        free : array
            Free dofs; at nodes with a frame, components in the frame.
        stiffness : float
        mass : sparse, shape (ndofs, ndofs), optional
        frames : NodalFrames, optional

        Raises
        ------
        SimulationError
            The matrix is singular.
        CaseError
            Incompressible tissue is enclosed on all sides.
        """
        system, scale = self.system(free, stiffness, mass, frames)
        nodes = self._node_of[free]
        if self._element.definite:
            return factorise(system, groups=nodes)
        pressures = system.shape[0] - len(free)
        own = int(self._node_of.max()) + 1 + np.arange(pressures)
        groups = np.concatenate([nodes, own])
        whole = factorise(system, definite=False, groups=groups)
        return _MixedFactor(whole, len(free), pressures, scale)

    def system(
        self,
        free: Ints,
        stiffness: float = 1.0,
        mass: Sparse | None = None,
        frames: NodalFrames | None = None,
    ) -> tuple[Sparse, float]:
        """Return the matrix that `factor` factorises, and the unit of the pressure in it, Pa."""
        matrix = stiffness * self.matrix if mass is None else stiffness * self.matrix + mass
        if frames is not None:
            matrix = frames.local_matrix(matrix)
        block = matrix.tocsr()[free][:, free]
        if self._element.definite:
            return block, 1.0
        coupling = self.coupling if frames is None else self.coupling @ frames.matrix
        coupling = coupling.tocsr()[:, free]
        self._refuse_enclosed(coupling)
        # this unit of the pressure gives both kinds of rows the same magnitude: better pivots
        scale = float(np.abs(block.data).mean() / np.abs(coupling.data).mean())
        volume = self.volume * (scale**2 / stiffness)
        return block_array([[block, scale * coupling.T], [scale * coupling, -volume]]), scale

    def _refuse_enclosed(self, coupling: Sparse) -> None:
        if self.compressibility.max() > 0.0:
            return
        ones = np.ones(coupling.shape[0])
        if np.abs(coupling.T @ ones).max() <= 1e-12 * np.abs(coupling.data).max():
            remedy = "free a face, or lower Poisson's ratio"
            raise CaseError("supports", "incompressible tissue is enclosed on all sides", remedy)

    def solve(
        self, free: Ints, load: Floats, held: Floats, frames: NodalFrames | None = None
    ) -> tuple[Floats, Floats]:
        """Return displacement and pressure for loads and prescribed displacements.

        Parameters
        ----------
        free : array
            Dofs to be solved for; at nodes with a frame, components in the frame.
        load : array, shape (ndofs,)
        held : array, shape (ndofs,)
            Displacement of the other dofs; zero on the free ones.
        frames : NodalFrames, optional

        Returns
        -------
        Displacement, shape (ndofs,), and pressure, shape (npressures,); empty without pressure.
        """
        found = held.copy()
        if frames is not None:
            held = frames.matrix @ held
        rest = load - self.matrix @ held
        if frames is not None:
            rest = frames.matrix.T @ rest
        factor, pressure = self.factor(free, frames=frames), np.zeros(0)
        if isinstance(factor, _MixedFactor):
            moved, pressure = factor.solve_both(rest[free], -(self.coupling @ held))
        else:
            moved = factor.solve(rest[free])
        found[free] += moved
        return found if frames is None else frames.matrix @ found, pressure


def _different(
    splits: Sequence[VolumetricSplit], owner: Ints
) -> tuple[list[VolumetricSplit], Ints]:
    """Return the distinct laws, and for each cell the number of its law among them."""
    kept: list[VolumetricSplit] = []
    number = np.zeros(len(splits), dtype=np.intp)
    for position, part in enumerate(splits):
        same = [
            i
            for i, other in enumerate(kept)
            if other.compressibility == part.compressibility
            and np.array_equal(other.shape, part.shape)
        ]
        number[position] = same[0] if same else len(kept)
        if not same:
            kept.append(part)
    return kept, number[owner]


class _MixedFactor:
    """Factor of a saddle-point matrix whose `solve` returns the displacement alone."""

    def __init__(self, factor: Factor, displacements: int, pressures: int, scale: float) -> None:
        self._factor, self._n, self._m, self._scale = factor, displacements, pressures, scale
        self.name = f"{factor.name}, pivots off the diagonal"

    def solve(self, rhs: Floats) -> Floats:
        return self.solve_both(rhs, np.zeros((self._m, *rhs.shape[1:])))[0]

    def solve_both(self, rhs: Floats, volumes: Floats) -> tuple[Floats, Floats]:
        both = self._factor.solve(np.concatenate([rhs, self._scale * volumes]))
        return both[: self._n], self._scale * both[self._n :]
