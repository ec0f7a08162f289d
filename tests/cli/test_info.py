import json
import platform

import numpy as np
import pytest

import needlefem
from needlefem.cli.main import main
from needlefem.plotting import images as backend


def test_info_in_two_lines_and_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["info"]) == 0
    first, second = capsys.readouterr().out.splitlines()
    assert first.startswith(
        f"needlefem {needlefem.__version__}, Python {platform.python_version()}"
    )
    assert f"numpy {np.__version__}" in first
    assert "cores" in second
    assert "pictures by vtk" in second
    assert main(["info", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["packages"]["numpy"] == np.__version__
    assert record["renderer"]["problem"] is None
    assert record["threads"]["OPENBLAS_NUM_THREADS"] == "1"


def test_info_where_nothing_draws(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(backend, "WINDOWS", ())
    backend.renderer.cache_clear()
    assert main(["info"]) == 0
    backend.renderer.cache_clear()
    assert "no picture can be drawn" in capsys.readouterr().out
