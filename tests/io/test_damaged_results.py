"""Results that were edited, cut or mixed are refused by the name of the file and the key."""

import copy
import json
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import needlefem as nf
from needlefem.casefile import read_again
from needlefem.cli.main import main
from needlefem.cli.render import replay
from needlefem.errors import CaseError, NeedlefemError

CASE = Path(__file__).parents[1] / "faults" / "stale-pictures"
WRONG: tuple[Any, ...] = (
    None, True, -1, 1e308, 10**400, "x", [], [[1, 2]], {"a": None}, float("nan"),
)  # fmt: skip
REQUIRED = {
    "run": ("source", "overrides", "status", "depth", "tip_path", "time", "seeds", "events"),
    "plan": ("source", "overrides", "status", "release_point", "placed_at", "direction"),
}


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("results")
    shutil.copytree(CASE, folder / "case")
    case = str(folder / "case" / "case.toml")
    keep, quick = ["--no-pictures", "--out"], ["--set", "planning.estimate=false"]
    assert main(["run", case, "--snapshots", "2", *keep, str(folder / "run")]) == 0
    assert main(["plan", case, *quick, *keep, str(folder / "plan")]) == 0
    return folder


def _text(change: Callable[[bytes], bytes]) -> Callable[[Path], None]:
    return lambda path: path.write_bytes(change(path.read_bytes())) and None  # type: ignore[func-returns-value]


def _folder(path: Path) -> None:
    path.unlink()
    path.mkdir()


DAMAGES: dict[str, Callable[[Path], None]] = {
    "missing": Path.unlink,
    "a folder": _folder,
    "empty": _text(lambda _: b""),
    "blank": _text(lambda _: b"\n\n"),
    "cut in the middle": _text(lambda content: content[: len(content) // 2]),
    "cut at the end": _text(lambda content: content.rstrip()[:-3]),
    "in UTF-16": _text(lambda content: content.decode(errors="replace").encode("utf-16")),
    "not in UTF-8": _text(lambda content: content[:20] + b"\xe4" + content[20:]),
    "zeros": _text(lambda content: bytes(len(content))),
    "of another kind": _text(lambda _: b'{"a": 1}\n'),
    "nested": _text(lambda _: b"[" * 100_000),
}


@pytest.mark.parametrize("damage", DAMAGES)
@pytest.mark.parametrize(
    "name", ["run.json", "insertion.csv", "events.csv", "shaft.csv", "insertion.pvd",
             "insertion/0001.vtu"],
)  # fmt: skip
def test_every_damaged_file_is_named(
    results: Path, name: str, damage: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "run"
    shutil.copytree(results / "run", folder)
    DAMAGES[damage](folder / name)
    if name == "insertion.pvd" and damage == "missing":  # a run without --snapshots has none
        nf.load_result(folder)
        return
    if name.endswith("vtu") and damage == "not in UTF-8":  # only its end is looked at
        nf.load_result(folder)
        return
    with pytest.raises(CaseError) as caught:
        nf.load_result(folder)
    gone = name == "run.json" and damage in ("missing", "a folder")
    assert (str(folder) if gone else name) in str(caught.value)
    assert "\n" not in str(caught.value)
    assert main(["render", str(folder), "--out", str(tmp_path / "p.png")]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


def _changed(record: dict[str, Any], deep: int = 3) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the record without each key, and with wrong values for it, first entries of lists."""

    def paths(value: Any, path: tuple[Any, ...]) -> Iterator[tuple[Any, ...]]:
        if path:
            yield path
        if len(path) < deep and isinstance(value, dict | list):
            items = value.items() if isinstance(value, dict) else list(enumerate(value))[:1]
            for key, item in items:
                yield from paths(item, (*path, key))

    for path in paths(record, ()):
        for wrong in ("delete", *WRONG):
            changed = copy.deepcopy(record)
            inner: Any = changed
            for key in path[:-1]:
                inner = inner[key]
            if wrong == "delete":
                del inner[path[-1]]
            else:
                inner[path[-1]] = wrong
            yield f"{'.'.join(map(str, path))} {wrong!r:.20}", changed


def _said(errors: type[Exception], act: Callable[[], object]) -> str:
    """Return the message of an error of a kind, empty where there was none."""
    try:
        act()
    except errors as error:
        return str(error)
    return ""


@pytest.mark.parametrize("kind", ["run", "plan"])
def test_every_edited_value_is_read_or_refused(results: Path, kind: str, tmp_path: Path) -> None:
    """No traceback; a required key that is missing or null-like is named."""
    folder = tmp_path / kind
    shutil.copytree(results / kind, folder)
    file = folder / f"{kind}.json"
    record = json.loads(file.read_text())
    refused = 0
    for title, changed in _changed(record):
        file.write_text(json.dumps(changed))
        key = title.split(" ", maxsplit=1)[0].split(".", maxsplit=1)[0]
        said = _said(CaseError, lambda: nf.load_result(folder))
        refused += bool(said)
        assert not said or (file.name in said and "\n" not in said), title
        assert said or title != f"{key} 'delete'" or key not in REQUIRED[kind], title
    assert refused > 300


@pytest.mark.parametrize("kind", ["run", "plan"])
def test_what_is_read_of_an_edited_result_can_be_drawn_or_is_refused(
    results: Path, kind: str, tmp_path: Path
) -> None:
    """Values that are of the right kind but not the result's: compared with what its case gives."""
    folder = tmp_path / kind
    shutil.copytree(results / kind, folder)
    file = folder / f"{kind}.json"
    record = json.loads(file.read_text())
    keys = {"source", "overrides", "tip_path", "placed_at", "release_point", "direction"}
    chosen = [
        changed for title, changed in _changed(record, deep=2) if title.split(".")[0].split(" ")[0]
        in keys
    ]  # fmt: skip
    ended = []
    for changed in chosen:
        file.write_text(json.dumps(changed))
        said = _said(NeedlefemError, lambda: replay(str(folder), [], None))
        assert "\n" not in said
        ended.append(bool(said))
    assert sum(ended) > len(ended) // 2


def test_swapped_columns_and_lost_rows_are_found(results: Path, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    shutil.copytree(results / "run", folder)
    file = folder / "insertion.csv"
    sound = file.read_text()
    for old, new, reason in (
        ("time [s],depth [m]", "depth [m],time [s]", "the column 'time [s]' of .*insertion.csv"),
        ("y [m],z [m]", "z [m],y [m]", "insertion.csv' and .*events.csv' name other axes"),
        ("tip,", "point,", "has no column 'tip'"),
        ("speed [m/s]", "time [s]", "two columns of .* have one name"),
    ):
        file.write_text(sound.replace(old, new, 1))
        with pytest.raises(CaseError, match=reason.replace("[", r"\[").replace("]", r"\]")):
            nf.load_result(folder)
    file.write_text("".join(sound.splitlines(keepends=True)[:-1]))
    with pytest.raises(CaseError, match=r"insertion.csv' has \d+ states, 'run.json' has \d+"):
        nf.load_result(folder)
    for cell in ("nan", "inf", "x", "1e999"):
        rows = sound.splitlines()
        rows[2] = ",".join([cell, *rows[2].split(",")[1:]])
        file.write_text("\n".join(rows) + "\n")
        with pytest.raises(CaseError, match=f"line 3 of '.*insertion.csv' has '{cell}'"):
            nf.load_result(folder)


def test_other_tables_in_the_folder_are_the_users_own(results: Path, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    shutil.copytree(results / "run", folder)
    (folder / "notes.csv").write_bytes(b"\xff\xfe no table")
    (folder / "mine.pvd").write_text("none")
    assert set(nf.load_result(folder).tables) == {"insertion", "events", "shaft"}


def test_a_case_that_changed_since_is_found(results: Path, tmp_path: Path) -> None:
    shutil.copytree(results / "case", tmp_path / "case")
    shutil.copytree(results / "run", tmp_path / "run")
    case, file = tmp_path / "case" / "case.toml", tmp_path / "run" / "run.json"
    record = json.loads(file.read_text()) | {"source": str(case)}
    file.write_text(json.dumps(record))
    tips = np.array(record["tip_path"])
    assert replay(str(tmp_path / "run"), [], None).tips == pytest.approx(tips, abs=1e-9)
    case.write_text(case.read_text().replace("60 kPa", "61 kPa"))
    with pytest.raises(CaseError, match="its case gives another result by now"):
        replay(str(tmp_path / "run"), [], None)
    case.unlink()
    with pytest.raises(CaseError, match="there is no such file"):
        replay(str(tmp_path / "run"), [], None)
    shutil.copy(results / "case" / "case.toml", tmp_path / "run" / "case.toml")
    shutil.copy(results / "case" / "ok.csv", tmp_path / "run" / "ok.csv")
    replay(str(tmp_path / "run"), [], None)  # moved together with its result


def test_overrides_of_every_kind_come_back(results: Path, tmp_path: Path) -> None:
    out = tmp_path / "o"
    given = ["--set", 'title="a\\u007f \\U0001F600"', "--set", "mesh.divisions=[18, 18]",
             "--set", 'supports.walls={faces=["y_min", "y_max", "z_max"]}']  # fmt: skip
    case = str(results / "case" / "case.toml")
    assert main(["run", case, "--no-pictures", *given, "--out", str(out)]) == 0
    scene = read_again(out).scene
    assert (scene.title, scene.mesh.divisions) == ("a\x7f \U0001f600", (18, 18))  # type: ignore[union-attr]
