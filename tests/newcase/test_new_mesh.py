"""Tried as a new user would: Gmsh's own meshes, from ``new`` to the printed depth."""

import json
from pathlib import Path

import numpy as np
import pytest

from needlefem import build_model, load_case
from needlefem.cli.main import main
from needlefem.insertion import Simulation
from needlefem.scene import build_mesh, vary
from tests.conftest import ROOT

GMSH = ROOT / "tests" / "mesh" / "gmsh"
TARGET = (33.0, 30.0)  # mm: the organ's centre
ANSWERS = {
    "materials.fat.youngs_modulus": "20 kPa",
    "materials.fat.poissons_ratio": 0.45,
    "materials.organ.youngs_modulus": "60 kPa",
    "materials.organ.poissons_ratio": 0.45,
    "supports.held.faces": ["floor", "sides"],
    "needle.tip_radius": "4 mm",
    "needle.cutting_force": "50 N/m",
    "needle.shaft_friction": "8 kPa",
    "motion.max_depth": "5 cm",
    "discretization.path_spacing": "4 mm",
}


def answered(case: Path) -> list[str]:
    """Return options that answer what a new case leaves open."""
    text = case.read_text()
    assert 'youngs_modulus = "?"' in text
    return [part for k, v in ANSWERS.items() for part in ("--set", f"{k}={json.dumps(v)}")]


@pytest.mark.parametrize("name", ["text41", "quads", "mixed", "curved-triangles", "text22"])
@pytest.mark.filterwarnings("ignore:.*read as straight")
def test_from_a_mesh_to_the_printed_depth(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    case = tmp_path / "mine" / "case.toml"
    new = ["new", str(case), "--mesh", str(GMSH / f"{name}.msh"), "--unit", "1 mm"]
    assert main([*new, "--target", "33, 30 mm", "--direction", "0, 1"]) == 0
    assert "regions: organ" in capsys.readouterr().out
    options = answered(case)
    assert main(["plan", str(case), "--json", *options]) == 0
    plan = json.loads(capsys.readouterr().out)
    assert plan["status"] == "planned"
    entry, depth = plan["entry"], plan["release_depth"]
    assert np.linalg.norm(np.subtract(plan["release_point"], entry)) == pytest.approx(depth)
    scene = load_case(case, options[1::2])
    pushed = vary(scene, {"motion.entry": tuple(entry), "motion.max_depth": depth})
    mesh = build_mesh(pushed)
    refined = mesh.refined(1)
    assert len(refined.subdomains["organ"]) == 4 * len(mesh.subdomains["organ"])
    simulation = Simulation(pushed, build_model(pushed, refined))
    last = simulation.insert(simulation.entry_of_case()).states[-1]
    assert last.depth == pytest.approx(depth, abs=1e-12)
    away = np.linalg.norm(last.tip - 1e-3 * np.array(TARGET))
    assert 1e-7 < away <= plan["headline"]["placement_error"]
    assert plan["headline"]["contains"]["path"] > 0.0  # the pieces are as long as the tip's radius


def test_a_plan_on_a_mesh_is_carried_out_and_drawn(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    case = tmp_path / "mine" / "case.toml"
    new = ["new", str(case), "--mesh", str(GMSH / "text41.msh"), "--unit", "1 mm"]
    assert main([*new, "--target", "33, 30 mm", "--direction", "0, 1"]) == 0
    options = answered(case)
    capsys.readouterr()
    assert main(["plan", str(case), "--json", *options]) == 0
    plan = json.loads(capsys.readouterr().out)
    pushed = [
        "--set", "motion.entry=" + json.dumps([f"{1e3 * x:.9f} mm" for x in plan["entry"]]),
        "--set", f'motion.max_depth="{1e3 * plan["release_depth"]:.9f} mm"',
    ]  # fmt: skip
    assert main(["run", str(case), "--json", *options, *pushed]) == 0
    (seed,) = json.loads(capsys.readouterr().out)["seeds"][-1:]
    away = np.linalg.norm(np.subtract(seed["placed_at"], 1e-3 * np.array(TARGET)))
    # the plan reads its depth between two states, a run ends with a shorter piece
    assert away <= plan["headline"]["contains"]["path"]
    picture = tmp_path / "strain.png"
    small = ["--size", "320x180", "--field", "strain", "--out", str(picture)]
    assert main(["render", str(case), *options, *pushed, *small]) == 0
    assert picture.stat().st_size > 1000
