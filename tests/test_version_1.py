"""Words of schema version 1 are read, reported once, and rewritten; results keep the old keys."""

import json
import shutil
import tomllib
import warnings
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from needlefem.casefile import load_case
from needlefem.casefile.upgrade import upgrade_case
from needlefem.cli.main import main
from needlefem.errors import CaseError
from needlefem.io import load_result
from needlefem.scene import Scene, vary
from needlefem.scene.version_1 import (
    CASE_KEYS,
    RESULT_KEYS,
    OldWord,
    renewed_case,
    renewed_quantity,
    renewed_record,
    with_old_keys,
)
from tests.conftest import PAPER_CASE

OLD = """\
# a comment with hold = "words" that stay
schema_version = 1
title = "old words: to = 1, background"
axes = ["y", "z"]

[mesh]
size = ["6 cm", "6 cm"]
divisions = [8, 8]
interfaces = "centroid"   # kept = "as it is"

[tissue]
background = "gel"

[materials.gel]
youngs_modulus = "30 kPa"
poissons_ratio = 0.45
density = "1000 kg/m^3"

[supports.walls]
faces = ["y_min", "y_max", "z_max"]

[discretisation]
integrator = "march"
kernel_points = 200
path_spacing = "2 mm"

[needle]
tip_radius = "2 mm"
cutting_force = "50 N/m"
shaft_friction = "10 kPa"
lateral_stiffness = "1e9 N/m^3"

[motion]
direction = [0.0, 1.0]
max_depth = "3 cm"
stages = [{to = "2 cm"}, {hold = "1 s", release = "to = 5"}]

[target]
point = ["2.87 cm", "1.5 cm"]

[planning]
height_range = ["-2 mm", "2 mm"]
golden_tolerance = "0.5 mm"

[[expect]]
key = "plan.snaps"
value = 0
"""


@pytest.fixture
def old_case(tmp_path: Path) -> Path:
    path = tmp_path / "case.toml"
    path.write_text(OLD, encoding="utf-8")
    return path


def test_old_words_are_read_and_reported_once(old_case: Path) -> None:
    with pytest.warns(FutureWarning, match="words of schema version 1") as seen:
        scene = load_case(old_case, ["needle.static_friction=1.2"])
    assert len(seen) == 1
    assert "\n" not in str(seen[0].message)
    assert "needlefem upgrade" in str(seen[0].message)
    assert scene.default_material == "gel"
    assert scene.discretization.tip_quadrature_points == 200
    assert scene.discretization.integrator == "path_following"
    assert scene.needle.static_friction_ratio == pytest.approx(1.2)
    assert [stage.dwell for stage in scene.motion.stages] == [None, 1.0]
    assert scene.motion.stages[1].release == "to = 5"
    assert scene.expect[0].key == "plan.ruptures"


def test_upgrade_keeps_comments_and_says_the_same(old_case: Path) -> None:
    with pytest.warns(FutureWarning):
        before = load_case(old_case)
    text, words = upgrade_case(old_case)
    assert text.splitlines()[0] == OLD.splitlines()[0]
    assert 'title = "old words: to = 1, background"' in text
    assert 'interfaces = "by_centroid"   # kept = "as it is"' in text
    assert len(words) == 10
    old_case.write_text(text, encoding="utf-8")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        after = load_case(old_case)
    assert vary(before, {"source": None}) == vary(after, {"source": None})
    assert upgrade_case(old_case) == (text, ())


def test_upgrade_command(old_case: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["upgrade", str(old_case)]) == 0
    assert "needle.lateral_stiffness is now lateral_penalty" in capsys.readouterr().out
    assert tomllib.loads(old_case.read_text(encoding="utf-8"))["schema_version"] == 2


def test_nested_words_that_cannot_be_rewritten_leave_the_file(tmp_path: Path) -> None:
    path = tmp_path / "case.toml"
    text = 'schema_version = 1\nmotion = {stages = [{to = "2 cm"}]}\n'
    path.write_text(text, encoding="utf-8")
    with pytest.raises(CaseError, match="rewrite it by hand: motion.stages.0.to is now depth"):
        upgrade_case(path)
    assert path.read_text(encoding="utf-8") == text


def test_both_words_of_a_key_are_refused(old_case: Path) -> None:
    text = OLD.replace("kernel_points = 200", "kernel_points = 200\ntip_quadrature_points = 100")
    old_case.write_text(text, encoding="utf-8")
    with pytest.raises(CaseError, match="tip_quadrature_points is there as well"):
        load_case(old_case)


def test_vary_accepts_old_words(gel: Scene) -> None:
    with pytest.warns(FutureWarning, match="needle.static_friction is now static_friction_ratio"):
        found = vary(gel, {"needle.static_friction": 1.5, "discretisation.integrator": "march"})
    assert found.needle.static_friction_ratio == pytest.approx(1.5)
    assert found.discretization.integrator == "path_following"


def test_every_old_key_becomes_a_field_of_the_scene(gel: Scene) -> None:
    for path, new in CASE_KEYS.items():
        nested: object = 1
        for part in reversed(path):
            nested = [nested] if part == "*" else {part: nested}
        found: list[object] = []
        renewed = json.dumps(renewed_case(nested, found))  # type: ignore[arg-type]
        assert f'"{new}": 1' in renewed
        assert len(found) == 1


@pytest.mark.parametrize("command", ["run", "plan"])
def test_results_have_both_keys(command: str, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert main([command, str(PAPER_CASE), "--out", str(out), "--no-pictures", "--json"]) == 0
    record = json.loads((out / f"{command}.json").read_text(encoding="utf-8"))
    assert record["schema"] == 2
    for old, new in RESULT_KEYS[command].items():
        node = record
        for part in old[:-1]:
            node = (node or [None])[0] if part == "*" else (node or {}).get(part)
        if isinstance(node, dict) and new in node and old != ("tip",):
            assert node[old[-1]] == node[new], old
    if command == "run":
        assert {"cutting"} <= set(record["tip"])
        assert len(record["jumping"]) == len(record["tip_phase"])


def test_a_result_of_version_1_is_read_in_the_words_of_version_2() -> None:
    old = {
        "status": "restick", "tip": ["pressing", "cutting", "jumping"], "snaps": [],
        "events": [{"kind": "snap", "time": 0.0}], "energy": {"hold": 1.0, "work": 2.0},
        "seeds": [{"now_at": [0.0, 1.0]}], "discretisation": {"kernel_points": 3},
    }  # fmt: skip
    new = renewed_record(old, "run")
    assert new == {
        "status": "stick_detected", "tip_phase": ["loading", "cutting", "rupture"], "ruptures": [],
        "events": [{"kind": "rupture", "time": 0.0}],
        "energy": {"lateral_penalty_energy": 1.0, "work": 2.0},
        "seeds": [{"final_position": [0.0, 1.0]}],
        "discretization": {"tip_quadrature_points": 3},
    }  # fmt: skip
    again = with_old_keys(new, "run")
    assert again["tip"] == old["tip"]
    assert again["energy"]["hold"] == 1.0
    assert renewed_record(again, "run") is again


def test_expectations_of_old_keys() -> None:
    found: list[object] = []
    name = renewed_quantity("run.seeds.0.from_rest", found)  # type: ignore[arg-type]
    assert name == "run.seeds.0.distance_from_rest"
    assert len(found) == 1
    assert renewed_quantity("smoothness.noise", []) == "smoothness.noise"


def test_values_that_are_no_tables_of_text_stay_as_they_are() -> None:
    found: list[OldWord] = []
    given = {"regions": {1: {"a": (1, 2)}}, "motion": {"stages": ({"to": 1},)}}
    renewed = renewed_case(given, found)
    assert renewed == {"regions": {1: {"a": (1, 2)}}, "motion": {"stages": ({"depth": 1},)}}
    assert [str(word) for word in found] == ["motion.stages.0.to is now depth"]
    word = OldWord("a", "b", "c")  # a named tuple is a value
    assert renewed_case(word, found) is word


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    """Return a folder with a case of version 1 and its results, written by version 0.1.0."""
    folder = tmp_path / "version_1"
    shutil.copytree(Path(__file__).parent / "io" / "version_1", folder)
    for command in ("run", "plan"):
        file = folder / command / f"{command}.json"
        record = json.loads(file.read_text(encoding="utf-8"))
        record["source"] = str(folder / "case.toml")
        file.write_text(json.dumps(record), encoding="utf-8")
    return folder


def test_a_saved_case_of_version_1_has_the_saved_results(saved: Path) -> None:
    for command, keys in {
        "run": ("depth", "tip_path", "tip_force", "shaft_force", "lateral_force", "time"),
        "plan": ("release_point", "placed_at", "placement_error"),
    }.items():
        out = saved / "again"
        case = str(saved / "case.toml")
        assert main([command, case, "--out", str(out), "--no-pictures", "--json"]) == 0
        old, new = (
            json.loads((folder / f"{command}.json").read_text(encoding="utf-8"))
            for folder in (saved / command, out)
        )
        for key in keys:
            assert np.array(new[key]) == pytest.approx(np.array(old[key]), rel=1e-8, abs=1e-12)
        shutil.rmtree(out)


def test_a_saved_result_of_version_1_is_read_and_drawn(saved: Path) -> None:
    found = load_result(saved / "run")
    assert set(found["tip_phase"]) <= {"loading", "cutting"}
    assert load_result(saved / "plan")["ruptures"] == 0
    again = saved / "again"
    assert main(["run", str(saved / "case.toml"), "--out", str(again), "--no-pictures"]) == 0
    pictures = [saved / "old.png", saved / "new.png"]
    for result, picture in zip((saved / "run", again), pictures, strict=True):
        assert main(["render", str(result), "--out", str(picture)]) == 0
    first, second = (np.asarray(Image.open(picture)) for picture in pictures)
    assert np.array_equal(first, second)
    assert np.ptp(first) > 0
    assert main(["render", str(saved / "plan"), "--out", str(saved / "plan.png")]) == 0
