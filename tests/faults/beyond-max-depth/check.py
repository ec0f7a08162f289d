"""A needle ends at the largest depth, whichever way it gets there; so does a plan."""

import json

import pytest

DEPTH = 0.04


def pushed(run, friction, integrator, *more):
    chosen = f"needle.shaft_friction={friction} kPa", f"discretization.integrator={integrator}"
    sets = [part for value in (*chosen, *more) for part in ("--set", value)]
    status, out, err = run("run", "case.toml", "--json", *sets)
    assert status == 0, err
    return json.loads(out)


def test_path_following_ends_where_time_stepping_does(folder, run):
    for friction, alike in ((8, 1e-9), (800, 1e-9)):
        ends = []
        for integrator in ("march", "quasi-static"):
            found = pushed(run, friction, integrator)
            assert found["status"] == "completed"
            assert found["depth"][-1] == DEPTH
            assert max(found["depth"]) == DEPTH
            force = found["tip_force"][-1] + found["shaft_force"][-1]
            ends.append([force, found["energy"]["strain"], *found["tip_path"][-1]])
        assert ends[0] == pytest.approx(ends[1], rel=alike, abs=0.0)


def test_friction_takes_energy_until_a_point_sticks(folder, run):
    """At 800 kPa the first new piece would be dragged along: time stepping goes on from there."""
    assert pushed(run, 800, "march")["sticking"][-1] > 0
    found = pushed(run, 40, "march")
    assert found["depth"][-1] == DEPTH
    assert found["energy"]["friction"] > 0.0


def test_a_seed_released_at_the_end_of_a_push_is_there(folder, run):
    found = pushed(run, 8, "march", 'motion.stages=[{to="4 cm",release="a"}]')
    assert [seed["name"] for seed in found["seeds"]] == ["a"]
    assert found["seeds"][0]["now_at"] == pytest.approx([0.033, DEPTH])
    assert [e["name"] for e in found["events"] if e["kind"] == "release"] == ["a"]


def test_no_release_beyond_the_largest_depth_is_planned(folder, run):
    status, out, _ = run("plan", "case.toml", "--json", "--set", 'motion.max_depth="3.4 cm"')
    found = json.loads(out)
    assert status == 3
    assert found["status"] != "planned"
    assert "motion.max_depth" in found["sentence"]
    assert found["release_point"][1] <= 0.034
