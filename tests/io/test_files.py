import json
from pathlib import Path

import numpy as np
import pytest

from needlefem.io import compare, look_up, to_json, whole_file, write_json
from needlefem.scene import Expectation
from needlefem.studies import Table


def test_json_is_plain() -> None:
    record = {
        "a": np.array([1.0, np.inf]),
        "b": np.int64(3),
        "c": (None, True),
        "d": Path("x"),
        "e": np.bool_(1),
    }
    assert json.loads(to_json(record)) == {
        "a": [1.0, None],
        "b": 3,
        "c": [None, True],
        "d": "x",
        "e": True,
    }


def test_files_are_whole_or_not_there(tmp_path: Path) -> None:
    write_json(tmp_path / "sub" / "a.json", {"x": 1})
    with pytest.raises(RuntimeError), whole_file(tmp_path / "b.txt") as part:
        part.write_text("half")
        raise RuntimeError
    assert sorted(p.name for p in tmp_path.rglob("*") if p.is_file()) == ["a.json"]


def expectation(**changes: object) -> Expectation:
    given = {"key": "plan.x", "value": 1.0, "tolerance": 0.1, "unit": "", "kind": "", "source": ""}
    return Expectation(**(given | changes))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("item", "found", "holds"),
    [
        (expectation(), 1.05, True),
        (expectation(), 1.2, False),
        (expectation(), None, False),
        (expectation(tolerance=None), 0.3, True),
        (expectation(tolerance=None), 1.3, False),
        (expectation(value=(1.0, 2.0)), [1.05, 2.05], True),
        (expectation(value=(1.0, 2.0)), [1.08, 2.08], False),
    ],
)
def test_expectations(item: Expectation, found: object, holds: bool) -> None:
    table = compare([item], {"x": found}, "plan", ("y", "z"))
    assert table is not None
    assert table.passed is holds


def test_expectations_of_other_results_are_left_out() -> None:
    assert compare([expectation()], {}, "run", ("y", "z")) is None


def test_paths_name_axes() -> None:
    record = {"a": {"b": [[1, 2], [3, 4]]}}
    assert look_up(record, ["a", "b", "1", "z"], ("y", "z")) == 4
    assert look_up({"a": None}, ["a", "b"], ("y", "z")) is None


def test_table_is_aligned() -> None:
    text = Table(
        title="t", columns=("a", "long"), rows=[["x", 1.23456], [True, 2]], note="n"
    ).text()
    assert text.splitlines() == ["t", "a    long", "---  -----", "x    1.235", "yes  2", "n"]
