"""An insertion along a mesh line of irregular quadrilaterals goes to its depth."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

Run = Callable[..., tuple[int, str, str]]


def test_the_insertion_converges(folder: Path, run: Run) -> None:
    del folder
    status, out, _ = run("run", "case.toml", "--json")
    record = json.loads(out)
    assert (status, record["status"]) == (0, "completed")
    aside = 'motion.entry=["5.01 mm", "0 mm"]'
    beside = json.loads(run("run", "case.toml", "--json", "--set", aside)[1])
    for name in ("puncture_depth", "depth"):
        ours, theirs = record[name], beside[name]
        if name == "depth":
            ours, theirs = ours[-1], theirs[-1]
        assert ours == pytest.approx(theirs, rel=1e-3)


def test_its_plan_has_all_evidence(folder: Path, run: Run) -> None:
    del folder
    plan = json.loads(run("plan", "case.toml", "--json")[1])
    assert plan["status"] == "planned"
    assert plan["depth_only"]["placement_error"] < 1e-3
    assert plan["unplanned"]["placement_error"] > 5e-3
