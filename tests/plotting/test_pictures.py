"""Pictures: drawn where a driver is, refused with a remedy where none is."""

import os
import struct
import subprocess
import sys
from pathlib import Path

import pytest

from needlefem import render, simulate
from needlefem.errors import NoRendererError
from needlefem.plotting import RenderOptions
from needlefem.plotting import images as backend
from needlefem.scene import Scene


def test_picture_of_an_insertion(gel: Scene, tmp_path: Path) -> None:
    path = render(simulate(gel), tmp_path / "deformed.png", shot=RenderOptions(size=(400, 300)))
    header = path.read_bytes()[:24]
    assert header[:8] == b"\x89PNG\r\n\x1a\n"
    assert struct.unpack(">II", header[16:24]) == (400, 300)


def test_picture_shows_tissue_needle_and_target(gel: Scene, tmp_path: Path) -> None:
    from PIL import Image

    with Image.open(render(simulate(gel), tmp_path / "deformed.png")) as picture:
        counts = {colour: n for n, colour in picture.convert("RGB").getcolors(10**6)}
    for colour in ((244, 231, 197), (32, 38, 46), (213, 94, 0), (255, 255, 255)):
        assert counts.get(colour, 0) > 100


def test_no_driver_is_an_error_with_the_packages(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(backend, "WINDOWS", ())
    backend.renderer.cache_clear()
    with pytest.raises(NoRendererError, match="apt-get install libegl1"):
        backend.renderer()
    backend.renderer.cache_clear()


def test_no_pyvista_is_an_error_with_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(backend, "find_spec", lambda _: None)
    backend.renderer.cache_clear()
    with pytest.raises(NoRendererError, match="pip install 'needlefem\\[render\\]'"):
        backend.renderer()
    backend.renderer.cache_clear()


def test_a_driver_that_kills_the_process_is_survived(tmp_path: Path) -> None:
    """A pyvista that dies by a signal stands in for a broken driver."""
    (tmp_path / "pyvista.py").write_text(
        "import os, signal\nos.kill(os.getpid(), signal.SIGSEGV)\n"
    )
    environment = os.environ | {"PYTHONPATH": str(tmp_path)}
    code = "from needlefem.plotting.images import renderer\nrenderer()"
    found = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False
    )
    assert found.returncode == 1
    assert "NoRendererError: no picture can be drawn" in found.stderr
