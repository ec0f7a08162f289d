from pathlib import Path

import pytest

from needlefem.bench.insertion import PARTS
from needlefem.errors import CaseError
from tests.conftest import ROOT
from verification.benchmarks import against

CASE = "cases/prostate-2003/case.toml"


def test_tasks_of_a_checkout_are_timed_in_a_process_of_its_own() -> None:
    with against._worker("insertion", CASE, against.HERE) as (tasks, timed):
        assert tasks == ["back-substitution", "insertion", "one beside the last"]
        assert 0.0 < timed(tasks[0], 1) < timed(tasks[1], 1)


def test_a_ratio_beyond_the_bound_does_not_pass() -> None:
    table = against._table("plan", ["a"], lambda *_: 1.1, lambda *_: 1.0)
    assert not table.passed
    assert table.summary["worst"] == pytest.approx(1.1)
    assert against._table("plan", ["a"], lambda *_: 1.0, lambda *_: 1.0).passed


def test_what_cannot_be_compared_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CaseError, match="contains no checkout"):
        against.run("plan", CASE, tmp_path)
    with pytest.raises(CaseError, match="not made for comparing"):
        against.run("render", CASE, against.HERE)


@pytest.mark.parametrize("part", PARTS)
def test_the_parts_of_an_insertion_are_functions_of_the_package(part: str) -> None:
    """One that was renamed would be charged to what calls it."""
    file, function = PARTS[part]
    assert f"    def {function}(" in (ROOT / "needlefem" / file).read_text(encoding="utf-8")
