"""Strain, change of volume, stress and pressure in cells, recovered from a displacement.

Near incompressibility, ``lambda div u`` of a displacement element has an error of 100 % and more,
and for a B-bar element it is not the stress that the stiffness uses. Therefore the stress of a
displacement element is available up to the element's limit of Poisson's ratio only. B-bar elements
use their mean dilatation, mixed elements their pressure field.
"""

import numpy as np

from needlefem._arrays import Floats, Points
from needlefem.elements import BBAR, MIXED
from needlefem.errors import CaseError
from needlefem.fem import forms
from needlefem.fem.function_space import FunctionSpace
from needlefem.fem.stiffness import Stiffness
from needlefem.fem.tissue_model import TissueModel
from needlefem.materials import volumetric_split
from needlefem.materials.voigt import IN_PLANE, volumetric


def middle(model: TissueModel) -> Floats:
    """Return the centre of the reference cell, shape (1, dim)."""
    corners = model.mesh.elem().refdom.p
    centre: Floats = np.asarray(corners, dtype=float).mean(axis=1)[None]
    return centre


class CellFields:
    """Fields at the centres of a model's cells.

    Parameters
    ----------
    model : TissueModel
    """

    def __init__(self, model: TissueModel) -> None:
        self.model, self.place = model, middle(model)
        self._basis = forms.displacement_basis(
            model.mesh, model.element, lambda: (np.ascontiguousarray(self.place.T), np.ones(1))
        )

    def gradient(self, u: Floats) -> Floats:
        """Return the displacement gradient, shape (ncells, dim, dim)."""
        found = np.asarray(self._basis.interpolate(u).grad)[..., 0]
        return np.moveaxis(found, 2, 0)

    def largest_strain(self, u: Floats) -> Floats:
        """Return the principal strain with the largest absolute value, shape (ncells,)."""
        gradient = self.gradient(u)
        principal = np.linalg.eigvalsh(0.5 * (gradient + np.swapaxes(gradient, 1, 2)))
        largest: Floats = np.abs(principal).max(axis=1)
        return largest

    def volume_ratio(self, u: Floats) -> Floats:
        """Return ``det(I + grad u)``, shape (ncells,); negative in an inverted cell."""
        ratio: Floats = np.linalg.det(np.eye(self.model.dim) + self.gradient(u))
        return ratio

    @property
    def has_stress(self) -> bool:
        """Whether `stress` is available for the element at this Poisson's ratio."""
        stiffness, element = self.model.stiffness, self.model.element
        known = element.volume != MIXED or float(stiffness.compressibility.min()) > 0.0
        return known and stiffness.poissons_ratio <= element.stress_limit

    def stress(self, u: Floats) -> Floats:
        """Return Voigt stresses in 3D, shape (ncells, 6), Pa, also for plane problems.

        Raises
        ------
        CaseError
            The stress of the element is not accurate at this Poisson's ratio.
        SimulationError
            The tissue is incompressible: its pressure does not follow from the displacement.
        """
        model, pressure = self.model, np.zeros(0)
        if model.element.volume == MIXED:
            pressure = model.stiffness.pressure(u)
        found = stresses(model, model.stiffness, u, pressure, self.place)[:, 0]
        return found if model.dim == 3 else self._in_space(found, u)

    def _in_space(self, plane: Floats, u: Floats) -> Floats:
        """Return 3D stresses from plane ones: the out-of-plane stress exists in plane strain only.

        ``stress = shape strain + p m`` gives p from the in-plane components, and p gives the
        out-of-plane component.
        """
        full = np.zeros((len(plane), 6))
        full[:, IN_PLANE] = plane
        if self.model.plane == "stress":
            return full
        gradient = self.gradient(u)
        shear = gradient[:, 0, 1] + gradient[:, 1, 0]
        strain = np.stack([gradient[:, 0, 0], gradient[:, 1, 1], shear], axis=1)
        laws = [
            volumetric_split(law).shape[:3][:, IN_PLANE] for law in self.model.materials.values()
        ]
        shape = np.einsum("cij,cj->ci", np.array(laws)[self.model.cell_materials], strain)
        full[:, 2] = shape[:, 2] + np.mean(plane[:, :2] - shape[:, :2], axis=1)
        return full

    def von_mises(self, u: Floats) -> Floats:
        """Return the von Mises stress, shape (ncells,), Pa; see `stress` for errors."""
        s = self.stress(u)
        normal = (s[:, 0] - s[:, 1]) ** 2 + (s[:, 1] - s[:, 2]) ** 2 + (s[:, 2] - s[:, 0]) ** 2
        found: Floats = np.sqrt(0.5 * normal + 3.0 * np.sum(s[:, 3:] ** 2, axis=1))
        return found

    def pressure(self, u: Floats) -> Floats:
        """Return the pressure, minus the mean stress, shape (ncells,), Pa.

        Raises
        ------
        CaseError
            The element has no pressure field.
        """
        if self.model.element.volume != MIXED:
            remedy = "use a mixed element: P2-P1, Q2-Q1 or MINI"
            problem = f"{self.model.element.name} has no pressure field"
            raise CaseError("discretization.element", problem, remedy)
        found: Floats = -self.stress(u)[:, :3].mean(axis=1)
        return found


def stresses(
    space: FunctionSpace, stiffness: Stiffness, u: Floats, pressure: Floats, reference: Points
) -> Floats:
    """Return Voigt stresses at reference points of every cell, shape (ncells, n, 3 or 6), Pa.

    Parameters
    ----------
    space : FunctionSpace
    stiffness : Stiffness
    u : array, shape (ndofs,), m
    pressure : array, shape (npressures,), Pa
        Pressure of mixed elements; see `Stiffness.pressure`.
    reference : array, shape (n, dim)
        Points of the reference cell.

    Raises
    ------
    CaseError
        The stress of the element is not accurate at this Poisson's ratio.
    """
    element = space.element
    if stiffness.poissons_ratio > element.stress_limit:
        remedy = "use a mixed element"
        problem = (
            f"the stress of {element.name} is not accurate at Poisson's ratio "
            f"{stiffness.poissons_ratio:.6g} (it is available up to {element.stress_limit:g})"
        )
        raise CaseError("discretization.element", problem, remedy)
    gradient = _gradient(space, u, reference)
    strain = np.stack(forms.strain(gradient), axis=0)
    found: Floats = np.einsum("ijc,jcq->cqi", stiffness.law, strain)
    if element.volume == BBAR and element.volume_rule is not None:
        middle = _gradient(space, u, element.volume_rule()[0].T)
        dilatation = np.trace(middle)  # (ncells, 1)
        found += (dilatation / stiffness.compressibility[:, None])[:, :, None] * _m(space)
    if element.volume == MIXED:
        found += stiffness.pressures.at(pressure, reference)[:, :, None] * _m(space)
    return found


def _m(space: FunctionSpace) -> Floats:
    m: Floats = volumetric(space.dim)
    return m


def _gradient(space: FunctionSpace, u: Floats, reference: Points) -> Floats:
    """Return the displacement's gradient, shape (dim, dim, ncells, n)."""
    weights = np.full(len(reference), 1.0 / len(reference))
    basis = forms.displacement_basis(
        space.mesh, space.element, lambda: (np.ascontiguousarray(reference.T), weights)
    )
    found: Floats = np.asarray(basis.interpolate(u).grad)
    return found
