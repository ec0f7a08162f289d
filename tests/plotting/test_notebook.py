import struct
import subprocess
import sys
from pathlib import Path

import pytest

from needlefem.insertion.simulation import simulate
from needlefem.io.saved_result import SavedResult
from needlefem.planning.plan import plan
from needlefem.plotting import backend as driver
from needlefem.plotting.notebook import SIZE, html_of, png_of
from needlefem.scene import Scene, vary


def test_a_plan_shows_itself(gel: Scene) -> None:
    found = plan(vary(gel, {"title": "<gel>"}))
    html = found._repr_html_()
    assert found.best is not None
    release = ", ".join(f"{100 * x:.3f}" for x in found.best.release_point)
    assert f"(y, z) = ({release}) cm" in html
    assert "planned" in html
    assert "&lt;gel&gt;" in html
    picture = found._repr_png_()
    assert picture is not None
    assert struct.unpack(">II", picture[16:24]) == SIZE


def test_a_scene_and_a_result_show_themselves(gel: Scene, tmp_path: Path) -> None:
    html = gel._repr_html_()
    assert "(y, z) = (2.870, 2.000) cm" in html
    assert "cuts at 50 N/m" in html
    picture = gel._repr_png_()
    assert picture is not None
    assert struct.unpack(">II", picture[16:24]) == SIZE
    record = {"status": "completed", "sentence": "reached <3> cm"}
    path = tmp_path / "run.json"
    found = SavedResult(kind="run", path=path, record=record, tables={}, snapshots=())
    assert "reached &lt;3&gt; cm" in found._repr_html_()
    assert found._repr_png_() is None


def test_without_a_driver_there_is_a_table(gel: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    insertion = simulate(gel)
    monkeypatch.setattr(driver, "WINDOWS", ())
    driver.renderer.cache_clear()
    assert png_of(insertion) is None
    driver.renderer.cache_clear()
    html = html_of(insertion)
    assert "completed" in html
    assert f"{100 * insertion.depths[-1]:.3f} cm" in html


def test_a_table_imports_no_pictures() -> None:
    code = (
        "import sys, needlefem\n"
        "needlefem.plan, needlefem.load_result\n"
        "import needlefem.plotting.notebook\n"
        "print(sorted({'pyvista', 'vtk', 'meshio'} & set(sys.modules)))"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"
