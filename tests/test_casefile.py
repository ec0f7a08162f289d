import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from needlefem import load_case
from needlefem.casefile import read_contour, read_scene
from needlefem.errors import CaseError
from needlefem.scene import Scene, vary
from tests.conftest import CASES, PAPER_CASE


def test_the_paper_case_is_read(paper_scene: Scene) -> None:
    assert paper_scene.axes == ("y", "z")
    assert paper_scene.mesh.divisions == (25, 25)
    assert paper_scene.target == (0.015, 0.03)
    assert paper_scene.motion.direction == (0.0, 1.0)
    assert len(paper_scene.regions["prostate"].contour.points) == 96
    assert {e.kind for e in paper_scene.expect} == {"calibrated", "predicted", "required"}


def test_overrides_are_parsed_and_recorded() -> None:
    scene = load_case(
        PAPER_CASE, ["needle.tip_radius=1 mm", "discretization.tip_quadrature_points=96"]
    )
    assert scene.needle.tip_radius == pytest.approx(1e-3)
    assert scene.discretization.tip_quadrature_points == 96
    assert scene.overrides == {
        "needle.tip_radius": "1 mm",
        "discretization.tip_quadrature_points": 96,
    }


@pytest.mark.parametrize(
    ("override", "says"),
    [
        ('needle.tip_radiu="1 mm"', "needle.tip_radiu: unknown key; did you mean 'tip_radius'?"),
        ("needle.tip_radius=1", "needle.tip_radius: 1 has no unit"),
        ('needle.tip_radius="1 kPa"', "is a pressure; a length is needed"),
        ('needle.cutting_force="9 N"', "is a force; a force per length is needed"),
        ('materials.fat.youngs_modulus="-3 kPa"', "-3000 is out of range; it must be above 0"),
        ("materials.fat.poissons_ratio=0.51", "0.51 is out of range"),
        ("materials.fat.poissons_ratio=true", "True is not a number"),
        ('materials.fat.law="isotropc"', "did you mean 'isotropic'?"),
        ('tissue.default_material="fatt"', "did you mean 'fat'?"),
        ('regions.prostate.contour="other.csv"', "can't read"),
        ("motion.direction=[0, 0]", "not all zero"),
        ('mesh.size=["7 cm"]', "mesh.size: 1 edge lengths, 2 divisions"),
        ("mesh.size=[1, 1]", "mesh.size: 1 has no unit"),
        ('target.point=["1 cm"]', "write 2 lengths"),
        ('needle.tip="round"', "one of disc, point"),
        ('planning.offset_range=["1 mm", "-1 mm"]', "swap the ends"),
        ("schema_version=3", "write 2"),
        ('axes=["y", "y"]', "two different axes"),
        ('supports.walls.faces="z_max"', "is not a list"),
        ('targets.region="gland"', "no region 'gland'"),
        ("needle=3", "is not a table"),
    ],
)
def test_bad_values_get_one_clear_line(override: str, says: str) -> None:
    with pytest.raises(CaseError) as caught:
        load_case(PAPER_CASE, [override])
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


def _case() -> dict[str, Any]:
    return tomllib.loads(PAPER_CASE.read_text())


@pytest.mark.parametrize(
    ("table", "key"),
    [
        ("needle", "cutting_force"),
        ("mesh", "size"),
        ("motion", "max_depth"),
        ("", "needle"),
        ("", "tissue"),
    ],
)
def test_missing_keys_are_named(table: str, key: str) -> None:
    data = _case()
    del (data[table] if table else data)[key]
    with pytest.raises(CaseError, match=f"{key}: missing; add it"):
        read_scene(data, PAPER_CASE.parent)


def test_unknown_section_is_named() -> None:
    with pytest.raises(CaseError, match="neddle: unknown key; did you mean 'needle'"):
        read_scene(_case() | {"neddle": {}}, PAPER_CASE.parent)


def test_no_such_file_and_no_toml(tmp_path: Path) -> None:
    with pytest.raises(CaseError, match="there is no such file"):
        load_case(tmp_path / "case.toml")
    (tmp_path / "case.toml").write_text("a = = b")
    with pytest.raises(CaseError, match="not valid TOML"):
        load_case(tmp_path / "case.toml")


def test_override_without_equals() -> None:
    with pytest.raises(CaseError, match="write key=value"):
        load_case(PAPER_CASE, ["needle.tip_radius"])


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "is empty"),
        ("y, z\n1, 2\n", "no unit of length in the header"),
        ("y [cm], z [cm]\n1, 2\n2, x\n", "line 3"),
        ("y [cm], z [cm]\n1, 2\n2\n", "line 3"),
        ("y [cm], z [cm]\n0, 0\n1, 1\n1, 0\n0, 1\n", "crosses itself"),
    ],
)
def test_bad_contours(tmp_path: Path, text: str, says: str) -> None:
    file = tmp_path / "contour.csv"
    file.write_text(text)
    with pytest.raises(CaseError) as caught:
        read_contour(file, "regions.organ.contour")
    assert says in str(caught.value)


def test_contour_units(tmp_path: Path) -> None:
    file = tmp_path / "contour.csv"
    file.write_text("y [mm], z [cm]\n0, 0\n10, 0\n10, 1\n")
    expected = np.array([[0.0, 0.0], [0.01, 0.0], [0.01, 0.01]])
    assert read_contour(file, "key").points == pytest.approx(expected)


def test_vary_replaces_through_mappings_and_tables(paper_scene: Scene) -> None:
    varied = vary(paper_scene, {"materials.fat.youngs_modulus": 1.0, "needle.tip_radius": 2.0})
    assert varied.materials["fat"].youngs_modulus == 1.0
    assert varied.needle.tip_radius == 2.0
    assert varied.materials["prostate"] == paper_scene.materials["prostate"]


def test_damping_is_read() -> None:
    frequencies = 'damping.frequencies=["2 1/s", "10 1/s"]'
    scene = load_case(PAPER_CASE, [frequencies, "damping.ratios=[0.05, 0.1]"])
    assert scene.damping.frequencies == (2.0, 10.0)
    assert scene.damping.ratios == (0.05, 0.1)
    with pytest.raises(CaseError, match="damping.mass_rate: -1 is out of range"):
        load_case(PAPER_CASE, ['damping.mass_rate="-1 1/s"'])


LIVER = CASES / "liver" / "case.toml"


def test_obstacles_are_regions_or_contours() -> None:
    scene = load_case(LIVER)
    rib = scene.obstacles["rib-6"]
    assert rib.clearance == pytest.approx(3e-3)
    assert rib.contour is scene.regions["rib-6"].contour
    assert scene.supports["ribs"].regions == ("rib-5", "rib-6")
    own = 'obstacles={plate={contour="tumour.csv", offset=["1 cm", "0 cm"], clearance="0 mm"}}'
    (plate,) = load_case(LIVER, [own]).obstacles.values()
    moved = scene.regions["tumour"].contour.points + np.array([0.01, 0.0])
    assert plate.contour.points == pytest.approx(moved)


@pytest.mark.parametrize(
    ("override", "says"),
    [
        ("obstacles.rib-6.clearance=-1 mm", "out of range"),
        ("obstacles.rib-6.region=rib-7", "no region 'rib-7'; did you mean 'rib-6'?"),
        ("obstacles.rib-6.clearence=1 mm", "unknown key; did you mean 'clearance'?"),
        ('obstacles={rib={clearance="1 mm"}}', "obstacles.rib.contour: missing"),
        ('obstacles={rib={region="rib-6"}}', "obstacles.rib.clearance: missing"),
        ('supports.ribs.regions=["rib-7"]', "no region 'rib-7'"),
        ("supports.ribs={}", "supports.ribs.faces: missing; name faces or regions"),
        ("planning.directions=[[0, 0]]", "give a number for each axis, not all zero"),
        ("planning.directions=[[1, 0, 0]]", "3 numbers; give 2, one for each axis"),
    ],
)
def test_bad_obstacles_get_one_clear_line(override: str, says: str) -> None:
    with pytest.raises(CaseError) as caught:
        load_case(LIVER, [override])
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)
