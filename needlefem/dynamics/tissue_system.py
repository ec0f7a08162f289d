"""A tissue as a system to integrate in time."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from scipy.sparse import diags_array

from needlefem._arrays import Floats, Sparse
from needlefem.dynamics.damping import Damping
from needlefem.dynamics.system import Operator, joined, largest, weighted
from needlefem.errors import CaseError
from needlefem.fem.factorization import Factor, factorise
from needlefem.fem.forms import Field
from needlefem.fem.tissue_model import TissueModel


class TissueSystem:
    """The free dofs of a tissue; see `System`.

    Parameters
    ----------
    model : TissueModel
    damping : Damping
    lumping : str, optional
        A lumping that the element admits; consistent mass when left out.

    Raises
    ------
    CaseError
        The tissue has no mass somewhere.
    """

    def __init__(
        self, model: TissueModel, damping: Damping | None = None, lumping: str | None = None
    ) -> None:
        if model.density.min() <= 0.0:
            remedy = "give every material a density, or simulate quasi-statically"
            raise CaseError("materials", "a material without density has no dynamics", remedy)
        self.model, self.rayleigh = model, damping or Damping()
        self.damped = self.rayleigh != Damping()
        self.size = len(model.free_dofs)
        whole: Sparse = model.mass
        if lumping is not None:
            whole = diags_array(model.lumped_mass(lumping)).tocsr()
        self._whole = whole
        self.mass: Sparse = model.free_block(whole.tocsr())
        self._stiffness: Sparse = model.free_block(model.stiffness.matrix.tocsr())
        self.branches = tuple((t, model.free_block(k.tocsr())) for t, k in model.branches)

    def mass_times(self, x: Floats) -> Floats:
        """See `System`."""
        found: Floats = self.mass @ x
        return found

    def stiffness_times(self, x: Floats) -> Floats:
        """See `System`."""
        if self.model.element.definite:
            found: Floats = self._stiffness @ x
            return found
        forces: Floats = self.model.stiffness.force(self._on_all(x))[self.model.free_dofs]
        return forces

    def products(self, a: Floats | None, v: Floats | None, u: Floats | None) -> Floats:
        """See `System`."""
        if v is not None:
            a = _sum(a, self.rayleigh.mass_rate, v)
            u = _sum(u, self.rayleigh.stiffness_time, v)
        if a is None:
            return np.zeros(self.size) if u is None else self.stiffness_times(u)
        found = self.mass_times(a)
        return found if u is None else found + self.stiffness_times(u)

    def operator(self, coefficients: Floats) -> Operator:
        """See `System`."""
        rate, time = self.rayleigh.mass_rate, self.rayleigh.stiffness_time
        rows = np.array([[1.0, rate, 0.0], [0.0, time, 1.0]]) @ coefficients
        if self.model.element.definite:
            return joined((self.mass, self._stiffness), rows)
        inertia, elastic = joined((self.mass,), rows[:1]), rows[1]
        if not elastic.any():
            return inertia
        return lambda vectors: inertia(vectors) + self.stiffness_times(elastic @ vectors)

    def factor(
        self, mass: float, damping: float, stiffness: float, shares: Sequence[float] = ()
    ) -> Factor:
        """See `System`."""
        inertia = mass + damping * self.rayleigh.mass_rate
        elastic = stiffness + damping * self.rayleigh.stiffness_time
        if elastic == 0.0:
            return factorise(inertia * self.mass)
        added = inertia * self._whole + weighted(self.model.branches, shares)
        return self.model.stiffness.factor(self.model.free_dofs, elastic, added)

    def strain_energy(self, u: Floats) -> float:
        """See `System`."""
        return float(self.model.stiffness.energy(self._on_all(u)[:, None])[0])

    def unknowns(self, field: Field) -> Floats:
        """Return a vector field at the free nodes, shape (size,): an initial condition, say."""
        return self.model.dof_vector(field(self.model.nodes))[self.model.free_dofs]

    def body_force(self, field: Field) -> Floats:
        """Return the load of a force per volume, N/m^3, shape (size,)."""
        return self.model.body_load(field)[self.model.free_dofs]

    def traction(self, face: str, field: Field) -> Floats:
        """Return the load of a traction, Pa, on a named face, shape (size,)."""
        return self.model.face_load(face, field)[self.model.free_dofs]

    def nodal(self, x: Floats) -> Floats:
        """Return unknowns as a nodal field, shape (nnodes, dim); zero where the tissue is held."""
        return self.model.nodal(self._on_all(x))

    def _on_all(self, x: Floats) -> Floats:
        whole = np.zeros(self.model.ndofs)
        whole[self.model.free_dofs] = x
        return whole

    @cached_property
    def largest_frequency(self) -> float:
        """See `System`."""
        return largest(self, self.mass)


def _sum(one: Floats | None, factor: float, other: Floats) -> Floats | None:
    """Return ``one + factor other``, where None is zero."""
    if not factor:
        return one
    return factor * other if one is None else one + factor * other
