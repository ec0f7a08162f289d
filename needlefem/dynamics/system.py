"""What is integrated in time: ``M a + C v + K u = f`` on some unknowns."""

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from scipy.sparse import csc_array, hstack
from scipy.sparse.linalg import LinearOperator, eigsh

from needlefem._arrays import Floats, Sparse
from needlefem.fem.factorization import Factor, factorise

Operator = Callable[[Floats], Floats]
"""Makes a force, shape (n,), of vectors, shape (k, n)."""


class System(Protocol):
    """Mass, damping and stiffness as products and factorisations: all that integrators see.

    Attributes
    ----------
    size : int
        Number of unknowns.
    damped : bool
        Whether there is a damping at all.
    branches : tuple of (float, sparse matrix)
        Relaxation times (s) of a viscoelastic system and the stiffnesses that relax; K is what
        is left when all have.
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
        """Return ``M a + C v + K u`` by as few products as it takes; None stands for zero."""
        ...

    def operator(self, coefficients: Floats) -> Operator:
        """Return what makes ``M a + C v + K u`` of k vectors, shape (k, n), at once.

        `coefficients`, shape (3, k), say what the vectors add to a, v and u.
        """
        ...

    def factor(
        self, mass: float, damping: float, stiffness: float, shares: Sequence[float] = ()
    ) -> Factor:
        """Factorise ``mass M + damping C + stiffness K`` and a share of every branch."""
        ...

    def strain_energy(self, u: Floats) -> float:
        """Return the strain energy of a displacement, J."""
        ...

    @property
    def largest_frequency(self) -> float:
        """The largest angular frequency, 1/s."""
        ...


class MatrixSystem:
    """A system given by its matrices; see `System`.

    Parameters
    ----------
    mass, stiffness, damping : array or sparse matrix, shape (n, n)
        Symmetric; no damping when left out.
    branches : sequence of (float, matrix)
    """

    def __init__(
        self,
        mass: Sparse,
        stiffness: Sparse,
        damping: Sparse | None = None,
        branches: Sequence[tuple[float, Sparse]] = (),
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
    """Return the sum of matrices times sums of vectors as one product with a wide matrix.

    `coefficients` has a row for every matrix; those of zeros cost nothing.
    """
    used = np.flatnonzero(np.any(coefficients, axis=1))
    rows = np.ascontiguousarray(coefficients[used])
    matrix = hstack([matrices[int(i)] for i in used], format="csr")
    return lambda vectors: matrix @ (rows @ vectors).ravel()


def weighted(branches: Sequence[tuple[float, Sparse]], shares: Sequence[float]) -> Any:
    """Return the sum of the branches' stiffnesses, each times its share; 0 without shares."""
    return sum((share * matrix for share, (_, matrix) in zip(shares, branches, strict=False)), 0)


def largest(system: System, mass: Sparse) -> float:
    """Return the largest angular frequency by Lanczos iteration on ``inv(M) K``.

    Branches have no time to relax in fast motion, and add all their stiffness.
    """
    inverse = factorise(mass.tocsc())
    shape = (system.size, system.size)
    at_once = weighted(system.branches, [1.0] * len(system.branches))

    def push(x: Floats) -> Floats:
        found = system.stiffness_times(x)
        return found + at_once @ x if system.branches else found

    stiffness = LinearOperator(shape, matvec=push, dtype=float)
    solve = LinearOperator(shape, matvec=inverse.solve, dtype=float)
    start = np.random.default_rng(0).normal(size=system.size)
    square = eigsh(
        stiffness, 1, mass, Minv=solve, which="LM", v0=start, tol=1e-10, return_eigenvectors=False
    )
    return float(np.sqrt(square[0]))
