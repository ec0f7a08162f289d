import json
import re

from tests.conftest import PAPER_CASE


def test_every_search_names_the_depth_to_type(folder, run):
    for search in ("root", "golden", "grid"):
        common = ("plan", PAPER_CASE, "--json", "--search", search, "--set", "planning.estimate=false")
        status, out, _ = run(*common, "--set", "motion.max_depth=3.5 cm")
        found = json.loads(out)
        assert status == 3
        assert found["status"] == "beyond_max_depth"
        assert "motion.max_depth = 3.5 cm" in found["sentence"]
        assert found["release_depth"] <= 0.035 + 1e-9
        depth = re.search(r'set motion.max_depth to "(.*?)"', found["sentence"])[1]
        _, out, _ = run(*common, "--set", f"motion.max_depth={depth}")
        assert json.loads(out)["status"] == "planned"


def test_what_a_shallow_motion_does_not_reach_is_null(folder, run):
    _, out, _ = run("plan", PAPER_CASE, "--json", "--set", "motion.max_depth=2 mm")
    found = json.loads(out)
    for name in ("release_point", "unplanned", "depth_only", "energy", "validity", "estimate"):
        assert found[name] is None
    assert "motion.max_depth" in found["missing"]["unplanned"]
    assert "motion.max_depth" in found["missing"]["depth_only"]
