"""Pressing elastic skin without cutting it, and going back, takes no work."""

import json
from collections.abc import Callable
from pathlib import Path

Run = Callable[..., tuple[int, str, str]]


def test_no_work_is_left(folder: Path, run: Run) -> None:
    del folder
    status, out, _ = run("run", "case.toml", "--json")
    record = json.loads(out)
    energy = record["energy"]
    assert (status, record["status"]) == (0, "completed")
    assert abs(energy["work"]) <= 1e-12 * energy["turnover"]
    assert max(energy["given"], energy["residual"]) <= 1e-12
    last = record["tip"].index("out", 1)
    assert abs(record["depth"][last]) <= 1e-12
