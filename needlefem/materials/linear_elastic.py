"""Linear elastic laws: each is defined by its compliance."""

import abc
import dataclasses
from collections.abc import Sequence

import numpy as np

from needlefem._arrays import Floats
from needlefem.errors import CaseError
from needlefem.materials import voigt
from needlefem.materials.base import MaterialResponse
from needlefem.materials.relaxation import Branch, load_factor, relaxation_factor
from needlefem.materials.volumetric_split import split_compliance
from needlefem.validation import Validated, parameter


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
