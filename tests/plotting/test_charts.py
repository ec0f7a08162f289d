"""Charts: the numbers drawn, the kinds of files, and what is said without matplotlib."""

from pathlib import Path

import numpy as np
import pytest

from needlefem.errors import CaseError, NoRendererError
from needlefem.insertion import Insertion
from needlefem.plotting import Bar, ChartLine, bars, charts, draw_forces, draw_sticking, loglog

STARTS = {".png": b"\x89PNG", ".pdf": b"%PDF", ".svg": b"<?xml"}


@pytest.mark.parametrize("kind", STARTS)
def test_equal_charts_are_equal_files_of_the_kind_of_the_suffix(
    kind: str, pushed: Insertion, tmp_path: Path
) -> None:
    files = [draw_forces(pushed, tmp_path / f"{name}{kind}").read_bytes() for name in "ab"]
    assert files[0].startswith(STARTS[kind])
    assert files[0] == files[1]
    assert b"Date" not in files[0]


def test_the_forces_drawn_are_those_of_the_states(pushed: Insertion) -> None:
    (axes,) = charts.force_figure(pushed).axes
    lines = {str(line.get_label()): line for line in axes.get_lines()}
    depths = [100.0 * state.depth for state in pushed.states]
    np.testing.assert_array_equal(lines["tip and shaft"].get_xdata(), depths)
    for name, forces in {"tip and shaft": [s.force for s in pushed.states],
                         "tip": [s.tip_force for s in pushed.states]}.items():  # fmt: skip
        np.testing.assert_array_equal(lines[name].get_ydata(), forces)
    assert axes.get_ylabel() == "force (N per m of thickness)"
    for name, kind in {"puncture": "puncture", "release": "release"}.items():
        (event,) = [event for event in pushed.events if event.kind == kind]
        assert lines[name].get_xdata() == pytest.approx([100.0 * event.depth])
    arrows = [text.xy[0] - text.xyann[0] for text in axes.texts]
    assert [a > 0.0 for a in arrows] == [True, False]  # forward, then back


def test_other_kinds_are_refused(pushed: Insertion, tmp_path: Path) -> None:
    with pytest.raises(CaseError, match=r"use \.png, \.pdf, \.svg"):
        draw_sticking(pushed, tmp_path / "chart.bmp")
    assert list(tmp_path.iterdir()) == []


def test_without_matplotlib_the_extra_is_named(
    pushed: Insertion, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(charts, "find_spec", lambda _: None)
    with pytest.raises(NoRendererError, match="pip install 'needlefem\\[render\\]'"):
        draw_forces(pushed, tmp_path / "chart.png")
    line = ChartLine("line", (10, 20), (1e-2, 1e-3))
    for text in (bars("t", "ms", [Bar("one", 1.0)]), loglog("t", "x", "y", [line])):
        assert text.startswith("<p>No chart: charts need matplotlib")


def test_exact_answers_have_no_place_on_logarithmic_axes() -> None:
    exact = ChartLine("exact", (10, 20), (0.0, 0.0))
    assert loglog("t", "x", "y", [exact]) == ""
    drawn = loglog("t", "x", "y", [exact, ChartLine("other", (10, 20), (1e-2, 1e-3))], [-2.0])
    assert ">other<" in drawn
    assert ">slope -2<" in drawn
    assert "exact" not in drawn


def test_bars_are_as_long_as_their_values() -> None:
    rows = [Bar("one", 1.0), Bar("ten", 10.0, 5.0, 20.0, series=1)]
    (axes,) = charts.bar_figure("t", "ms", rows).axes
    assert [bar.get_width() for bar in axes.patches] == [1.0, 10.0]
    assert axes.get_xscale() == "log"
    (whiskers,) = [lines for lines in axes.collections if len(lines.get_segments())]
    np.testing.assert_allclose(whiskers.get_segments(), [[[5.0, 1.0], [20.0, 1.0]]])
    drawn = bars("t", "ms", [*rows, Bar("no", 0.0)])
    assert ">ten<" in drawn
    assert ">no<" not in drawn
    assert bars("t", "ms", [Bar("no", 0.0)]) == ""
