"""Systems ``M a + C v + K u = f``, their damping and viscoelastic branches, vibration modes."""

import dataclasses
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Protocol

import numpy as np
from scipy.sparse import csc_array, diags_array, hstack
from scipy.sparse.linalg import LinearOperator, eigsh

from needlefem._arrays import Floats, Sparse
from needlefem.errors import CaseError
from needlefem.fem.factorization import Factor, factorise
from needlefem.fem.forms import Field
from needlefem.fem.tissue_model import TissueModel
from needlefem.materials.linear_elastic import load_factor, relaxation_factor


@dataclasses.dataclass(frozen=True, kw_only=True)
class Damping:
    """Rayleigh damping ``C = mass_rate M + stiffness_time K``, in 1/s and s."""

    mass_rate: float = 0.0
    stiffness_time: float = 0.0

    @classmethod
    def from_ratios(
        cls, frequencies: tuple[float, float], ratios: tuple[float, float]
    ) -> "Damping":
        """Return the damping with two damping ratios at two frequencies (Hz).

        ``zeta = mass_rate / (2 w) + stiffness_time w / 2`` (Lord Rayleigh 1877).
        """
        first, second = (2.0 * np.pi * f for f in frequencies)
        if not first > 0.0 or first == second:
            raise CaseError("damping", f"frequencies {frequencies}", "give two different ones")
        matrix = 0.5 * np.array([[1.0 / first, first], [1.0 / second, second]])
        rate, time = np.linalg.solve(matrix, np.array(ratios))
        return cls(mass_rate=float(rate), stiffness_time=float(time))

    def ratio(self, frequency: float) -> float:
        """Return the damping ratio (1 is critical damping) at a frequency, Hz."""
        omega = 2.0 * np.pi * frequency
        return 0.5 * (self.mass_rate / omega + self.stiffness_time * omega)


# Internal variables of viscoelastic tissue. The internal variable of a Maxwell branch is a strain,
# and this strain belongs to a displacement field. Therefore all branches with the same relaxation
# time need one vector of unknowns together, instead of values at every quadrature point.


class MaxwellUpdate:
    """Update of a system's viscoelastic branches over one time step.

    Parameters
    ----------
    branches : sequence of (float, sparse matrix)
        Relaxation times, s, and stiffness matrices.
    step : float, s

    Attributes
    ----------
    gains : list of float
        Share of each branch's stiffness in the operator of the step.
    """

    def __init__(self, branches: Sequence[tuple[float, Sparse]], step: float) -> None:
        self._stiffness = [stiffness for _, stiffness in branches]
        self._decays = [relaxation_factor(step, time) for time, _ in branches]
        self.gains = [load_factor(step, time) for time, _ in branches]

    def __bool__(self) -> bool:
        """Whether the system has viscoelastic branches."""
        return bool(self.gains)

    def carried(self, parts: Floats, u: Floats, before: float = 0.0) -> Floats:
        """Return the force of the branches in a step without the part of the new displacement.

        The force at the start of the step has the weight `before`, the force at its end the
        weight ``1 - before``; shape (n,), N.
        """
        total = np.zeros_like(u)
        for part, stiffness, left, kept in zip(
            parts, self._stiffness, self._decays, self.gains, strict=True
        ):
            ends = (1.0 - before) * (left * part - kept * u)
            total += stiffness @ (ends + before * part if before else ends)
        return total

    def force(self, parts: Floats) -> Floats:
        """Return the force of the branches, shape (n,), N."""
        total = np.zeros(parts.shape[1])
        for part, stiffness in zip(parts, self._stiffness, strict=True):
            total += stiffness @ part
        return total

    def advance(self, parts: Floats, change: Floats) -> Floats:
        """Return the displacements of the branches after a step with a given change of `u`."""
        pairs = zip(parts, self._decays, self.gains, strict=True)
        return np.array([left * part + kept * change for part, left, kept in pairs])

    def energy(self, parts: Floats) -> float:
        """Return the energy stored in the branches, J."""
        pairs = zip(parts, self._stiffness, strict=True)
        return 0.5 * float(sum(part @ (stiffness @ part) for part, stiffness in pairs))

    def lost(self, before: Floats, after: Floats, *, at_once: bool = False) -> float:
        """Return the energy dissipated by the dashpots in a step, J.

        This is the mean force times the displacement of the dashpot, computed from the
        displacements at both ends; for short steps ``step / T`` times twice the mean energy.
        `at_once` marks a sudden change at a fixed time, in which the branches do not relax.
        """
        total = 0.0
        zipped = zip(before, after, self._stiffness, self._decays, self.gains, strict=True)
        for old, new, stiffness, decayed, kept in zipped:
            left = 1.0 if at_once else decayed
            slipped = (1.0 / kept - 1.0) * new + (1.0 - left / kept) * old
            total += 0.5 * float((old + new) @ (stiffness @ slipped))
        return total


# Systems to be integrated in time: ``M a + C v + K u = f`` on a set of unknowns.


Operator = Callable[[Floats], Floats]
"""Returns a force, shape (n,), for vectors, shape (k, n)."""


class System(Protocol):
    """Products and factorisations of mass, damping and stiffness: the interface of integrators.

    Attributes
    ----------
    size : int
        Number of unknowns.
    damped : bool
        Whether there is damping.
    branches : tuple of (float, sparse matrix)
        Relaxation times (s) and stiffness matrices of viscoelastic branches. K is the stiffness
        of the fully relaxed system.
    """

    size: int
    damped: bool
    branches: tuple[tuple[float, Sparse], ...]

    def mass_times(self, x: Floats) -> Floats:
        """Return M x."""
        ...

    def stiffness_times(self, x: Floats) -> Floats:
        """Return K x."""
        ...

    def products(self, a: Floats | None, v: Floats | None, u: Floats | None) -> Floats:
        """Return ``M a + C v + K u`` with as few products as possible; None stands for zero."""
        ...

    def operator(self, coefficients: Floats) -> Operator:
        """Return a function that computes ``M a + C v + K u`` from k vectors, shape (k, n).

        `coefficients`, shape (3, k), are the weights of the vectors in a, v and u.
        """
        ...

    def factor(
        self, mass: float, damping: float, stiffness: float, shares: Sequence[float] = ()
    ) -> Factor:
        """Return the factor of ``mass M + damping C + stiffness K`` plus shares of the branches."""
        ...

    def strain_energy(self, u: Floats) -> float:
        """Return the strain energy of a displacement, J."""
        ...

    @property
    def largest_frequency(self) -> float:
        """The largest angular frequency, 1/s."""
        ...


class MatrixSystem:
    """A system with given matrices; see `System`.

    Parameters
    ----------
    mass, stiffness, damping : array or sparse matrix, shape (n, n)
        Symmetric matrices; without `damping` there is none.
    branches : sequence of (float, matrix)
    """

    def __init__(
        self,
        mass: Sparse | Floats,
        stiffness: Sparse | Floats,
        damping: Sparse | Floats | None = None,
        branches: Sequence[tuple[float, Sparse | Floats]] = (),
    ) -> None:
        self.branches = tuple((time, csc_array(matrix)) for time, matrix in branches)
        self.mass, self.stiffness = csc_array(mass), csc_array(stiffness)
        self.damped = damping is not None
        self.damping = csc_array(0.0 * self.mass if damping is None else damping)
        self.size = int(self.mass.shape[0])

    def mass_times(self, x: Floats) -> Floats:
        """See `System`."""
        found: Floats = self.mass @ x
        return found

    def stiffness_times(self, x: Floats) -> Floats:
        """See `System`."""
        found: Floats = self.stiffness @ x
        return found

    def products(self, a: Floats | None, v: Floats | None, u: Floats | None) -> Floats:
        """See `System`."""
        found: Floats = np.zeros(self.size) if a is None else self.mass @ a
        if v is not None:
            found += self.damping @ v
        if u is not None:
            found += self.stiffness @ u
        return found

    def operator(self, coefficients: Floats) -> Operator:
        """See `System`."""
        return joined((self.mass, self.damping, self.stiffness), coefficients)

    def factor(
        self, mass: float, damping: float, stiffness: float, shares: Sequence[float] = ()
    ) -> Factor:
        """See `System`."""
        total = mass * self.mass + damping * self.damping + stiffness * self.stiffness
        return factorise(total + weighted(self.branches, shares))

    def strain_energy(self, u: Floats) -> float:
        """See `System`."""
        return 0.5 * float(u @ self.stiffness_times(u))

    @cached_property
    def largest_frequency(self) -> float:
        """See `System`."""
        if self.size < 3:
            stiffness = self.stiffness + weighted(self.branches, [1.0] * len(self.branches))
            values = np.linalg.eigvals(np.linalg.solve(self.mass.toarray(), stiffness.toarray()))
            return float(np.sqrt(np.max(values.real)))
        return largest(self, self.mass)


def joined(matrices: Sequence[Sparse], coefficients: Floats) -> Operator:
    """Return the sum of matrices times linear combinations of vectors as one wide product.

    `coefficients` has one row per matrix; a row of zeros causes no cost.
    """
    used = np.flatnonzero(np.any(coefficients, axis=1))
    rows = np.ascontiguousarray(coefficients[used])
    matrix = hstack([matrices[int(i)] for i in used], format="csr")
    return lambda vectors: matrix @ (rows @ vectors).ravel()


def weighted(branches: Sequence[tuple[float, Sparse]], shares: Sequence[float]) -> Sparse | int:
    """Return the sum of the branches' stiffness matrices times their shares; 0 without shares."""
    return sum((share * matrix for share, (_, matrix) in zip(shares, branches, strict=False)), 0)


def largest(system: System, mass: Sparse) -> float:
    """Return the largest angular frequency by Lanczos iteration on ``inv(M) K``.

    In fast motion the branches do not relax, so that K includes their full stiffness.
    """
    inverse = factorise(mass.tocsc())
    shape = (system.size, system.size)
    at_once = weighted(system.branches, [1.0] * len(system.branches))

    def push(x: Floats) -> Floats:
        found = system.stiffness_times(x)
        return found if isinstance(at_once, int) else found + at_once @ x

    stiffness = LinearOperator(shape, matvec=push, dtype=float)
    solve = LinearOperator(shape, matvec=inverse.solve, dtype=float)
    start = np.random.default_rng(0).normal(size=system.size)
    square = eigsh(
        stiffness, 1, mass, Minv=solve, which="LM", v0=start, tol=1e-10, return_eigenvectors=False
    )
    return float(np.sqrt(square[0]))


# A tissue as a system.


class TissueSystem:
    """The free dofs of a tissue; see `System`.

    Parameters
    ----------
    model : TissueModel
    damping : Damping
    lumping : str, optional
        A lumping scheme that is admissible for the element; consistent mass by default.

    Raises
    ------
    CaseError
        A material has no density.
    """

    def __init__(
        self, model: TissueModel, damping: Damping | None = None, lumping: str | None = None
    ) -> None:
        if model.density.min() <= 0.0:
            remedy = "give every material a density, or simulate quasi-statically"
            raise CaseError("materials", "a material has no density, which inertia needs", remedy)
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
        return self.model.unknowns(self.model.stiffness.force(self.model.dof_vectors(x)))

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
        return self.model.stiffness.factor(self.model.free_dofs, elastic, added, self.model.frames)

    def strain_energy(self, u: Floats) -> float:
        """See `System`."""
        return float(self.model.stiffness.energy(self.model.dof_vectors(u)[:, None])[0])

    def unknowns(self, field: Field) -> Floats:
        """Return a vector field at the free nodes, shape (size,), such as an initial condition."""
        return self.model.unknowns(self.model.dof_vector(field(self.model.nodes)))

    def body_force(self, field: Field) -> Floats:
        """Return the load of a force per volume, N/m^3, shape (size,)."""
        return self.model.unknowns(self.model.body_load(field))

    def traction(self, face: str, field: Field) -> Floats:
        """Return the load of a traction, Pa, on a named face, shape (size,)."""
        return self.model.unknowns(self.model.face_load(face, field))

    def nodal(self, x: Floats) -> Floats:
        """Return unknowns as a nodal field, shape (nnodes, dim); zero at fixed dofs."""
        return self.model.nodal(self.model.dof_vectors(x))

    @cached_property
    def largest_frequency(self) -> float:
        """See `System`."""
        return largest(self, self.mass)


def _sum(one: Floats | None, factor: float, other: Floats) -> Floats | None:
    """Return ``one + factor other``, where None is zero."""
    if not factor:
        return one
    return factor * other if one is None else one + factor * other


# Free vibration: frequencies and mode shapes, with or without supports.


def modes(system: TissueSystem, count: int, near: float = 0.0) -> tuple[Floats, Floats]:
    """Return the vibration modes with the frequencies closest to a value.

    Parameters
    ----------
    system : TissueSystem
        Its damping is ignored.
    count : int
    near : float, 1/s
        Angular frequency; 0 returns the lowest modes.

    Returns
    -------
    Angular frequencies, shape (count,), 1/s, rising, and mode shapes, shape (size, count), with
    modal mass 1. The method is shift-invert Lanczos, which needs a factorisation of ``K - shift M``
    only. A tissue without supports has zero frequencies for its rigid motions.
    """
    mass: Sparse = system.mass.tocsc()
    # a negative shift makes the operator positive definite; it must be small compared to the result
    shift = near**2 if near else -1e-3 * _scale(system)
    factor = system.factor(-shift, 0.0, 1.0)
    inverse = LinearOperator(mass.shape, matvec=factor.solve, dtype=float)
    start = np.random.default_rng(1).normal(size=system.size)  # fixed seed: reproducible results
    squares, shapes = eigsh(
        mass, count, mass, sigma=shift, OPinv=inverse, which="LM", v0=start
    )  # the first argument is not used when the inverse is given
    order = np.argsort(squares)
    frequencies = np.sqrt(np.maximum(squares[order], 0.0))
    return frequencies, shapes[:, order]


def _scale(system: TissueSystem) -> float:
    """Return an estimate of the lowest squared frequency: a wave across the whole tissue."""
    model = system.model
    size = float(np.ptp(model.nodes))
    speeds = [part.shear / density for part, density in model.laws()]
    return min(speeds) * (np.pi / size) ** 2
