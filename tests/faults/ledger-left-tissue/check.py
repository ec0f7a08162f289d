"""The energy balance closes if the tip leaves viscoelastic tissue within a step."""

import json
from collections.abc import Callable
from pathlib import Path

Run = Callable[..., tuple[int, str, str]]


def test_the_ledger_closes(folder: Path, run: Run) -> None:
    del folder
    status, out, _ = run("run", "case.toml", "--json")
    record = json.loads(out)
    assert (status, record["status"]) == (3, "left_tissue")
    assert max(record["energy"]["given"], record["energy"]["residual"]) <= 1e-9
