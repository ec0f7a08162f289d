"""Laws that would be solved as others are refused where a needle is simulated."""

import dataclasses
from typing import Any

import numpy as np
import pytest

from needlefem.dynamics import NAMES
from needlefem.elements import CATALOGUE
from needlefem.errors import CaseError
from needlefem.insertion import Simulation
from needlefem.materials import (
    LAWS,
    Isotropic,
    MaterialResponse,
    example,
    law_class,
    refuse_nonlinear,
    volumetric_split,
)
from needlefem.scene import Discretization, Scene, vary, with_element

RUNNING = ("quasi_static", "newmark", "hht", "generalized_alpha")


@dataclasses.dataclass(frozen=True, kw_only=True)
class NeoHooke:
    """``W = mu / 2 (F:F - 3 - 2 ln J) + lambda / 2 (ln J)^2`` (R. S. Rivlin 1948)."""

    mu: float = 10e3
    lam: float = 40e3
    density: float = 1000.0

    def evaluate(
        self, gradient: np.ndarray, state: Any = None, step: float = 0.0
    ) -> MaterialResponse:
        one = np.eye(3)
        f = one + gradient
        inverse, log = np.linalg.inv(f), np.log(np.linalg.det(f))
        turned = np.swapaxes(inverse, -1, -2)
        factor = (self.lam * log - self.mu)[..., None, None]
        tangent = self.mu * np.einsum("ik,jl->ijkl", one, one)
        tangent = tangent + self.lam * np.einsum("...ij,...kl->...ijkl", turned, turned)
        swapped = np.einsum("...li,...jk->...ijkl", inverse, inverse)
        tangent = tangent - factor[..., None, None] * swapped
        energy = 0.5 * self.mu * (np.sum(f**2, axis=(-2, -1)) - 3.0 - 2.0 * log)
        energy = energy + 0.5 * self.lam * log**2
        return MaterialResponse(self.mu * f + factor * turned, tangent, energy)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Declared(NeoHooke):
    """The same, with the compliance of its linearisation."""

    def compliance(self) -> np.ndarray:
        ratio = 0.5 * self.lam / (self.lam + self.mu)
        modulus = 2.0 * self.mu * (1.0 + ratio)
        return Isotropic(youngs_modulus=modulus, poissons_ratio=ratio).compliance()


@dataclasses.dataclass(frozen=True, kw_only=True)
class TwoLaws(Isotropic):
    """Its stress is that of a softer law than its compliance."""

    def evaluate(
        self, gradient: np.ndarray, state: Any = None, step: float = 0.0
    ) -> MaterialResponse:
        soft = Isotropic(youngs_modulus=0.5 * self.youngs_modulus, poissons_ratio=0.3)
        return soft.evaluate(gradient, state, step)


@pytest.mark.parametrize(
    ("law", "says"),
    [
        (NeoHooke(), "NeoHooke is not linear"),
        (Declared(), "Declared is not linear"),
        (TwoLaws(youngs_modulus=1e4, poissons_ratio=0.3), "are not the same law"),
    ],
)
def test_what_is_not_linear_is_refused(gel: Scene, law: Any, says: str) -> None:
    with pytest.raises(CaseError, match=f"materials.gel: .*{says}"):
        Simulation(vary(gel, {"materials.gel": law}))


def test_the_linearisation_of_that_law_is_what_is_said() -> None:
    """The law of the test is right: its tangent at rest is that of Lame's constants."""
    law = NeoHooke()
    ratio = 0.5 * law.lam / (law.lam + law.mu)
    alike = Isotropic(youngs_modulus=2.0 * law.mu * (1.0 + ratio), poissons_ratio=ratio)
    assert volumetric_split(law).shape == pytest.approx(
        volumetric_split(alike).shape, rel=1e-9, abs=1e-6
    )


@pytest.mark.parametrize("name", LAWS)
def test_every_registered_law_is_linear(name: str) -> None:
    refuse_nonlinear(example(name, {}), "material")


def test_an_incompressible_law_is_linear() -> None:
    refuse_nonlinear(Isotropic(youngs_modulus=1.0, poissons_ratio=0.5), "material")


@pytest.mark.parametrize("name", [*NAMES, *(name.replace("-", "_") for name in NAMES)])
def test_every_integrator_is_accepted_or_refused_in_a_sentence(gel: Scene, name: str) -> None:
    if name.replace("-", "_") == "central_difference":
        with pytest.raises(CaseError, match="integrates tissue without a needle only; one of auto"):
            Discretization(integrator=name)
        return
    chosen = vary(gel, {"discretization.integrator": name}).discretization.integrator
    assert chosen in RUNNING
    assert Simulation(vary(gel, {"discretization.integrator": name})).reasons["integrator"]


@pytest.mark.parametrize("name", [*CATALOGUE, *(name.replace("-", "_") for name in CATALOGUE)])
def test_every_element_is_accepted(gel: Scene, name: str) -> None:
    coarse = vary(gel, {"mesh.divisions": (8, 8), "needle.tip_radius": 5e-3})
    simulation = Simulation(with_element(coarse, name))
    assert simulation.model.element.name == name.replace("_", "-")


@pytest.mark.parametrize("name", [*LAWS, *(name.replace("-", "_") for name in LAWS)])
def test_every_law_is_accepted(gel: Scene, name: str) -> None:
    assert law_class(name, "law") is law_class(name.replace("_", "-"), "law")
    coarse = {"mesh.divisions": (8, 8), "needle.tip_radius": 5e-3}
    Simulation(vary(gel, coarse | {"materials.gel": example(name, {})}))
