"""From a scanner's label map to a plan and back, against the same plan of the exact ellipse."""

import json
from pathlib import Path

import numpy as np
import pytest

from needlefem import load_case, load_result, plan
from needlefem.cli.main import main
from needlefem.geometry import Contour
from needlefem.scene import build_mesh, vary
from tests.image import maps

HALF_A_VOXEL = 0.5 * maps.SPACING.min()
TARGET = maps.CENTRE + np.array([2.0, 1.0, -3.0])
NEEDLE = np.array([0.3, 0.2, 1.0]) / np.linalg.norm([0.3, 0.2, 1.0])
ENTRY = TARGET - 38.0 * NEEDLE
ACROSS = np.array([1.0, 0.0, -0.3]) / np.linalg.norm([1.0, 0.0, -0.3])  # at a right angle
FILLED = {
    "materials.background.youngs_modulus": "20 kPa",
    "materials.background.poissons_ratio": "0.45",
    "materials.Prostate.poissons_ratio": "0.45",
    "supports.held.faces": '["y_min", "y_max", "z_max"]',
    "needle.cutting_force": "90 N/m",
    "needle.shaft_friction": "5 kPa",
    "needle.tip_radius": "2.54 mm",
    "mesh.refine.corridor_size": "1.27 mm",
    "mesh.refine.corridor_width": "8 mm",
    "discretization.path_spacing": "2 mm",
    "discretization.element": "P1",
}
SET = [word for key, value in FILLED.items() for word in ("--set", f"{key}={value}")]


def text(point: np.ndarray) -> str:
    return ", ".join(f"{x:.12f}" for x in point)


@pytest.fixture
def case(tmp_path: Path) -> Path:
    """Return the case that `needlefem new` makes of the prostate alone."""
    maps.write(tmp_path / "map.seg.nrrd")
    folder = tmp_path / "case"
    arguments = ["--labelmap", str(tmp_path / "map.seg.nrrd"), "--segments", "Prostate"]
    line = ["--target", f"{text(TARGET)} mm", "--entry", f"{text(ENTRY)} mm"]
    assert main(["new", str(folder), *arguments, *line, "--across", text(ACROSS)]) == 0
    return folder / "case.toml"


def test_from_the_scanner_to_a_plan_and_back(case: Path, tmp_path: Path) -> None:
    assert abs(ACROSS @ NEEDLE) < 1e-12
    arguments = ["plan", str(case), "--out", str(tmp_path / "out"), "--no-pictures", *SET]
    assert main(arguments) == 0
    found = load_result(tmp_path / "out")
    assert found.kind == "plan"
    scanner = found["scanner"]
    assert 1e3 * np.array(scanner["target"]) == pytest.approx(TARGET, abs=1e-6)
    assert scanner["direction"] == pytest.approx(NEEDLE, abs=1e-9)
    assert found.frame is not None
    assert found.frame.to_scanner(found.points("placed_at")) == pytest.approx(scanner["placed_at"])

    scene = load_case(case, SET[1::2])
    corner = TARGET - 1e3 * scene.target[0] * ACROSS - 38.0 * NEEDLE
    axes = np.array([ACROSS, NEEDLE])
    nodes = _edge_of_region(scene)
    away = maps.PROSTATE.distance(corner + 1e3 * nodes @ axes)
    assert np.abs(away).max() <= HALF_A_VOXEL

    exact = 1e-3 * maps.PROSTATE.section(corner, axes, 240)
    best = plan(vary(scene, {"regions.Prostate.contour": Contour(exact)})).best
    assert best is not None
    expected = corner + 1e3 * best.release_point @ axes
    error = np.linalg.norm(1e3 * np.array(scanner["release_point"]) - expected)
    assert error <= HALF_A_VOXEL
    needed = np.linalg.norm(expected - TARGET)
    assert needed > 5.0  # the tissue does give way: the plan is no trifle


def _edge_of_region(scene: object) -> np.ndarray:
    """Return corners and middles of the edges between the region and the rest, m."""
    mesh = build_mesh(scene)
    members = np.isin(np.arange(mesh.nelements), mesh.subdomains["Prostate"])
    inner = mesh.f2t[:, mesh.f2t[1] >= 0]
    edges = mesh.facets[:, mesh.f2t[1] >= 0][:, members[inner[0]] != members[inner[1]]]
    corners = mesh.p[:, edges]
    return np.hstack([corners[:, 0], corners.mean(axis=1)]).T


def test_a_run_says_where_its_seed_is(case: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert main(["run", str(case), "--json", *SET, "--set", "motion.max_depth=1 cm"]) == 0
    record = json.loads(capsys.readouterr().out)
    seed = record["scanner"]["seeds"][0]
    assert 1e3 * np.array(seed["released_at"]) == pytest.approx(ENTRY + 10.0 * NEEDLE, abs=1e-6)
    assert record["frame"]["voxels"]["spacing"] == pytest.approx(1e-3 * maps.SPACING)
