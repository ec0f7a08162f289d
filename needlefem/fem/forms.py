"""Matrices and load vectors, assembled with scikit-fem's forms."""

from collections.abc import Callable
from copy import copy

import numpy as np
from skfem import Basis, BilinearForm, ElementVector, FacetBasis, LinearForm
from skfem.assembly.form.form import FormExtraParams
from skfem.element import DiscreteField
from skfem.helpers import div, dot
from skfem.mapping import Mapping, MappingAffine, MappingIsoparametric

from needlefem._arrays import Floats, Ints, Points, SkfemMesh, Sparse
from needlefem.elements import ElementType
from needlefem.elements.shape_functions import Rule
from needlefem.errors import CaseError

Field = Callable[[Points], Floats]
"""A vector field at points (n, dim), shape (n, dim)."""


def displacement_basis(mesh: SkfemMesh, element: ElementType, rule: Rule) -> Basis:
    """Return the vector-valued basis of the displacement with a quadrature rule."""
    vector = ElementVector(element.skfem_element())
    return Basis(mesh, vector, mapping=_mapping(mesh), quadrature=rule())


def fine_basis(mesh: SkfemMesh, element: ElementType, order: int) -> Basis:
    """Return the displacement basis on a quadrature of a given order, for errors and loads."""
    return Basis(
        mesh, ElementVector(element.skfem_element()), mapping=_mapping(mesh), intorder=order
    )


def pressure_basis(mesh: SkfemMesh, element: ElementType) -> Basis:
    """Return the basis of a mixed element's pressure on the quadrature of K."""
    if element.pressure is None:
        raise CaseError(f"element {element.name}", "has no pressure", "use a mixed element")
    quadrature = element.stiffness_rule()
    return Basis(mesh, element.pressure(), mapping=_mapping(mesh), quadrature=quadrature)


class _Affine(MappingAffine):  # type: ignore[misc]
    """An affine mapping that is pickled and copied without its cached tables."""

    def __getstate__(self) -> dict[str, object]:
        return {"dim": self.dim, "mesh": self.mesh, "tind": self.tind}


def _mapping(mesh: SkfemMesh) -> Mapping:
    """Return the mapping from the reference cell; all bases on a mesh share it.

    It is stored in the mesh where skfem looks for it. It refers to a shallow copy of the mesh: with
    a reference to the mesh itself, the mesh would be freed by the garbage collector only.
    """
    if "_cached_mapping" not in vars(mesh):
        _ = mesh.facets  # computed before the copy, so that the copy has them as well
        twin = copy(mesh)
        if mesh.affine:
            mesh._cached_mapping = _Affine(twin)
        else:
            mesh._cached_mapping = MappingIsoparametric(twin, mesh.elem(), mesh.bndelem)
    return mesh._cached_mapping


def strain(gradient: Floats) -> list[Floats]:
    """Return the Voigt strain of a gradient (dim, dim, ...) as a list of components."""
    g = gradient
    if len(g) == 2:
        return [g[0, 0], g[1, 1], g[0, 1] + g[1, 0]]
    return [g[0, 0], g[1, 1], g[2, 2], g[1, 2] + g[2, 1], g[0, 2] + g[2, 0], g[0, 1] + g[1, 0]]


def stiffness(basis: Basis, law: Floats) -> Sparse:
    """Return the stiffness of a law in Voigt notation, shape (ndofs, ndofs), N/m (2D: N/m^2).

    `law` has shape (n, n, ncells), Pa, with n = 3 in the plane and 6 in space.
    """
    rows = [
        [(j, law[i, j][:, None]) for j in range(len(law)) if np.any(law[i, j])]
        for i in range(len(law))
    ]
    met: DiscreteField | None = None
    stress: list[Floats] = []

    def form(u: DiscreteField, v: DiscreteField, _: object) -> Floats:
        nonlocal met, stress
        if u is not met:  # skfem combines one trial function with all test functions in turn
            there = strain(u.grad)
            met, stress = u, [sum(value * there[j] for j, value in row) for row in rows]
        parts = map(np.multiply, strain(v.grad), stress)
        return sum(parts, start=next(parts))

    found: Sparse = BilinearForm(form).assemble(basis)
    return found


def volume_stiffness(basis: Basis, kappa: Floats) -> Sparse:
    """Return the stiffness of ``kappa div u div v``; `kappa` has shape (ncells,), Pa."""

    def form(u: DiscreteField, v: DiscreteField, _: object) -> Floats:
        value: Floats = kappa[:, None] * div(u) * div(v)
        return value

    found: Sparse = BilinearForm(form).assemble(basis)
    return found


def coupling(basis: Basis, pressures: Basis) -> Sparse:
    """Return B, shape (npressures, ndofs): the change of volume due to a displacement."""

    def form(u: DiscreteField, q: DiscreteField, _: object) -> Floats:
        value: Floats = div(u) * q
        return value

    found: Sparse = BilinearForm(form).assemble(basis, pressures)
    return found


def pressure_mass(pressures: Basis, compressibility: Floats) -> Sparse:
    """Return C, shape (npressures, npressures); `compressibility` has shape (ncells,), 1/Pa."""

    def form(p: DiscreteField, q: DiscreteField, _: object) -> Floats:
        value: Floats = compressibility[:, None] * p * q
        return value

    found: Sparse = BilinearForm(form).assemble(pressures)
    return found


def mass(basis: Basis, density: Floats) -> Sparse:
    """Return the consistent mass matrix, shape (ndofs, ndofs), kg (per metre in 2D).

    `density` has shape (ncells,), kg/m^3.
    """
    found: Sparse = _mass_form(density).assemble(basis)
    return found


def lumped_mass(basis: Basis, density: Floats, scheme: str, element: ElementType) -> Floats:
    """Return the diagonal of a lumped mass matrix, shape (ndofs,), kg (per metre in 2D).

    ``"row-sum"`` adds the entries of each row; ``"hrz"`` scales the diagonal of each cell's matrix
    to the mass of the cell (E. Hinton, T. Rock, O. C. Zienkiewicz, Earthquake Eng. Struct. Dyn. 4,
    1976).

    Raises
    ------
    CaseError
        The scheme is not admissible for the element: some masses would be zero or negative.
    """
    if scheme not in element.lumpings:
        remedy = "use " + " or ".join(element.lumpings or ("the consistent mass",))
        raise CaseError("lumping", f"'{scheme}' is not admissible for {element.name}", remedy)
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
    def form(u: DiscreteField, v: DiscreteField, _: object) -> Floats:
        value: Floats = density[:, None] * dot(u, v)
        return value

    return BilinearForm(form)


def body_load(basis: Basis, force: Field) -> Floats:
    """Return the load of a force per volume (N/m^3) on all dofs, shape (ndofs,), N (N/m)."""

    def form(v: DiscreteField, w: FormExtraParams) -> Floats:
        value: Floats = dot(_at(force, w.x), v)
        return value

    found: Floats = LinearForm(form).assemble(basis)
    return found


def traction_load(
    mesh: SkfemMesh,
    element: ElementType,
    facets: Ints,
    traction: Callable[[Points, Points], Floats],
    order: int = 8,
) -> Floats:
    """Return the load of a traction (Pa) on facets, shape (ndofs,), N (N/m).

    `traction` takes points and outward unit normals, both (n, dim), and returns (n, dim).
    """
    vector = ElementVector(element.skfem_element())
    basis = FacetBasis(mesh, vector, mapping=_mapping(mesh), facets=facets, intorder=order)

    def form(v: DiscreteField, w: FormExtraParams) -> Floats:
        dim, *shape = w.x.shape
        normals = np.asarray(w.n).reshape(dim, -1).T
        value = traction(w.x.reshape(dim, -1).T, normals)
        work: Floats = dot(value.T.reshape(dim, *shape), v)
        return work

    found: Floats = LinearForm(form).assemble(basis)
    return found


def _at(field: Field, x: Floats) -> Floats:
    dim, *shape = x.shape
    values: Floats = field(x.reshape(dim, -1).T)
    return values.T.reshape(-1, *shape)
