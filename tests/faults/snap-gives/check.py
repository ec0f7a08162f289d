"""A motion in which the tip would gain energy by cutting ends there, with a sentence."""

import json
from collections.abc import Callable
from pathlib import Path

Run = Callable[..., tuple[int, str, str]]


def test_no_step_gives_energy(folder: Path, run: Run) -> None:
    del folder
    status, out, _ = run("run", "case.toml", "--json")
    record = json.loads(out)
    energy = record["energy"]
    assert max(energy["given"], energy["residual"]) <= 1e-9
    assert min(energy["cutting"], energy["friction"]) >= 0.0
    if record["status"] != "completed":
        assert (status, record["status"]) == (3, "not_converged")
        assert "contact would add energy" in record["sentence"]
