import csv
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv

import needlefem as nf
from needlefem.cli.main import main
from needlefem.errors import CaseError
from tests.conftest import PAPER_CASE

COUNTS = {"tip", "event", "name", "slip", "sticking pieces", "slipping forward",
          "slipping backward"}  # fmt: skip
"""Columns that are words or counts; all others are measures, whose unit the header names."""


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    small = ["--set", "mesh.divisions=[16, 16]", "--set", "needle.tip_radius=2 mm"]
    wanted = ["--no-pictures", "--snapshots", "3", "--out", str(folder)]
    assert main(["run", str(PAPER_CASE), *wanted, *small]) == 0
    return folder


def test_what_run_wrote_is_read_again(written: Path) -> None:
    found = nf.load_result(written)
    assert (found.kind, found["status"], found.frame) == ("run", "completed", None)
    table = found.tables["insertion"]
    assert table["depth [m]"] == pytest.approx(found.points("depth"), rel=1e-8)
    tips = np.stack([table["y [m]"], table["z [m]"]], axis=1)
    assert tips == pytest.approx(found.points("tip_path"), abs=1e-9)
    assert list(table["tip"]) == found["tip_phase"]
    assert nf.load_result(written / "run.json").record == found.record


def test_snapshots_open_in_pyvista_in_order_of_time(written: Path) -> None:
    """Vectors of three components, names relative to the PVD file, SI units."""
    found = nf.load_result(written)
    reader = pv.get_reader(written / "insertion.pvd")
    last = found.tables["insertion"]["time [s]"][-1]
    assert reader.time_values == pytest.approx([0.0, 0.5 * last, last])
    assert [time for time, _ in found.snapshots] == pytest.approx(reader.time_values)
    assert 'file="insertion/0000.vtu"' in (written / "insertion.pvd").read_text()
    reader.set_active_time_value(reader.time_values[-1])
    grid = reader.read()[0]
    assert grid.bounds[4:] == (0.0, 0.0)
    assert grid.point_data["displacement"].shape == (grid.n_points, 3)
    moved = np.linalg.norm(grid.point_data["displacement"], axis=1).max()
    assert 2e-3 < moved < 2e-2
    assert set(grid.cell_data["material"]) == {0, 1}
    assert grid.cell_data["largest_strain"].max() == pytest.approx(
        found["validity"]["largest_strain"], rel=0.5
    )
    objects = reader.read()[1]
    assert set(objects.cell_data["object"]) >= {0, 1}
    tip = found.points("entry") + np.array([0.0, found["depth"][-1]])
    assert objects.points[1, :2] == pytest.approx(tip, abs=1e-9)  # the needle ends at its tip


def test_headers_name_units(written: Path) -> None:
    for path in written.glob("*.csv"):
        with path.open(newline="") as file:
            header = next(csv.reader(file))
        assert all("[" in name or name in COUNTS for name in header), path.name


def test_a_series_lists_its_snapshots(tmp_path: Path) -> None:
    from tests.io.test_series import run

    run(tmp_path, every=5)
    found = nf.load_result(tmp_path)
    assert found.kind == "motion"
    assert [time for time, _ in found.snapshots] == pytest.approx([0.5, 1.0])
    assert all(path.is_file() for _, path in found.snapshots)


def test_what_is_no_result(tmp_path: Path) -> None:
    with pytest.raises(CaseError, match=r"result: there is none at .*; give the folder of --out"):
        nf.load_result(tmp_path)
    (tmp_path / "run.json").write_text("{")
    with pytest.raises(CaseError, match=r"result: '.*run.json' can't be read"):
        nf.load_result(tmp_path)
    (tmp_path / "run.json").write_text("[]")
    with pytest.raises(CaseError, match="holds no object"):
        nf.load_result(tmp_path)
