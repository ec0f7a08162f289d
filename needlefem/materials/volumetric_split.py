"""Split of a stiffness into the resistance to a change of shape and to a change of volume.

``stress = shape strain + p m``, ``p = kappa m.strain``, where ``m.strain`` is the dilatation. The
split is computed from the compliance: it loses no digits when ``kappa`` becomes large, and exists
for incompressible tissue as well. Elements with selective integration or a pressure field treat
the two parts differently.
"""

import dataclasses
from functools import lru_cache
from typing import Protocol, runtime_checkable

import numpy as np

from needlefem._arrays import Floats
from needlefem.errors import CaseError
from needlefem.materials import voigt
from needlefem.materials.base import Material

ROUND_OFF = 1e-12
"""Compressibility, relative to the compliance, that counts as zero."""


@runtime_checkable
class HasCompliance(Protocol):
    """A linear law with a compliance, which stays accurate near incompressibility."""

    def compliance(self) -> Floats:
        """Return S, shape (6, 6), 1/Pa."""
        ...


@dataclasses.dataclass(frozen=True, eq=False)
class VolumetricSplit:
    """A linear or linearised law in Voigt notation, in 3D (6 components) or in the plane (3).

    Parameters
    ----------
    shape : array, shape (n, n), Pa
        Stiffness without the volumetric part.
    compressibility : float, 1/Pa
        Reciprocal of `kappa`; zero for incompressible tissue.
    shear : float, Pa
        The smallest shear modulus.
    bulk_compressibility : float, 1/Pa
        Relative decrease of volume under a pressure of 1 Pa.
    """

    shape: Floats
    compressibility: float
    shear: float
    bulk_compressibility: float

    @property
    def kappa(self) -> float:
        """Stiffness for a change of volume, Pa; infinite for incompressible tissue."""
        return 1.0 / self.compressibility if self.compressibility > 0.0 else np.inf

    @property
    def stiffness(self) -> Floats:
        """The full stiffness, shape (n, n), Pa (compressible tissue only)."""
        m = voigt.volumetric(3 if len(self.shape) == 6 else 2)
        return self.shape + self.kappa * np.outer(m, m)

    @property
    def poissons_ratio(self) -> float:
        """Poisson's ratio of an isotropic law with the same kappa and shear modulus."""
        share = self.bulk_compressibility * self.shear
        return (3.0 - 2.0 * share) / (2.0 * (3.0 + share))


def volumetric_split(material: Material) -> VolumetricSplit:
    """Return the split of a law at small strain in 3D.

    Raises
    ------
    CaseError
        The law is not stable: the energy of some strain is zero or negative.
    """
    return split_compliance(_compliance(material))


def plane_volumetric_split(material: Material, plane: str) -> VolumetricSplit:
    """Return the split of a law in the plane of the first two axes: 'strain' or 'stress'."""
    rows = np.array(voigt.IN_PLANE)
    if plane == "strain":
        solid = volumetric_split(material)
        return dataclasses.replace(solid, shape=solid.shape[np.ix_(rows, rows)])
    return split_compliance(_compliance(material)[np.ix_(rows, rows)])


def _compliance(material: Material) -> Floats:
    """Return the compliance of a linear law, or the inverse of a law's tangent at zero strain."""
    if isinstance(material, HasCompliance):
        return material.compliance()
    tangent = voigt.tangent_matrix(material.evaluate(np.zeros((3, 3))).tangent)
    return np.asarray(np.linalg.inv(tangent), dtype=float)


def split_compliance(compliance: Floats) -> VolumetricSplit:
    """Return the split of a symmetric compliance, shape (6, 6) or (3, 3), 1/Pa; see `_split`."""
    return _split(np.ascontiguousarray(compliance, dtype=float).tobytes(), len(compliance))


@lru_cache(maxsize=64)  # checks use the same few laws many times
def _split(numbers: bytes, size: int) -> VolumetricSplit:
    """Return the split of a compliance, given as the numbers of a matrix with `size` rows.

    With ``s = S m`` and the compressibility ``c = m.S m``, ``D = inv(S)`` is ``D0 + m m' / c``,
    where D0 s = 0. D0 is computed in the space of stresses without mean, which avoids cancellation.
    D0 alone has no resistance to some change of volume. Therefore ``2 G / 3`` (``G`` in the plane)
    of ``1 / c`` is left in the shape part. The shape part of an isotropic law is then
    ``2 G strain``, and kappa is Lame's lambda.
    """
    compliance = np.frombuffer(numbers).reshape(size, size)
    normals = 3 if len(compliance) == 6 else 2
    m = voigt.volumetric(normals)
    along = compliance @ m
    total = float(m @ along)
    limit = ROUND_OFF * float(np.abs(compliance).max())
    incompressible = abs(total) <= limit
    share = m / normals if incompressible else along / total
    basis = np.linalg.svd(m[None])[2][1:].T  # columns: an orthonormal basis of the complement of m
    mean_free = basis.T @ compliance @ basis
    if not incompressible:
        across = basis.T @ along
        mean_free = mean_free - np.outer(across, across) / total
    weight = np.where(np.arange(len(m)) < normals, 1.0, np.sqrt(0.5))
    eigenvalues = np.linalg.eigvalsh(_mandel(mean_free, basis, weight))
    if total < -limit or eigenvalues[0] <= limit:
        raise CaseError(
            "material",
            "the strain energy is negative for some strain",
            "moduli must be positive, and nu_ij^2 < E_i / E_j",
        )
    project = np.eye(len(m)) - np.outer(m, share)
    shape = project @ basis @ np.linalg.solve(mean_free, basis.T) @ project.T
    shear, bulk = float(0.5 / eigenvalues[-1]), 0.0 if incompressible else total
    kept = 2.0 * shear / normals if incompressible else min(2.0 * shear / normals, 0.5 / total)
    shape = 0.5 * (shape + shape.T) + kept * np.outer(m, m)
    shape.flags.writeable = False  # the cached result is shared
    return VolumetricSplit(shape, bulk / (1.0 - bulk * kept), shear, bulk)


def _mandel(matrix: Floats, basis: Floats, weight: Floats) -> Floats:
    """Return a matrix in the basis `basis`, in a notation in which all shears have equal weight."""
    turned = basis.T @ (weight[:, None] * basis)
    found: Floats = turned @ matrix @ turned
    return 0.5 * (found + found.T)
