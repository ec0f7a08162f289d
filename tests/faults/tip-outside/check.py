"""The tip is in the tissue in every state; where it leaves is a status with a place."""

import json

MOTIONS = {
    "path following": (),
    "time stepping": ("discretization.integrator=quasi-static",),
    "through the far side": (
        "motion.entry=['3 cm','0 cm']", "motion.max_depth=20 cm", "supports.w.faces=['y_min']",
    ),
    "through the far side in time": (
        "motion.entry=['3 cm','0 cm']", "motion.max_depth=20 cm", "supports.w.faces=['y_min']",
        "discretization.integrator=quasi-static", "discretization.path_spacing=8 mm",
        "mesh.divisions=[8,8]",
    ),
    "obliquely": ("motion.entry=['5 cm','0 cm']", "motion.direction=[0.6,0.8]"),
}  # fmt: skip


def leaves(run, changes):
    sets = [part for value in changes for part in ("--set", value)]
    status, out, err = run("run", "case.toml", "--json", *sets)
    assert status == 3, err
    found = json.loads(out)
    assert status == 3
    assert found["status"] == "left_tissue"
    assert "at a depth of" in found["sentence"]
    assert "through its surface at (" in found["sentence"]
    for place in [*found["tip_path"], *(seed["placed_at"] for seed in found["seeds"])]:
        assert all(0.0 <= x <= 0.06 for x in place)
    assert found["energy"]["residual"] < 1e-11


def test_leaving_is_a_status_with_a_place(folder, run):
    for changes in MOTIONS.values():
        leaves(run, changes)


def test_what_there_is_can_be_written_and_drawn(folder, run):
    assert run("run", "case.toml", "--out", "o", "--snapshots", "3")[0] == 3
    assert (folder / "o" / "insertion.pvd").exists()
    status, _, err = run("render", "case.toml", "--out", "stills.png")
    assert status in (0, 4), err  # 4: nothing can be drawn on this machine


def test_nothing_is_placed_by_an_insertion_that_broke_off(folder, run):
    for integrator in ("march", "quasi-static"):
        chosen = "--set", f"discretization.integrator={integrator}"
        _, out, _ = run("run", "case.toml", *chosen)
        assert "nothing is placed, because the insertion ended early at a depth of" in out
        assert ": placed" not in out
        _, out, _ = run("run", "case.toml", "--json", *chosen)
        assert [seed["status"] for seed in json.loads(out)["seeds"]] == ["not_placed"]
