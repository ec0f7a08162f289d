"""Histories are written while a motion goes on."""

import csv
from pathlib import Path

import pytest

from needlefem.insertion import Simulation
from needlefem.io import History, recorded_states
from needlefem.scene import Scene, Stage, vary

STAGES = (Stage(depth=0.012), Stage(dwell=1.0, release="seed"), Stage(depth=-1e-3))


def read(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8") as table:
        return list(csv.DictReader(table))


def test_tables_say_what_happened(gel: Scene, tmp_path: Path) -> None:
    simulation = Simulation(vary(gel, {"motion.stages": STAGES}))
    course = simulation.insertion_run(simulation.entry_of_case())
    states = list(recorded_states(course, History(folder=tmp_path)))
    rows = read(tmp_path / "insertion.csv")
    assert [float(row["depth [m]"]) for row in rows] == pytest.approx(
        [state.depth for state in states], abs=1e-10
    )
    assert rows[0]["seed y [m]"] == ""
    last = states[-1].seeds[0]
    assert [float(rows[-1][f"seed {a} [m]"]) for a in "yz"] == pytest.approx(last, abs=1e-9)
    assert float(rows[-2]["speed [m/s]"]) == pytest.approx(-0.005)
    kinds = [row["event"] for row in read(tmp_path / "events.csv")]
    assert kinds == ["puncture", "full_stick", "release", "retraction_start", "full_slip", "exit"]
    shaft = read(tmp_path / "shaft.csv")
    limit = gel.needle.shaft_friction
    assert all(abs(float(row["friction [Pa]"])) <= limit * (1.0 + 1e-6) for row in shaft)
    assert {row["slip"] for row in shaft} == {"-1", "0", "1"}
    result = course.result(tuple(states))
    assert [event.kind for event in result.events] == kinds


def test_what_was_written_is_kept_when_the_caller_stops(gel: Scene, tmp_path: Path) -> None:
    simulation = Simulation(vary(gel, {"motion.stages": STAGES}))
    course = simulation.insertion_run(simulation.entry_of_case())
    states = recorded_states(course, History(folder=tmp_path, every=0))
    for _ in range(5):
        next(states)
    states.close()
    assert len(read(tmp_path / "insertion.csv")) == 5
    assert read(tmp_path / "shaft.csv") == []
    assert not list(tmp_path.glob(".part-*"))


def test_long_motions_keep_few_events(gel: Scene, tmp_path: Path) -> None:
    once = (Stage(depth=0.006), Stage(depth=-1e-3))
    scene = vary(gel, {"motion.stages": once * 12, "discretization.path_spacing": 3e-3})
    simulation = Simulation(scene)
    course = simulation.insertion_run(simulation.entry_of_case())
    for _ in recorded_states(course, History(folder=tmp_path, every=0)):
        assert len(course.stepping.event_log.events) <= 4 if course.stepping else True
    kinds = [row["event"] for row in read(tmp_path / "events.csv")]
    assert kinds.count("exit") == 12
