import dataclasses
import json
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from needlefem.checks import (
    Curve,
    Problem,
    ProblemResult,
    Quantity,
    Shape,
    run_problem,
    square_mesh,
)
from needlefem.elements import CATALOGUE
from needlefem.errors import NoRendererError
from needlefem.fem import BoundaryValueProblem
from needlefem.materials import Isotropic
from needlefem.plotting import verification_report


class Strict(HTMLParser):
    """Counts open tags, and what would be fetched."""

    VOID = ("meta", "img", "br")

    def __init__(self) -> None:
        super().__init__()
        self.stack: list[str] = []
        self.fetched: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in self.VOID:
            self.stack.append(tag)
        for name, value in attrs:
            if name in ("src", "href") and value and not value.startswith(("data:", "#")):
                self.fetched.append(value)

    def handle_endtag(self, tag: str) -> None:
        if tag not in self.VOID:
            assert self.stack.pop() == tag


def made_up(*, failing: bool) -> Problem:
    element = CATALOGUE["Q1"]
    problem = BoundaryValueProblem(
        square_mesh(element, 3), element, Isotropic(youngs_modulus=1.0, poissons_ratio=0.3)
    )
    solved = problem.fix(None, lambda x: 0.1 * x).solve()
    curve = Curve(
        element="Q1",
        quantity="L2",
        sizes=(0.5, 0.25, 0.125),
        dofs=(10, 40, 160),
        seconds=(1e-3, 2e-3, 9e-3),
        errors=(1e-1, 2.5e-2, 6e-3),
        order=2.0,
    )
    answers = [
        Quantity(label="a < b", value=1.0, reference=2.0 if failing else 1.0, tolerance=1e-3),
        Quantity(label="locks", value=3.0, reference=1.0, at_least=True, recorded=False),
    ]
    findings = ProblemResult(
        quantities=answers, curves=[curve], shapes=[Shape(title="moved", solution=solved)]
    )
    return Problem(
        name="made up",
        requirement="r & q",
        reference="none",
        tolerance_rationale="w",
        run=lambda _: findings,
    )


def test_page_is_whole_and_says_what_it_must(tmp_path: Path) -> None:
    report = run_problem(made_up(failing=False), {"made up: a < b": 1.0})
    path = verification_report.write_report(tmp_path, [report], quick=True)
    text = path.read_text(encoding="utf-8")
    parser = Strict()
    parser.feed(text)
    assert parser.stack == []
    assert parser.fetched == []
    for part in (
        "all within tolerance",
        "r &amp; q",
        "a &lt; b",
        "at least 1",
        "<svg",
        "data:image/png;base64",
    ):
        assert part in text
    record = json.loads((tmp_path / "verification.json").read_text())
    assert record["passed"]
    (problem,) = record["problems"]
    assert [a["reference_met"] for a in problem["answers"]] == [True, True]
    assert problem["answers"][0]["record_met"] is True
    assert problem["curves"][0]["observed"] == pytest.approx(np.log2(2.5e-2 / 6e-3))


def test_failures_come_first_and_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    def none(_: Shape) -> str:
        raise NoRendererError("nothing draws here")

    monkeypatch.setattr(verification_report, "picture", none)
    good, bad = (run_problem(made_up(failing=f), {"made up: a < b": 1.0}) for f in (False, True))
    renamed = dataclasses.replace(good, problem=dataclasses.replace(good.problem, name="fine"))
    text = verification_report.html([renamed, bad], quick=False)
    assert "1 failed" in text
    assert text.index(">made up<") < text.index(">fine<")
    assert "No picture: nothing draws here" in text
    assert not verification_report.record([good, bad], quick=False)["passed"]


@pytest.mark.parametrize(
    ("records", "verdict"),
    [({}, False), ({"made up: a < b": 1.0 + 1e-6}, False), ({"made up: a < b": 1.0 + 1e-9}, True)],
)
def test_own_record_is_held_to_1e_8(records: dict[str, float], verdict: bool) -> None:
    first = run_problem(made_up(failing=False), records).verdicts[0]
    assert first.answer.passed
    assert first.record is verdict
    assert first.passed is verdict
