"""Columns are read by the names in the header, so that both files are the same outline."""

import json


def test_swapped_columns_are_the_same_outline(folder, run):
    records = []
    for name in ("swap.csv", "straight.csv"):
        contour = f"regions.gland.contour={name}"
        status, out, err = run("run", "case.toml", "--set", contour, "--json")
        assert status == 0, err
        records.append(json.loads(out))
    assert records[0]["seeds"][0]["placed_at"] == records[1]["seeds"][0]["placed_at"]


def test_names_that_are_no_axes_are_refused(folder, run):
    text = (folder / "swap.csv").read_text().replace("z [mm], y [mm]", "x [mm], y [mm]")
    (folder / "swap.csv").write_text(text)
    status, _, err = run("run", "case.toml")
    assert status == 2
    assert "'x', which is not an axis" in err
