"""Linear elastic laws, isotropic or with preferred directions, and viscoelastic branches.

Each law is defined by its compliance, so that incompressible tissue is included.
"""

import abc
import dataclasses
from collections.abc import Sequence
from typing import Protocol, runtime_checkable

import numpy as np

from needlefem._arrays import Floats
from needlefem.errors import CaseError
from needlefem.materials import voigt
from needlefem.materials.base import MaterialResponse
from needlefem.materials.volumetric_split import split_compliance
from needlefem.validation import Validated, parameter

# Relaxation of viscoelastic laws: Maxwell branches parallel to an elastic spring.
#
# A branch is a spring and a dashpot in series. Its internal variable is the strain of the spring,
# ``q' + q / T = strain'``. If the strain changes linearly over a step, ``q1 = decay q0 +
# gain (strain1 - strain0)`` is exact for steps of any length (R. L. Taylor, K. S. Pister,
# G. L. Goudreau 1970), and the stiffness of the step depends on its duration alone.


ROUND_OFF = 1e-9
"""Volumetric stress of a branch, relative to its stiffness, that counts as zero."""


@dataclasses.dataclass(frozen=True, eq=False)
class Branch:
    """A spring and a dashpot in series.

    Parameters
    ----------
    time : float, s
        Relaxation time: viscosity over stiffness.
    stiffness : array, shape (6, 6) (a law's) or (3, 3) (in the plane), Pa
        Stiffness of the spring in Voigt notation.
    """

    time: float
    stiffness: Floats


@runtime_checkable
class HasBranches(Protocol):
    """A linear viscoelastic law."""

    def branches(self) -> tuple[Branch, ...]:
        """Return the branches parallel to the spring of the law's compliance."""
        ...


def relaxation_factor(step: float, time: float) -> float:
    """Return the fraction of a branch's strain that remains after a step."""
    return float(np.exp(-step / time))


def load_factor(step: float, time: float) -> float:
    """Return the fraction of a linear strain change that the spring has at the end of a step.

    It is 1 for a sudden change and 0 for an infinite duration.
    """
    share = step / time
    if share == 0.0:
        return 1.0
    return 0.0 if np.isinf(share) else float(-np.expm1(-share) / share)


def branches_of(material: object, dim: int, plane: str) -> tuple[Branch, ...]:
    """Return the branches of a law in space or in the plane; none for an elastic law.

    Raises
    ------
    CaseError
        Plane stress, or a branch whose volumetric stiffness relaxes.
    """
    found = material.branches() if isinstance(material, HasBranches) else ()
    for branch in found:
        if not branch.time > 0.0:
            raise CaseError("material", f"a relaxation time of {branch.time:g} s", "above 0")
        pressed = branch.stiffness @ voigt.volumetric(3)
        if np.abs(pressed).max() > ROUND_OFF * np.abs(branch.stiffness).max():
            remedy = "only the resistance to a change of shape may relax"
            raise CaseError("material", "its resistance to a change of volume relaxes", remedy)
    if dim == 3 or not found:
        return tuple(found)
    if plane == "stress":
        remedy = "use plane strain"
        raise CaseError("plane", "viscoelastic tissue is not possible in plane stress", remedy)
    rows = np.array(voigt.IN_PLANE)
    return tuple(Branch(b.time, b.stiffness[np.ix_(rows, rows)]) for b in found)


# Linear elastic laws: each is defined by its compliance.


class LinearElastic(Validated, abc.ABC):
    """A linear law at small strain; a subclass defines its compliance and its density.

    A viscoelastic law defines its branches as well; the compliance is then that of relaxed tissue.
    """

    TABLE = "material"
    density: float

    @abc.abstractmethod
    def compliance(self) -> Floats:
        """Return S, shape (6, 6), 1/Pa: Voigt strain (engineering shear) per Voigt stress."""

    def branches(self) -> tuple[Branch, ...]:
        """Return the Maxwell branches parallel to the spring of the compliance; none if elastic."""
        return ()

    def evaluate(
        self, gradient: Floats, state: object = None, step: float = 0.0
    ) -> MaterialResponse:
        """See `needlefem.materials.base.Material`.

        Raises
        ------
        CaseError
            The law is incompressible: its stress does not follow from the strain.
        """
        parts = split_compliance(self.compliance())
        if parts.compressibility == 0.0:
            remedy = "use its volumetric split, or lower Poisson's ratio"
            raise CaseError(
                "material", "incompressible: the stress does not follow from the strain", remedy
            )
        strain = voigt.strain(gradient)
        before = MaxwellState.virgin(strain, len(self.branches())) if state is None else state
        if not isinstance(before, MaxwellState):
            raise TypeError(f"{type(before).__name__} is no state of a linear law")
        after = before.advanced(strain, step, self.branches())
        stiffness, stress = parts.stiffness, strain @ parts.stiffness
        energy = 0.5 * np.sum(stress * strain, axis=-1)
        for branch, part in zip(self.branches(), after.parts, strict=True):
            stiffness = stiffness + load_factor(step, branch.time) * branch.stiffness
            pull = part @ branch.stiffness
            stress, energy = stress + pull, energy + 0.5 * np.sum(pull * part, axis=-1)
        return MaterialResponse(
            stress=voigt.tensor(stress),
            tangent=np.broadcast_to(
                voigt.tangent_tensor(stiffness), (*gradient.shape[:-2], 3, 3, 3, 3)
            ),
            energy=energy,
            state=after if self.branches() else None,
        )


@dataclasses.dataclass(frozen=True, eq=False)
class MaxwellState:
    """State of a viscoelastic law: the strain, and the spring strain of each branch (..., 6)."""

    strain: Floats
    parts: tuple[Floats, ...]

    @classmethod
    def virgin(cls, like: Floats, branches: int) -> "MaxwellState":
        """Return the state of tissue that was never deformed."""
        return cls(np.zeros_like(like), (np.zeros_like(like),) * branches)

    def advanced(self, strain: Floats, step: float, branches: Sequence[Branch]) -> "MaxwellState":
        """Return the state after a step that ends at a given strain."""
        change = strain - self.strain
        parts = [
            relaxation_factor(step, branch.time) * part + load_factor(step, branch.time) * change
            for branch, part in zip(branches, self.parts, strict=True)
        ]
        return MaxwellState(strain, tuple(parts))


def local_axes(first: Floats, second: Floats | None = None) -> Floats:
    """Return orthonormal material axes as rows, shape (3, 3), from one or two directions.

    Directions of a plane problem have two components. Without a second direction (for a law that
    is isotropic across the first) an arbitrary one is used.
    """
    one = _unit(first)
    guess = np.eye(3)[int(np.argmin(np.abs(one)))] if second is None else _padded(second)
    rest = guess - (guess @ one) * one
    if np.linalg.norm(rest) < 1e-6 * max(float(np.linalg.norm(guess)), 1e-300):
        raise CaseError("material", "its two directions are parallel", "give different ones")
    two = rest / np.linalg.norm(rest)
    return np.array([one, two, np.cross(one, two)])


def _padded(direction: Floats) -> Floats:
    vector = np.zeros(3)
    vector[: len(direction)] = direction
    return vector


def _unit(direction: Floats) -> Floats:
    vector = _padded(np.asarray(direction, dtype=float))
    length = float(np.linalg.norm(vector))
    if not length > 0.0:
        raise CaseError("material", "a direction is zero", "give a direction such as [1, 0]")
    return vector / length


def turned(compliance: Floats, axes: Floats) -> Floats:
    """Return a compliance in the global axes, given in local axes (rows of `axes`)."""
    turn = voigt.rotation(axes)
    found: Floats = turn.T @ compliance @ turn
    return found


# Isotropic linear elasticity.


@dataclasses.dataclass(frozen=True, kw_only=True)
class Isotropic(LinearElastic):
    """Isotropic linear elasticity at small strain (R. Hooke 1678, G. Lame 1852)."""

    youngs_modulus: float = parameter("Stiffness in simple tension", "pressure", low=0.0)
    poissons_ratio: float = parameter(
        "Lateral contraction; 0.5 is incompressible and needs a mixed element",
        low=-0.999,
        high=0.5,
        closed=True,
    )
    density: float = parameter("Mass per volume", "density", default=1000.0, low=0.0, closed=True)

    def compliance(self) -> Floats:
        """See `LinearElastic`."""
        nu = self.poissons_ratio
        matrix = np.diag([1.0 + nu] * 3 + [2.0 * (1.0 + nu)] * 3)
        matrix[:3, :3] -= nu
        scaled: Floats = matrix / self.youngs_modulus
        return scaled

    def lame(self) -> tuple[float, float]:
        """Return the Lame parameters (lambda, mu), Pa; lambda is infinite at nu = 0.5."""
        modulus, nu = self.youngs_modulus, self.poissons_ratio
        shear = modulus / (2.0 * (1.0 + nu))
        return (2.0 * shear * nu / (1.0 - 2.0 * nu) if nu < 0.5 else np.inf), shear


# Linear elasticity with preferred directions: fibres and layers.


def _orthotropic(moduli: Floats, ratios: Floats, shears: Floats) -> Floats:
    """Return the compliance from (E1, E2, E3), (nu12, nu13, nu23) and (G23, G13, G12).

    ``nu_ij`` is the contraction along j under tension along i (S. G. Lekhnitskii 1963).
    """
    found = np.diag(np.concatenate([1.0 / moduli, 1.0 / shears]))
    for (i, j), ratio in zip(((0, 1), (0, 2), (1, 2)), ratios, strict=True):
        found[i, j] = found[j, i] = -ratio / moduli[i]
    return found


@dataclasses.dataclass(frozen=True, kw_only=True)
class TransverselyIsotropic(LinearElastic):
    """Transversely isotropic law with one fibre direction: muscle, tendon, layered phantoms."""

    modulus_along: float = parameter("Young's modulus along the fibre", "pressure", low=0.0)
    modulus_across: float = parameter("Young's modulus across the fibre", "pressure", low=0.0)
    shear_along: float = parameter(
        "Shear modulus in planes that contain the fibre", "pressure", low=0.0
    )
    ratio_along: float = parameter(
        "Contraction across when pulled along the fibre; 0.5 is incompressible", low=-2.0, high=2.0
    )
    ratio_across: float = parameter(
        "Contraction across when pulled across the fibre; incompressible at 1 - modulus_across / "
        "(2 modulus_along)",
        low=-1.0,
        high=1.0,
    )
    fibre: tuple[float, ...] = parameter("Direction of the fibre", default=(1.0, 0.0))
    density: float = parameter("Mass per volume", "density", default=1000.0, low=0.0, closed=True)

    def check(self) -> None:
        """See `needlefem.validation.Validated`; a law with negative strain energy is an error."""
        split_compliance(self.compliance())

    def compliance(self) -> Floats:
        """See `LinearElastic`."""
        across = self.modulus_across / (2.0 * (1.0 + self.ratio_across))
        local = _orthotropic(
            np.array([self.modulus_along, self.modulus_across, self.modulus_across]),
            np.array([self.ratio_along, self.ratio_along, self.ratio_across]),
            np.array([across, self.shear_along, self.shear_along]),
        )
        return turned(local, local_axes(np.array(self.fibre)))


@dataclasses.dataclass(frozen=True, kw_only=True)
class Orthotropic(LinearElastic):
    """Orthotropic law: three perpendicular directions with different stiffness."""

    modulus_1: float = parameter("Young's modulus along axis 1", "pressure", low=0.0)
    modulus_2: float = parameter("Young's modulus along axis 2", "pressure", low=0.0)
    modulus_3: float = parameter("Young's modulus along axis 3", "pressure", low=0.0)
    ratio_12: float = parameter("Contraction along 2 when pulled along 1", low=-2.0, high=2.0)
    ratio_13: float = parameter("Contraction along 3 when pulled along 1", low=-2.0, high=2.0)
    ratio_23: float = parameter("Contraction along 3 when pulled along 2", low=-2.0, high=2.0)
    shear_23: float = parameter("Shear modulus in the plane 23", "pressure", low=0.0)
    shear_13: float = parameter("Shear modulus in the plane 13", "pressure", low=0.0)
    shear_12: float = parameter("Shear modulus in the plane 12", "pressure", low=0.0)
    axis_1: tuple[float, ...] = parameter("Direction of axis 1", default=(1.0, 0.0))
    axis_2: tuple[float, ...] = parameter(
        "Direction of axis 2, made normal to 1", default=(0.0, 1.0)
    )
    density: float = parameter("Mass per volume", "density", default=1000.0, low=0.0, closed=True)

    def check(self) -> None:
        """See `needlefem.validation.Validated`; a law with negative strain energy is an error."""
        split_compliance(self.compliance())

    def compliance(self) -> Floats:
        """See `LinearElastic`."""
        local = _orthotropic(
            np.array([self.modulus_1, self.modulus_2, self.modulus_3]),
            np.array([self.ratio_12, self.ratio_13, self.ratio_23]),
            np.array([self.shear_23, self.shear_13, self.shear_12]),
        )
        return turned(local, local_axes(np.array(self.axis_1), np.array(self.axis_2)))
