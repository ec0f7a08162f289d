"""Stiffness and mass from scikit-fem's forms."""

import math

import numpy as np
from skfem import Basis, BilinearForm, ElementVector
from skfem.helpers import dot
from skfem.models.elasticity import linear_elasticity

from needlefem.arrays import Floats, SkfemMesh, Sparse
from needlefem.elements import ElementRow
from needlefem.errors import CaseError


def displacement_basis(mesh: SkfemMesh, element: ElementRow, order: int) -> Basis:
    """Return the vector-valued basis of the displacement, integrating degree `order` exactly.

    Order 0 is one point in the middle of a simplex, which scikit-fem's own rules never are.
    """
    vector = ElementVector(element.make())
    if order > 0:
        return Basis(mesh, vector, intorder=order)
    corners = mesh.dim() + 1
    middle = np.full((mesh.dim(), 1), 1.0 / corners)
    return Basis(mesh, vector, quadrature=(middle, np.array([1.0 / math.factorial(mesh.dim())])))


def stiffness(basis: Basis, lam: Floats, mu: Floats) -> Sparse:
    """Return K, shape (ndofs, ndofs), N/m (per metre of thickness in 2D, plane strain).

    Parameters
    ----------
    basis : skfem.Basis
        Basis of the displacement.
    lam, mu : array, shape (ncells,)
        Lame parameters of every cell, Pa.
    """
    return linear_elasticity(lam[:, None], mu[:, None]).assemble(basis)


def mass(basis: Basis, density: Floats) -> Sparse:
    """Return the consistent mass matrix, shape (ndofs, ndofs), kg (per metre in 2D).

    `density` has shape (ncells,), kg/m^3.
    """
    return _mass_form(density).assemble(basis)


def lumped_mass(basis: Basis, density: Floats, scheme: str, element: ElementRow) -> Floats:
    """Return the diagonal of a lumped mass matrix, shape (ndofs,), kg (per metre in 2D).

    ``"row-sum"`` adds every row up; ``"hrz"`` scales each cell's diagonal to the cell's mass
    (E. Hinton, T. Rock, O. C. Zienkiewicz, Earthquake Eng. Struct. Dyn. 4, 1976).

    Raises
    ------
    CaseError
        The element doesn't admit the scheme: it would give zero or negative masses.
    """
    if scheme not in element.lumpings:
        remedy = "use " + " or ".join(element.lumpings)
        raise CaseError("lumping", f"'{scheme}' gives {element.name} zero masses", remedy)
    if scheme == "row-sum":
        sums: Floats = np.asarray(mass(basis, density).sum(axis=1)).ravel()
        return sums
    cells = _mass_form(density).coo_data(basis).tolocal()
    diagonal = np.einsum("eii->ei", cells)
    dim = basis.mesh.dim()
    total = density * np.sum(basis.dx, axis=1)
    scaled = diagonal * (total / (diagonal.sum(axis=1) / dim))[:, None]
    return np.bincount(basis.element_dofs.T.ravel(), scaled.ravel(), basis.N).astype(float)


def _mass_form(density: Floats) -> BilinearForm:
    def form(u: Floats, v: Floats, _: object) -> Floats:
        value: Floats = density[:, None] * dot(u, v)
        return value

    return BilinearForm(form)
