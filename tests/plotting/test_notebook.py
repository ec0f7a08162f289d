import struct
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from needlefem import _register_formatters, plan, simulate
from needlefem.insertion import Insertion
from needlefem.io import SavedResult
from needlefem.planning import Plan
from needlefem.plotting import html_of, png_of
from needlefem.plotting import images as backend
from needlefem.plotting.notebook import SIZE
from needlefem.scene import Scene, vary


def test_a_plan_shows_itself(gel: Scene) -> None:
    found = plan(vary(gel, {"title": "<gel>"}))
    html = html_of(found)
    assert found.best is not None
    release = ", ".join(f"{100 * x:.3f}" for x in found.best.release_point)
    assert f"(y, z) = ({release}) cm" in html
    assert "planned" in html
    assert "&lt;gel&gt;" in html
    picture = png_of(found)
    assert picture is not None
    assert struct.unpack(">II", picture[16:24]) == SIZE


def test_a_scene_and_a_result_show_themselves(gel: Scene, tmp_path: Path) -> None:
    html = html_of(gel)
    assert "(y, z) = (2.870, 2.000) cm" in html
    assert "cuts at 50 N per m of thickness" in html
    picture = png_of(gel)
    assert picture is not None
    assert struct.unpack(">II", picture[16:24]) == SIZE
    record = {"status": "completed", "sentence": "reached <3> cm"}
    path = tmp_path / "run.json"
    found = SavedResult(kind="run", path=path, record=record, tables={}, snapshots=())
    assert "reached &lt;3&gt; cm" in html_of(found)
    assert png_of(found) is None


def test_a_shell_gets_formatters_for_what_it_shows(gel: Scene) -> None:
    registered: dict[str, dict[tuple[str, str], Any]] = {"text/html": {}, "image/png": {}}
    kinds = {
        kind: SimpleNamespace(
            for_type_by_name=lambda module, name, show, found=found: found.update(
                {(module, name): show}
            )
        )
        for kind, found in registered.items()
    }
    _register_formatters(SimpleNamespace(display_formatter=SimpleNamespace(formatters=kinds)))
    for shown in (Scene, Insertion, Plan, SavedResult):
        assert (shown.__module__, shown.__name__) in registered["text/html"]
    show = registered["text/html"][Scene.__module__, "Scene"]
    assert show(gel) == html_of(gel)
    assert registered["image/png"].keys() == registered["text/html"].keys()


def test_without_a_driver_there_is_a_table(gel: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    insertion = simulate(gel)
    monkeypatch.setattr(backend, "WINDOWS", ())
    backend.renderer.cache_clear()
    assert png_of(insertion) is None
    backend.renderer.cache_clear()
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
