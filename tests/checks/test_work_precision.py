import math
import re
from pathlib import Path

import pytest

from needlefem.checks import Point, front, same_cells, seconds_to
from needlefem.scene import cheapest
from verification.benchmarks.races import table_of

PROBLEM = """
import time
from needlefem.checks.reference_problem import Problem, ProblemResult
from needlefem.checks.work_precision import WorkPrecision

def entrant(pause, error):
    def go(level):
        time.sleep(pause * 2**level)
        return error / 10**level
    return go

PROBLEM = Problem(
    name="race", requirement="", reference="", tolerance_rationale="",
    run=lambda quick: ProblemResult(quantities=[]),
    races=[WorkPrecision(
        title="a race", quantity="anything", about="elements",
        entrants={
            "fast": entrant(1e-3, 0.5), "slow": entrant(4e-3, 0.6), "rough": entrant(1e-4, 9),
        },
        levels=(0, 1, 2), measure=lambda error: (10, error), target=1e-2, group="all",
        defaults=("DEFAULT",),
    )],
)
"""


def points(*pairs: tuple[float, float]) -> list[Point]:
    return [Point("a", level, 10, *pair) for level, pair in enumerate(pairs)]


def test_time_to_an_error() -> None:
    found = points((1.0, 1e-1), (4.0, 1e-3))
    assert seconds_to(1e-2, found) == pytest.approx(2.0)
    assert seconds_to(1e-1, found) == 1.0
    assert seconds_to(0.5, found) == 1.0
    assert seconds_to(1e-4, found) == math.inf


def test_the_front_has_no_point_that_another_beats() -> None:
    a, b, c = points((1.0, 1e-1), (2.0, 1e-2), (3.0, 5e-2))
    assert front([a, b, c]) == {a, b}


@pytest.mark.parametrize(("default", "passed"), [("fast", True), ("slow", False)])
def test_a_default_that_is_beaten_is_named(default: str, passed: bool, tmp_path: Path) -> None:
    (tmp_path / "p01_race.py").write_text(PROBLEM.replace("DEFAULT", default))
    table = table_of("elements", str(tmp_path))
    assert table.passed is passed
    assert ("fast beats slow (all)" in table.note) is not passed
    assert [row[0] for row in table.rows] == ["a race", "mean, all"]
    assert table.rows[0][table.columns.index("rough")].startswith("-")
    assert "<svg" in table.charts["a race"]
    best = [p for p in table.summary["points"]["a race"] if p["front"]]
    rings = re.findall(r'<g id="ringed">(.*?)</g>\s*</g>', table.charts["a race"], re.DOTALL)
    assert sum(ring.count("<use ") for ring in rings) == len(best) > 0


def test_defaults_are_among_the_elements_on_their_cells() -> None:
    for ratio in (0.3, 0.47, 0.4999):
        for default, rivals in zip(cheapest(ratio), same_cells(), strict=True):
            assert default in rivals
