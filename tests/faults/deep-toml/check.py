"""Nesting in any place, as deep as the reader of TOML allows and deeper, is refused in a line."""

import pytest

from tests.conftest import CASES

GEL = CASES / "gel" / "case.toml"


def test_nested_anywhere(folder, run):
    for depth in (20, 100, 320, 2000):
        for opens, closes in (("{a=", "}"), ("[", "]")):
            value = opens * depth + "1" + closes * depth
            for key in ("planning", "title", "expect", "mesh.size", "regions", "axes"):
                status, _, err = run("run", GEL, "--set", f"{key}={value}")
                assert status == 2, (key, depth)
                assert len(err.splitlines()) == 1, err
                assert len(err) < 2000, len(err)


def test_digits_without_end(folder, run):
    status, _, err = run("run", GEL, "--set", f"targets.seed={'9' * 10000}")
    assert status == 2
    assert "targets" in err
    pytest.raises(ValueError, int, "9" * 10000)
    written = GEL.read_text() + f"\n[limits]\nsteps = {'9' * 10000}\n"
    (folder / "digits.toml").write_text(written)
    status, _, err = run("run", "digits.toml")
    assert status == 2
    assert len(err.splitlines()) == 1
