import json

import pytest

from needlefem.checks import check_element_material, failures, inf_sup
from needlefem.cli.main import main
from needlefem.elements import CATALOGUE
from needlefem.materials import Isotropic, Orthotropic, TransverselyIsotropic

FIBROUS = TransverselyIsotropic(
    modulus_along=9e3,
    modulus_across=2e3,
    shear_along=1e3,
    ratio_along=0.4,
    ratio_across=0.3,
    fibre=(1.0, 1.0),
)
LAYERED = Orthotropic(
    modulus_1=9e3,
    modulus_2=2e3,
    modulus_3=3e3,
    ratio_12=0.3,
    ratio_13=0.3,
    ratio_23=0.3,
    shear_12=1e3,
    shear_13=1e3,
    shear_23=1e3,
)


@pytest.mark.parametrize("plane", ["strain", "stress"])
@pytest.mark.parametrize("material", [FIBROUS, LAYERED], ids=["fibrous", "layered"])
@pytest.mark.parametrize("name", CATALOGUE)
def test_every_element_carries_every_law(name: str, material: object, plane: str) -> None:
    assert failures(check_element_material(CATALOGUE[name], material, plane)) == []


@pytest.mark.parametrize("name", CATALOGUE)
def test_an_element_passes_at_its_own_limit(name: str) -> None:
    element = CATALOGUE[name]
    material = Isotropic(youngs_modulus=1e4, poissons_ratio=element.poissons_ratio_limit)
    checks = check_element_material(element, material)
    # at its limit a displacement element does not lock, but reaches its order on finer meshes only
    slow = {"order, L2", "order, H1", "frequencies"} if element.volume == "plain" else set()
    assert set(failures(checks)) <= slow


@pytest.mark.parametrize("name", [n for n, e in CATALOGUE.items() if not e.definite])
def test_mixed_elements_can_be_incompressible(name: str) -> None:
    material = Isotropic(youngs_modulus=1e4, poissons_ratio=0.5)
    assert failures(check_element_material(CATALOGUE[name], material)) == []
    assert inf_sup(CATALOGUE[name], 4) > 0.1


@pytest.mark.parametrize("name", [n for n, e in CATALOGUE.items() if e.definite])
def test_others_can_not(name: str) -> None:
    material = Isotropic(youngs_modulus=1e4, poissons_ratio=0.5)
    assert failures(check_element_material(CATALOGUE[name], material)) == ["incompressibility"]


@pytest.mark.parametrize("name", ["P1", "P2", "Q1", "Q2"])
def test_locking_is_seen(name: str) -> None:
    material = Isotropic(youngs_modulus=1e4, poissons_ratio=0.4999)
    assert "accuracy" in failures(check_element_material(CATALOGUE[name], material))


def test_command_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["verify", "--element", "Q1-Bbar", "--material", "isotropic", "--json"]) == 0
    (record,) = json.loads(capsys.readouterr().out)
    assert record["passed"]
    assert {"patch, displacement", "no locking", "zero modes"} <= {
        check["name"] for check in record["checks"]
    }
    assert main(["verify", "--element", "P1", "--set", "poissons_ratio=0.4999"]) == 1
    assert "FAILED" in capsys.readouterr().out
    assert main(["verify", "--element", "all"]) == 0
    assert capsys.readouterr().out.count("none") == len(CATALOGUE)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--element", "Q3"], "--element: no element 'Q3'; did you mean"),
        (["--material", "isotropc"], "did you mean 'isotropic'?"),
        (["--element", "P1", "--set", "youngs=3"], "--set youngs: unknown constant"),
        (["--element", "P1", "--set", "youngs_modulus=3 mm"], "is a length; a pressure is needed"),
        (["--element", "P1", "--set", "poissons_ratio=0.7"], "0.7 is out of range"),
        (["--element", "P1", "--set", "poissons_ratio"], "write constant=value"),
    ],
)
def test_mistakes_get_one_line(
    arguments: list[str], says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["verify", *arguments]) == 2
    error = capsys.readouterr().err
    assert says in error
    assert error.count("\n") == 1
