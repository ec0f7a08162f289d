"""Linear elasticity: a law is its compliance."""

import abc
from typing import Any

import numpy as np

from needlefem.arrays import Floats
from needlefem.errors import CaseError
from needlefem.materials import voigt
from needlefem.materials.protocol import Response
from needlefem.materials.split import split_compliance


class LinearElastic(abc.ABC):
    """A linear law at small strain; a subclass gives its compliance and its density."""

    density: float

    @abc.abstractmethod
    def compliance(self) -> Floats:
        """Return S, shape (6, 6), 1/Pa: Voigt strain (engineering shear) of a Voigt stress."""

    def respond(
        self,
        gradient: Floats,
        state: Any = None,  # noqa: ARG002  (there are no internal variables)
        step: float = 0.0,  # noqa: ARG002
    ) -> Response:
        """See `needlefem.materials.protocol.Material`.

        Raises
        ------
        CaseError
            The law is incompressible: its pressure is no function of the strain.
        """
        parts = split_compliance(self.compliance())
        if parts.compressibility == 0.0:
            remedy = "ask for its split, or lower Poisson's ratio"
            raise CaseError("material", "incompressible: strain does not give its stress", remedy)
        strain = voigt.strain(gradient)
        stress = strain @ parts.stiffness
        return Response(
            stress=voigt.tensor(stress),
            tangent=np.broadcast_to(
                voigt.tangent_tensor(parts.stiffness), (*gradient.shape[:-2], 3, 3, 3, 3)
            ),
            energy=0.5 * np.sum(stress * strain, axis=-1),
        )


def local_axes(first: Floats, second: Floats | None = None) -> Floats:
    """Return orthonormal material axes as rows, shape (3, 3), from one or two directions.

    Directions of a plane problem have two components. Without a second direction (a law that is
    the same all around the first) any is taken.
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
    """Return a compliance given in local axes (rows) in the axes of the space."""
    turn = voigt.rotation(axes)
    found: Floats = turn.T @ compliance @ turn
    return found
