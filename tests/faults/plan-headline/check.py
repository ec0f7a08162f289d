import json

from tests.conftest import PAPER_CASE


def test_the_first_line_says_what_the_plan_is_worth(folder, run):
    _, out, _ = run("plan", PAPER_CASE)
    first, *others = out.splitlines()
    assert "planned, placement error at most about 1.4 mm: mesh" in first
    assert "strains beyond the model's range: yes (0.56 > limit 0.3), not included" in first
    assert "e-0" not in first
    release = next(line for line in others if line.startswith("  release at"))
    assert "error" not in release
    assert any("cm residual on this model" in line for line in others)
    assert any("discretisation: P1, 1200 unknowns, 1250 cells of 2.6 mm" in line for line in others)


def test_json_has_the_same(folder, run):
    _, out, _ = run("plan", PAPER_CASE, "--json", "--set", "outputs.strain_limit=0.6")
    found = json.loads(out)
    headline = found["headline"]
    assert headline["strains_beyond_limit"] is False
    assert found["validity"]["strain_limit"] == 0.6
    parts = headline["contains"]
    assert abs(sum(parts.values()) - headline["placement_error"]) < 1e-12
    assert parts["mesh"] == found["estimate"]["at_most"] == 3.0 * found["estimate"]["error"]
    assert parts["search"] == found["placement_error"]
    assert found["discretisation"]["element"] == "P1"
    assert found["discretisation"]["unknowns"] == 1200
    assert not any("small strain" in warning for warning in found["warnings"])


def test_without_an_estimate_the_first_line_says_so(folder, run):
    _, out, _ = run("plan", PAPER_CASE, "--set", "planning.estimate=false")
    assert "placement error not estimated: planning.estimate = false" in out.splitlines()[0]


def test_a_run_says_whether_strains_are_beyond_the_limit(folder, run):
    _, out, _ = run("run", PAPER_CASE)
    assert "strains beyond the model's range: yes" in out.splitlines()[0]
    assert "discretisation: P1" in out
