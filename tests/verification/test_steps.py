"""The study of many steps with inertia, with few."""

import pytest

from needlefem.scene import Scene
from verification.studies import steps


def test_a_needle_to_and_fro_is_watched(gel: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(steps, "STEP", 0.05)
    table = steps.stepped(gel, "newmark", 250)
    assert [row[0] for row in table.rows] == [1, 2, 3, 4]
    assert [row[1] for row in table.rows] == sorted(row[1] for row in table.rows)
    assert min(row[2] for row in table.rows) > 0.0
    assert table.rows[-1][5] > 0
    assert "energy residual" in table.note
