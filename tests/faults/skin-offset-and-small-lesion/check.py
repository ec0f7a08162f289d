"""The printed depth is what the needle is pushed, and a small lesion costs what it needs."""

import json
import re
from collections.abc import Callable
from pathlib import Path

from needlefem import load_case
from needlefem.scene import build_mesh

FILLED = {
    "materials.background.youngs_modulus": "10 kPa",
    "materials.background.poissons_ratio": "0.45",
    "materials.kidney.youngs_modulus": "20 kPa",
    "materials.kidney.poissons_ratio": "0.45",
    "materials.lesion.youngs_modulus": "60 kPa",
    "materials.lesion.poissons_ratio": "0.45",
    "supports.held.faces": '["y_min", "y_max", "z_max"]',
    "needle.cutting_force": "90 N/m",
    "needle.shaft_friction": "5 kPa",
}
SET = [word for key, value in FILLED.items() for word in ("--set", f"{key}={value}")]
COARSE = ["--set", "discretization.element=P1", "--set", "mesh.interfaces=centroid",
          "--set", "discretization.path_spacing=2 mm"]  # fmt: skip
SAID = re.compile(r"entry at    \(([\d.]+), ([\d.]+)\) cm.*\n"
                  r"  release at  \(([\d.]+), ([\d.]+)\) cm, depth ([\d.]+) cm")  # fmt: skip


def test_the_needle_pushed_to_the_printed_depth_arrives(
    folder: Path, run: Callable[..., tuple[int, str, str]]
) -> None:
    status, out, _ = run("plan", "k/case.toml", *SET, *COARSE)
    assert status == 0
    found = SAID.search(out)
    assert found is not None
    y, skin, _, z, depth = (float(number) for number in found.groups())
    assert abs(skin - 0.9) < 1e-9
    assert abs(z - skin - depth) < 2e-3  # three decimals are printed
    assert 2.9 < depth < 4.4  # more than the target's own depth, less than max_depth
    push = ["--set", f'motion.entry=["{y} cm", "{skin} cm"]', "--set", f"motion.max_depth={depth} cm"]
    status, out, _ = run("run", "k/case.toml", "--json", *SET, *COARSE, *push)
    assert status == 0
    seed = json.loads(out)["seeds"][0]
    assert abs(seed["release_depth"] - 0.01 * depth) < 1e-9
    assert seed["placement_error"] < 2e-4  # two roundings of 5 micrometres, magnified by the tissue


def test_the_lesion_alone_has_small_elements(folder: Path, run: Callable[..., object]) -> None:
    scene = load_case(folder / "k" / "case.toml", SET[1::2])
    assert scene.regions["lesion"].contour_size < 1e-3
    assert scene.regions["kidney"].contour_size == 0.0
    mesh = build_mesh(scene)
    assert mesh.nvertices + mesh.nfacets < 6000  # of P2: 26,000 with the lesion's size everywhere
