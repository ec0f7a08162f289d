"""Every case gives what it expects."""

import json

import pytest

from needlefem.casefile.load import load_case
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
