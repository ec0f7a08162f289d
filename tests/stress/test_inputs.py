"""Damaged inputs: what is damaged, what is required, and a sample that meets it."""

import os
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest

from needlefem.cli.main import main
from needlefem.stress import Lost, check_input, inputs, make_results, write_case, write_mesh_case
from needlefem.stress.damage import CODE, damage
from needlefem.stress.inputfiles import MESH_FILES

SEED = 16
COUNT = 200


def test_a_sample_meets_all_requirements() -> None:
    runs = inputs.run_inputs(main, SEED, range(COUNT), min(2, os.cpu_count() or 1), print)
    assert inputs.passed(runs, COUNT), "\n".join(inputs.listing(SEED, runs))


@pytest.mark.parametrize("kind", ["inputs", "scenes"])
def test_a_run_that_is_stopped_reports_what_ran(
    kind: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def first_alone(*_: object, **__: object) -> Iterator[tuple[int, Lost]]:
        yield 0, Lost("too late")
        raise KeyboardInterrupt("stopped by SIGTERM")

    monkeypatch.setattr("needlefem.stress.inputs.make_results", make_no_results)
    monkeypatch.setattr(f"needlefem.stress.{kind}.work_through", first_alone)
    assert main(["verify", "--stress", kind, "--count", "7"]) == 1
    said = capsys.readouterr()
    assert f"1 of 7 {kind} run" in said.out
    assert "1 with a fault" in said.out
    assert "too late" in said.out
    assert "stopped by SIGTERM" in said.err


def make_no_results(folder: Path, command_line: object) -> None:
    for name in ("run", "plan"):
        (folder / name).mkdir()
        (folder / name / f"{name}.json").write_text("{}")


def test_what_passed_in_part_has_not_passed() -> None:
    assert inputs.passed([], 0)
    assert not inputs.passed([], 1)


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("results")
    make_results(folder, main)
    return folder


@pytest.mark.parametrize("name", MESH_FILES)
def test_sound_meshes_are_read(tmp_path: Path, name: str, capfd: pytest.CaptureFixture) -> None:
    write_mesh_case(tmp_path, name)
    assert main(["run", str(tmp_path / "case.toml"), "--json"]) == 0


def test_inputs_follow_from_seed_and_number(results: Path, tmp_path: Path) -> None:
    for number in range(12):
        one, other = tmp_path / f"{number}a", tmp_path / f"{number}b"
        one.mkdir()
        other.mkdir()
        first = inputs.draw_input(1, number, one, results)
        assert inputs.draw_input(1, number, other, results) == first
        for path in one.rglob("*"):
            if path.is_file():
                assert path.read_bytes() == (other / path.relative_to(one)).read_bytes()


def test_damage_changes_the_file(tmp_path: Path) -> None:
    changed = 0
    for number in range(40):
        folder = tmp_path / str(number)
        write_case(folder)
        before = (folder / "case.toml").read_bytes()
        damage(np.random.default_rng(number), folder, "case.toml")
        file = folder / "case.toml"
        changed += not file.is_file() or file.is_symlink() or file.read_bytes() != before
    assert changed >= 36  # a value may be replaced by its like


def _raises(arguments: Sequence[str]) -> int:
    raise ValueError("no")


def _talks(arguments: Sequence[str]) -> int:
    sys.stderr.write("one\ntwo\nthree\n")
    return 2


def _writes(arguments: Sequence[str]) -> int:
    Path("case.toml").write_text("gone")
    return 0


def _escapes(arguments: Sequence[str]) -> int:
    (Path.cwd().parent / "escaped").write_text("here")
    return 0


def _runs_code(arguments: Sequence[str]) -> int:
    __import__(CODE.partition(":")[0])
    return 0


def _warns(arguments: Sequence[str]) -> int:
    np.log(np.zeros(1))
    return 0


def _leaves_parts(arguments: Sequence[str]) -> int:
    out = Path.cwd().parent / "out"
    out.mkdir()
    (out / ".part-x.json").write_text("{")
    return 0


def _silent(arguments: Sequence[str]) -> int:
    return 2


def _odd(arguments: Sequence[str]) -> int:
    sys.stderr.write("bad\n")
    return 77


def _below_python(arguments: Sequence[str]) -> int:
    os.write(2, b"ERROR: of a library\n")
    return 0


@pytest.mark.parametrize(
    ("command_line", "requirement"),
    [
        (_raises, "no traceback"),
        (_talks, "two lines"),
        (_writes, "no file outside --out"),
        (_escapes, "no file outside --out"),
        (_runs_code, "no code run"),
        (_warns, "no lines of dependencies"),
        (_leaves_parts, "no file half written"),
        (_silent, "a message"),
        (_odd, "a known exit status"),
        (_below_python, "no lines of dependencies"),
    ],
)
def test_faults_are_seen(
    command_line: object, requirement: str, results: Path, tmp_path: Path
) -> None:
    number = _number_of_run(results, tmp_path)
    run = check_input(command_line, results, 1, number, tmp_path / "own")  # type: ignore[arg-type]
    assert requirement in [fault.requirement for fault in run.faults]
    assert not inputs.passed([run], 1)
    assert f"--only {number}" in "\n".join(inputs.listing(1, [run]))


def test_a_sound_answer_has_no_fault(results: Path, tmp_path: Path) -> None:
    def answers(arguments: Sequence[str]) -> int:
        sys.stderr.write("needlefem: mesh.size: '1' has no unit; write a length\n")
        return 2

    number = _number_of_run(results, tmp_path)
    assert check_input(answers, results, 1, number, tmp_path / "own").faults == ()


def _number_of_run(results: Path, tmp_path: Path) -> int:
    """Return the number of an input that ``needlefem run`` reads."""
    for number in range(50):
        folder = tmp_path / f"draw-{number}"
        folder.mkdir()
        drawn = inputs.draw_input(1, number, folder, results)
        if drawn.kind == "case" and drawn.arguments[0] == "run":
            return number
    raise AssertionError("none among 50")


def test_one_input_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "kept"
    main(["verify", "--stress", "inputs", "--seed", "1", "--only", "2", "--out", str(folder)])
    assert "1 of 1 inputs run" in capsys.readouterr().out
    assert (folder / "in").is_dir()
    assert (folder / "errors.txt").exists()
