"""Stress where an element may be read.

``lambda div u`` of a displacement element is wrong by 100 % and more near incompressibility, and
that of a B-bar element is not its stress at all. So displacement elements are read up to their
limit only, B-bar elements by their mean dilatation, mixed ones by their own pressure.
"""

import numpy as np

from needlefem._arrays import Floats, Points
from needlefem.elements import BBAR, MIXED
from needlefem.errors import CaseError
from needlefem.fem import forms
from needlefem.fem.function_space import FunctionSpace
from needlefem.fem.stiffness import Stiffness
from needlefem.materials.voigt import volumetric


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
        Of mixed elements; see `Stiffness.pressure`.
    reference : array, shape (n, dim)

    Raises
    ------
    CaseError
        The element's stress is wrong for so nearly incompressible a law.
    """
    element = space.element
    if stiffness.poissons_ratio > element.stress_limit:
        remedy = "use a mixed element"
        problem = (
            f"the stress of {element.name} is wrong at Poisson's ratio "
            f"{stiffness.poissons_ratio:.6g} (it may be read up to {element.stress_limit:g})"
        )
        raise CaseError("discretisation.element", problem, remedy)
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
