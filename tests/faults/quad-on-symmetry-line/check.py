import json


def test_a_plan_shows_no_number_of_a_broken_insertion(folder, run):
    _, out, _ = run("plan", "case.toml", "--json", "--set", "planning.estimate=false")
    found = json.loads(out)
    assert found["status"] == "planned"
    _, out, _ = run("run", "case.toml", "--json")
    level = json.loads(out)
    for name in ("unplanned", "depth_only"):
        if level["status"] == "completed":
            # 0.01 mm beside the line of symmetry they end 0.78 and 0.02 cm from the target
            assert found[name]["placement_error"] < 0.01, name
            assert name not in found["missing"]
        else:
            assert found[name] is None
            assert "broke off" in found["missing"][name]
    if level["status"] == "completed":
        assert found["depth_only"]["placement_error"] < 1e-3
