"""Every case gives what it expects."""

import json
import runpy

import pytest

from needlefem import load_case, simulate
from needlefem.cli.main import main
from tests.conftest import CASES

ALL = sorted(CASES.glob("*/case.toml"))


@pytest.mark.parametrize("case", ALL, ids=lambda path: path.parent.name)
def test_expectations_hold(case, capsys: pytest.CaptureFixture[str]) -> None:
    expects = load_case(case).expect
    rows = 0
    for command in sorted({item.key.split(".")[0] for item in expects} & {"plan", "run"}):
        assert main([command, str(case), "--json"]) == 0
        expected = json.loads(capsys.readouterr().out)["expect"]
        assert expected["passed"]
        rows += len(expected["rows"])
    assert rows >= 4


def test_twelve_targets_of_the_paper(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["study", "targets", str(CASES / "prostate-2003" / "case.toml")]) == 0
    assert "0 without a solution" in capsys.readouterr().out


@pytest.mark.parametrize("case", ALL, ids=lambda path: path.parent.name)
def test_a_case_has_a_readme_with_its_picture(case) -> None:
    assert "pictures/" in (case.parent / "README.md").read_text()


@pytest.mark.parametrize("script", sorted(CASES.glob("*/contours.py")), ids=lambda p: p.parent.name)
def test_contours_are_what_their_script_writes(script) -> None:
    files = runpy.run_path(str(script))["FILES"]
    assert files
    for name, text in files.items():
        assert (script.parent / name).read_text() == text


def test_in_a_uniform_gel_the_force_grows_with_the_length_cut() -> None:
    scene = load_case(CASES / "gel" / "case.toml")
    insertion = simulate(scene)
    needle, (across, along) = scene.needle, insertion.tips.T
    assert across == pytest.approx(0.03, abs=1e-12)
    for state, length in zip(insertion.states[1:], along[1:], strict=True):
        assert state.tip_force == pytest.approx(needle.cutting_force, abs=1e-9)
        assert state.friction_force.sum() == pytest.approx(needle.shaft_friction * length, abs=1e-9)
