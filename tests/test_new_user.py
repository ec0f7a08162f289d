"""As a new user would: own outlines, an oblique label map; plan, draw, carry out as printed."""

import difflib
import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from needlefem import load_case, load_result, simulate
from needlefem.cli.main import main
from needlefem.scene import Scene, contour_sizes, vary
from tests.conftest import CASES
from tests.image import maps
from tests.pages import DOCS, site

pages = site("pages")
TUTORIAL = DOCS / "tutorial" / "own-anatomy.md"
SAID = re.compile(
    r"entry at    \(([-\d., ]+)\) cm.*\n"
    r"  release at  \(([-\d., ]+)\) cm, depth ([\d.]+) cm -> \(([-\d., ]+)\) cm"
)
ROUNDING = 1e-5
"""What three decimals of a centimetre leave open, m."""


def numbers(text: str) -> np.ndarray:
    """Return a printed point, m."""
    return 1e-2 * np.array([float(part) for part in text.split(",")])


def refined(scene: Scene) -> Scene:
    """Return the scene on elements of half the size along the needle and at contours."""
    size = 0.5 * scene.mesh.refine.corridor_size
    return vary(scene, contour_sizes(scene, 0.5) | {"mesh.refine.corridor_size": size})


def carried_out(scene: Scene, printed: str) -> tuple[float, float]:
    """Push the needle of a plan as printed; return where its tip is from the target, and the depth.

    The tip's material point at the printed depth is where a seed that is let go there rests.
    """
    found = SAID.search(printed)
    assert found is not None, printed
    entry, release, depth = numbers(found[1]), numbers(found[2]), 1e-2 * float(found[3])
    assert np.linalg.norm(release - entry) == pytest.approx(depth, abs=2 * ROUNDING)
    pushed = vary(
        scene, {"motion.entry": tuple(entry.tolist()), "motion.max_depth": depth,
                "motion.stages": (),
                "mesh.refine.corridor_depth": scene.motion.max_depth}
    )  # fmt: skip
    insertion = simulate(pushed)
    assert insertion.states[-1].depth == pytest.approx(depth, abs=1e-9)
    error = float(np.linalg.norm(insertion.states[-1].tip - np.array(scene.target)))
    return error, depth


def within_limits(scene: Scene, folder: Path, depth: float) -> None:
    """The plan uses at most four fifths of the heights and depths that the case allows."""
    record = load_result(folder).record
    assert record["status"] == "planned"
    heights = np.abs(record["search"]["heights"])
    assert heights[-1] < 0.8 * max(scene.planning.offset_range)
    assert depth < 0.95 * scene.motion.max_depth


def test_outlines_from_the_tutorial(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for name, text in pages.files(TUTORIAL).items():
        Path(name).write_text(text, encoding="utf-8")
    command = next(
        line for step in pages.steps(TUTORIAL) for line in step.commands if " new " in line
    )
    assert main(shlex.split(command)[1:]) == 0
    written = Path("begun/case.toml").read_text(encoding="utf-8").splitlines()
    shown = Path("mine.toml").read_text(encoding="utf-8").splitlines()
    assert shown[0] == "# mine.toml"
    same = difflib.SequenceMatcher(None, written, shown[1:], autojunk=False)
    for kind, start, end, low, high in same.get_opcodes():
        if kind != "equal":  # nothing but what was open is filled in
            assert end - start == high - low
            assert all('"?"' in line or line.startswith("poissons") for line in written[start:end])

    assert main(["render", "mine.toml", "--setup", "--out", "setup.png"]) == 0
    capsys.readouterr()
    assert main(["plan", "mine.toml", "--out", "out", "--no-pictures"]) == 0
    printed = capsys.readouterr().out
    scene = load_case("mine.toml")
    error, depth = carried_out(refined(scene), printed)
    within_limits(scene, Path("out"), depth)
    stated = load_result("out").record["headline"]["placement_error"]
    assert error <= stated + 2 * ROUNDING
    assert depth - 0.034 > 100 * (stated + ROUNDING)  # aiming at the target itself would miss


FILLED = {
    "materials.background.youngs_modulus": "20 kPa",
    "materials.background.poissons_ratio": "0.45",
    "materials.Prostate.poissons_ratio": "0.45",
    "supports.held.faces": '["y_min", "y_max", "z_max"]',
    "needle.cutting_force": "90 N/m",
    "needle.shaft_friction": "5 kPa",
}
SET = [word for key, value in FILLED.items() for word in ("--set", f"{key}={value}")]


def test_an_oblique_label_map(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    maps.write(tmp_path / "map.seg.nrrd")
    case, out = tmp_path / "mine" / "case.toml", tmp_path / "out"
    line = ["--target", "12, -31, 76 mm", "--direction", "0.3, 0.2, 1", "--segments", "Prostate"]
    arguments = ["new", str(case.parent), "--labelmap", str(tmp_path / "map.seg.nrrd"), *line]
    assert main(arguments) == 0
    capsys.readouterr()
    assert main(["plan", str(case), "--out", str(out), "--no-pictures", *SET]) == 0
    printed = capsys.readouterr().out
    scene = load_case(case, SET[1::2])
    error, depth = carried_out(refined(scene), printed)
    within_limits(scene, out, depth)
    record = load_result(out).record
    assert error <= record["headline"]["placement_error"] + 2 * ROUNDING
    entry, release = (np.array(record["scanner"][key]) for key in ("entry", "release_point"))
    assert np.linalg.norm(release - entry) == pytest.approx(record["release_depth"], abs=1e-12)
    assert record["release_depth"] == pytest.approx(record["release_point"][1], abs=1e-12)
    picture = str(tmp_path / "strain.png")
    coarse = ["--set", "discretization.element=P1", "--set", "discretization.path_spacing=4 mm"]
    assert main(["render", str(case), *SET, *coarse, "--field", "strain", "--out", picture]) == 0


@pytest.mark.parametrize("name", ["prostate", "liver", "breast"])
def test_cases_arrive_at_the_printed_depth(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The tip that is pushed from the printed entry to the printed depth is at the target."""
    case = CASES / name / "case.toml"
    coarse = ["--set", "planning.estimate=false", "--set", "discretization.element=P1"]
    coarse += ["--set", "mesh.interfaces=by_centroid", "--set", "discretization.path_spacing=3 mm"]
    assert main(["plan", str(case), "--out", str(tmp_path), "--no-pictures", *coarse]) in (0, 1)
    printed = capsys.readouterr().out
    direction = tuple(load_result(tmp_path).record["direction"])
    scene = vary(load_case(case, coarse[1::2]), {"motion.direction": direction})
    error, _ = carried_out(scene, printed)
    assert error < 5 * ROUNDING
