"""Check that a constitutive law is linear, from its response.

The simulation of a needle uses a constant stiffness that is made from the compliance of the law or
from its tangent at zero strain. Without this check, a law with a nonlinear stress, or with internal
variables that are not Maxwell branches, would be replaced by its linearisation without a message.
"""

import math

import numpy as np

from needlefem._arrays import Floats
from needlefem.errors import CaseError
from needlefem.materials import voigt
from needlefem.materials.base import Material
from needlefem.materials.linear_elastic import HasBranches, LinearElastic
from needlefem.materials.volumetric_split import HasCompliance

AMPLITUDES = (1e-3, 0.03, 0.3)
"""Displacement gradients of the check: small, as in whole organs, and large, as at the tip."""
SAME = 1e-6
"""Relative difference of stresses that is attributed to round-off."""


def refuse_nonlinear(material: Material, key: str) -> None:
    """Raise a `CaseError` for a law that is not linear.

    Parameters
    ----------
    material : Material
    key : str
        Name of the material in messages, such as ``materials.liver``.

    Raises
    ------
    CaseError
        The stress is not proportional to the displacement gradient, the compliance does not agree
        with the stress, or the law has internal variables but no branches.
    """
    if isinstance(material, LinearElastic) and type(material).evaluate is LinearElastic.evaluate:
        return  # the stress is computed from the compliance
    name = type(material).__name__
    try:
        rest = material.evaluate(np.zeros((3, 3)), None, math.inf)
    except CaseError:
        if isinstance(material, HasCompliance):
            return  # incompressible: the stress does not follow from the strain
        raise
    tangent = np.asarray(rest.tangent, dtype=float)
    scale = float(np.abs(tangent).max())
    for gradient in _trials():
        stress = np.asarray(material.evaluate(gradient, None, math.inf).stress, dtype=float)
        linear = np.tensordot(tangent, gradient, axes=2)
        if not np.abs(stress - linear).max() <= SAME * scale * np.abs(gradient).max():
            problem = f"{name} is not linear; a needle can be simulated with linear laws only"
            raise CaseError(key, problem, "give a linear law (verify --material checks any law)")
    if rest.state is not None and not isinstance(material, HasBranches):
        problem = f"{name} has internal variables, but no branches(), which relaxation needs"
        raise CaseError(key, problem, "derive it from LinearElastic and define its branches")
    if isinstance(material, HasCompliance):
        _compare(material.compliance(), tangent, name, key)


def _trials() -> Floats:
    """Return displacement gradients, shape (n, 3, 3): stretch, volume, shear, and their sum."""
    stretch, shear = np.zeros((2, 3, 3))
    stretch[0, 0] = shear[0, 1] = 1.0
    mixed = np.array([[0.4, -0.7, 0.2], [0.9, -0.6, 0.5], [-0.3, 0.8, 1.0]])
    shapes = np.array([stretch, np.eye(3), shear, mixed])
    found: Floats = np.concatenate([sign * a * shapes for a in AMPLITUDES for sign in (1.0, -1.0)])
    return found


def _compare(compliance: Floats, tangent: Floats, name: str, key: str) -> None:
    """Raise an error for a compliance that is not the inverse of the tangent."""
    product = compliance @ voigt.tangent_matrix(tangent)
    if not np.abs(product - np.eye(len(product))).max() <= SAME:
        problem = f"{name}.compliance() and {name}.evaluate() are not the same law"
        raise CaseError(key, problem, "derive respond() from the compliance, or omit it")
