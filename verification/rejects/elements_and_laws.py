"""Elements and laws with deliberate mistakes; a named check detects each of them."""

import dataclasses
from typing import Any

import numpy as np

from needlefem.checks import Problem, ProblemResult, Quantity, check_element_material, failures
from needlefem.elements import BBAR, CATALOGUE, MIXED, ElementType, gauss, simplex
from needlefem.materials import Isotropic, MaterialResponse

P1, P2, Q1 = CATALOGUE["P1"], CATALOGUE["P2"], CATALOGUE["Q1"]
RIGHT = Isotropic(youngs_modulus=1e4, poissons_ratio=0.3)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Law:
    """Isotropic elasticity; subclasses have one mistake each."""

    right: Isotropic = RIGHT
    density: float = 1000.0

    def evaluate(
        self, gradient: np.ndarray, state: Any = None, step: float = 0.0
    ) -> MaterialResponse:
        """Return the correct response."""
        return self.right.evaluate(gradient, state, step)


class PushesBack(Law):
    """Wrong sign of the stress."""

    def evaluate(
        self, gradient: np.ndarray, state: Any = None, step: float = 0.0
    ) -> MaterialResponse:
        """Return the stress with the other sign."""
        right = super().evaluate(gradient)
        return dataclasses.replace(right, stress=-right.stress, tangent=-right.tangent)


class TwiceTheEnergy(Law):
    """Wrong factor: the energy is twice as large."""

    def evaluate(
        self, gradient: np.ndarray, state: Any = None, step: float = 0.0
    ) -> MaterialResponse:
        """Return twice the energy."""
        right = super().evaluate(gradient)
        return dataclasses.replace(right, energy=2.0 * right.energy)


class ForgetsVolume(Law):
    """Missing term: the tangent has no lambda."""

    def evaluate(
        self, gradient: np.ndarray, state: Any = None, step: float = 0.0
    ) -> MaterialResponse:
        """Return a tangent with the shear part only."""
        right = super().evaluate(gradient)
        eye = np.eye(3)
        lame = self.right.lame()[0] * np.einsum("ij,kl->ijkl", eye, eye)
        return dataclasses.replace(right, tangent=right.tangent - lame)


class SwapsShears(Law):
    """Exchanged shear components 13 and 23."""

    def evaluate(
        self, gradient: np.ndarray, state: Any = None, step: float = 0.0
    ) -> MaterialResponse:
        """Return the stress with two shears exchanged."""
        right = super().evaluate(gradient)
        stress = np.array(right.stress)
        stress[..., 0, 2], stress[..., 1, 2] = right.stress[..., 1, 2], right.stress[..., 0, 2]
        stress[..., 2, 0], stress[..., 2, 1] = stress[..., 0, 2], stress[..., 1, 2]
        return dataclasses.replace(right, stress=stress)


class FollowsRotation(Law):
    """Missing symmetric part: the gradient is used instead of the strain."""

    def evaluate(
        self, gradient: np.ndarray, state: Any = None, step: float = 0.0
    ) -> MaterialResponse:
        """Return ``2 mu gradient``, its tangent and its energy."""
        mu = self.right.lame()[1]
        tangent = 2.0 * mu * np.einsum("ik,jl->ijkl", np.eye(3), np.eye(3))
        energy = mu * np.sum(gradient**2, axis=(-2, -1))
        return MaterialResponse(stress=2.0 * mu * gradient, tangent=tangent, energy=energy)


class PumpsEnergy(Law):
    """Non-symmetric tangent: a coupling of normal strains in one direction only."""

    def evaluate(
        self, gradient: np.ndarray, state: Any = None, step: float = 0.0
    ) -> MaterialResponse:
        """Return a stress that has no energy function, with its own tangent."""
        right = super().evaluate(gradient)
        stress, tangent = np.array(right.stress), np.array(right.tangent)
        stress[..., 0, 0] += 2e3 * gradient[..., 1, 1]
        tangent[..., 0, 0, 1, 1] += 2e3
        return dataclasses.replace(right, stress=stress, tangent=tangent)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Unchecked(Isotropic):
    """A law that does not check its values."""

    def __post_init__(self) -> None:
        pass


@dataclasses.dataclass(frozen=True, kw_only=True)
class HalfShear(Isotropic):
    """Tensor shear strain instead of Voigt's: the shear compliance is halved."""

    def compliance(self) -> np.ndarray:
        """Return a compliance with half its shears."""
        return super().compliance() * np.array([1.0, 1.0, 1.0, 0.5, 0.5, 0.5])


def spoiled(element: ElementType, **methods: Any) -> Any:
    """Return a factory of scikit-fem's element with replaced methods."""
    return type("Spoiled", (type(element.skfem_element()),), methods)


def _mixed_up(self: Any, X: np.ndarray, i: int) -> Any:  # noqa: N803
    right = type(self).__mro__[1]
    return right.lbasis(self, X, {3: 4, 4: 3}.get(i, i))


def _steep(self: Any, X: np.ndarray, i: int) -> Any:  # noqa: N803
    value, slope = type(self).__mro__[1].lbasis(self, X, i)
    return value, 2.0 * slope


def _curved(self: Any, X: np.ndarray, i: int) -> Any:  # noqa: N803
    value, slope = type(self).__mro__[1].lbasis(self, X, i)
    return value + 0.1 * X[0] * X[1] * (i == 0), slope + 0.1 * np.stack([X[1], X[0]]) * (i == 0)


def elements() -> dict[str, tuple[ElementType, str]]:
    """Return faulty elements, and the check that must detect each."""
    vary = dataclasses.replace
    mixed_up = vary(P2, name="X", skfem_element=spoiled(P2, lbasis=_mixed_up))
    return {
        "one quadrature point": (vary(Q1, name="X", stiffness_rule=gauss(1)), "zero modes"),
        "dofs in the wrong order": (mixed_up, "continuity"),
        "gradients twice too steep": (
            vary(P1, name="X", skfem_element=spoiled(P1, lbasis=_steep)), "shape gradients"),
        "functions that do not add up": (
            vary(P1, name="X", skfem_element=spoiled(P1, lbasis=_curved)), "nodal functions"),
        "weights of another cell": (
            vary(P1, name="X", stiffness_rule=lambda: (np.full((2, 1), 1 / 3), np.ones(1))),
            "quadrature weights"),
        "zero and negative masses": (vary(P2, name="X", lumpings=("row-sum",)), "mass positive"),
        "too coarse a rule for M": (vary(P2, name="X", mass_rule=simplex(2)), "mass rule"),
        "reduced integration that reduces nothing": (
            vary(CATALOGUE["Q1-Bbar"], name="X", volume=BBAR, volume_rule=gauss(2)), "no locking"),
        "pressure as fine as the displacement": (
            vary(P1, name="X", volume=MIXED, pressure=P1.skfem_element, poissons_ratio_limit=0.4,
                 stiffness_rule=simplex(2)), "pressure stability"),
        "a limit that is not kept": (vary(P1, name="X", poissons_ratio_limit=0.4999), "no locking"),
    }  # fmt: skip


LAWS: dict[str, tuple[Any, str]] = {
    "sign of the stress": (PushesBack(), "stability"),
    "twice the energy": (TwiceTheEnergy(), "stress of energy"),
    "tangent without lambda": (ForgetsVolume(), "tangent of stress"),
    "swapped shears": (SwapsShears(), "tangent of stress"),
    "gradient taken for strain": (FollowsRotation(), "rotation"),
    "tangent not symmetric": (PumpsEnergy(), "tangent symmetric"),
    "half the shear strain": (HalfShear(youngs_modulus=1e4, poissons_ratio=0.3), "isotropy"),
    "negative mass": (
        Unchecked(youngs_modulus=1e4, poissons_ratio=0.3, density=-1.0),
        "density",
    ),
}


def run(quick: bool) -> ProblemResult:
    """Check each faulty element or law and a correct one, and compare the failed checks."""
    answers = [
        Quantity(
            label="the right ones: checks failed",
            value=len(failures(check_element_material(P2, RIGHT))),
            tolerance=0.0,
        )
    ]
    caught = {what: (check_element_material(P2, law), name) for what, (law, name) in LAWS.items()}
    caught |= {
        what: (check_element_material(e, RIGHT), name) for what, (e, name) in elements().items()
    }
    for what, (checks, name) in caught.items():
        hit = float(name in failures(checks))
        label = f"{what}: caught by '{name}'"
        answers.append(Quantity(label=label, value=hit, reference=1.0))
    return ProblemResult(quantities=answers)


PROBLEM = Problem(
    name="wrong on purpose",
    requirement="An element or law with a mistake fails the check that names this mistake.",
    reference="typical mistakes: signs, factors, orders, quadrature rules",
    tolerance_rationale="each check must be able to fail",
    run=run,
)
