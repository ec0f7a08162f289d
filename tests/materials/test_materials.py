from collections.abc import Callable

import numpy as np
import pytest

from needlefem.checks import check_law
from needlefem.errors import CaseError
from needlefem.materials import (
    Isotropic,
    LinearElastic,
    Orthotropic,
    TransverselyIsotropic,
    example,
    law_class,
    plane_volumetric_split,
    tangent_matrix,
    tangent_tensor,
    volumetric_split,
)

FIBRE = {
    "modulus_along": 9e3,
    "modulus_across": 2e3,
    "shear_along": 1e3,
    "ratio_along": 0.4,
    "ratio_across": 0.3,
}


def orthotropic(**changes: float) -> Orthotropic:
    values = {"modulus_1": 9e3, "modulus_2": 2e3, "modulus_3": 3e3}
    values |= {"ratio_12": 0.3, "ratio_13": 0.2, "ratio_23": 0.4}
    values |= {"shear_12": 1e3, "shear_13": 1.5e3, "shear_23": 0.7e3}
    return Orthotropic(**(values | changes))


def textbook(modulus: float, nu: float) -> np.ndarray:
    """Return Lame's stiffness in space."""
    mu, lam = 0.5 * modulus / (1 + nu), modulus * nu / ((1 + nu) * (1 - 2 * nu))
    matrix = np.diag([2 * mu] * 3 + [mu] * 3)
    matrix[:3, :3] += lam
    return matrix


@pytest.mark.parametrize("nu", [-0.5, 0.0, 0.3, 0.45, 0.49, 0.4999, 0.499999])
def test_isotropic_is_the_textbooks(nu: float) -> None:
    law = Isotropic(youngs_modulus=3e4, poissons_ratio=nu)
    expected = textbook(3e4, nu)
    near = 1e-9 * np.abs(expected).max()  # 1 - 2 nu itself has lost six digits at the last ratio
    assert volumetric_split(law).stiffness == pytest.approx(expected, abs=near)
    rows = [0, 1, 5]
    flat = plane_volumetric_split(law, "strain").stiffness
    assert flat == pytest.approx(expected[np.ix_(rows, rows)], abs=near)
    thin = 3e4 / (1 - nu**2) * np.array([[1, nu, 0], [nu, 1, 0], [0, 0, 0.5 * (1 - nu)]])
    assert plane_volumetric_split(law, "stress").stiffness == pytest.approx(thin, rel=1e-12)
    assert volumetric_split(law).poissons_ratio == pytest.approx(nu, abs=1e-12)
    assert volumetric_split(law).shear == pytest.approx(law.lame()[1])


@pytest.mark.parametrize("nu", [0.3, 0.499999, 0.5])
def test_shape_part_of_isotropic_tissue_is_twice_the_shear_modulus(nu: float) -> None:
    law = Isotropic(youngs_modulus=3.0, poissons_ratio=nu)
    parts = volumetric_split(law)
    mu = 1.5 / (1 + nu)
    assert parts.shape == pytest.approx(np.diag([2 * mu] * 3 + [mu] * 3), abs=1e-12)
    assert parts.kappa == (np.inf if nu == 0.5 else pytest.approx(law.lame()[0], rel=1e-9))


def test_incompressible_stress_is_refused() -> None:
    with pytest.raises(
        CaseError, match="the stress does not follow from the strain|incompressible"
    ):
        Isotropic(youngs_modulus=1.0, poissons_ratio=0.5).evaluate(np.zeros((3, 3)))


@pytest.mark.parametrize(
    "law",
    [
        Isotropic(youngs_modulus=1e4, poissons_ratio=0.45),
        TransverselyIsotropic(**FIBRE, fibre=(1.0, 2.0)),
        TransverselyIsotropic(**FIBRE, fibre=(0.0, 0.0, 1.0)),
        orthotropic(),
        Orthotropic(**{**vars(orthotropic()), "axis_1": (1.0, 1.0), "axis_2": (-1.0, 1.0)}),
    ],
)
def test_every_law_passes_its_checks(law: LinearElastic) -> None:
    assert [c.name for c in check_law(law) if not c.passed] == []
    parts = volumetric_split(law)
    assert parts.stiffness @ law.compliance() == pytest.approx(np.eye(6), abs=1e-10)
    assert np.linalg.eigvalsh(parts.shape)[0] > 0.0


def test_a_fibre_stiffens_along_itself() -> None:
    along = TransverselyIsotropic(**FIBRE, fibre=(1.0, 0.0)).compliance()
    across = TransverselyIsotropic(**FIBRE, fibre=(0.0, 1.0)).compliance()
    assert 1.0 / along[0, 0] == pytest.approx(9e3)
    assert 1.0 / along[1, 1] == pytest.approx(2e3)
    swap = [1, 0, 2, 4, 3, 5]
    assert across == pytest.approx(along[np.ix_(swap, swap)], abs=1e-18)


def test_anisotropic_laws_contain_the_isotropic_one() -> None:
    modulus, nu = 5e3, 0.3
    shear = 0.5 * modulus / (1 + nu)
    iso = Isotropic(youngs_modulus=modulus, poissons_ratio=nu).compliance()
    fibre = TransverselyIsotropic(
        modulus_along=modulus, modulus_across=modulus, shear_along=shear, ratio_along=nu,
        ratio_across=nu, fibre=(1.0, 0.7),
    )  # fmt: skip
    layers = orthotropic(
        **{f"modulus_{i}": modulus for i in (1, 2, 3)},
        **{f"ratio_{i}": nu for i in (12, 13, 23)},
        **{f"shear_{i}": shear for i in (12, 13, 23)},
    )
    assert fibre.compliance() == pytest.approx(iso, abs=1e-18)
    assert layers.compliance() == pytest.approx(iso, abs=1e-18)


@pytest.mark.parametrize(
    "make",
    [
        lambda: orthotropic(ratio_23=0.95),  # more than sqrt(E2 / E3) allows
        lambda: TransverselyIsotropic(**{**FIBRE, "ratio_across": 0.99}),
    ],
)
def test_unstable_constants_are_refused(make: Callable[[], LinearElastic]) -> None:
    with pytest.raises(CaseError, match="the strain energy is negative for some strain"):
        make()


def test_directions_must_be_directions() -> None:
    with pytest.raises(CaseError, match="a direction is zero"):
        TransverselyIsotropic(**FIBRE, fibre=(0.0, 0.0))
    with pytest.raises(CaseError, match="its two directions are parallel"):
        Orthotropic(**{**vars(orthotropic()), "axis_2": (2.0, 0.0)})


def test_voigt_and_tensor_are_one() -> None:
    stiffness = volumetric_split(orthotropic()).stiffness
    assert tangent_matrix(tangent_tensor(stiffness)) == pytest.approx(stiffness)


def test_examples_have_constants_that_can_be_set() -> None:
    assert example("isotropic", {"youngs_modulus": "3 kPa"}).youngs_modulus == pytest.approx(3e3)
    assert example("transversely-isotropic", {"fibre": "[0, 1]"}).fibre == (0.0, 1.0)


def test_unknown_law_is_answered_with_the_nearest() -> None:
    with pytest.raises(CaseError, match="did you mean 'orthotropic'"):
        law_class("orthotropc", "materials.x.law")
