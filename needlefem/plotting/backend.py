"""PyVista, imported late and only where it can draw.

A missing or broken OpenGL driver can kill a process outright, so that it is tried in one of its
own first.
"""

import os
import subprocess
import sys
from functools import cache
from importlib.util import find_spec
from typing import Any

from needlefem.errors import NoRendererError

PACKAGES = "libegl1 libgl1 libgl1-mesa-dri libxrender1"
"""What Debian and its kin call the software renderer and the libraries that VTK opens."""
WINDOWS = ("vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow")
"""Kinds of VTK windows that need no display: the driver's, and Mesa's in memory."""
_TRIAL = (
    "import pyvista as pv; p = pv.Plotter(off_screen=True, window_size=(32, 32));"
    "p.add_mesh(pv.Plane(), color='red'); assert p.screenshot(return_img=True).std() > 1"
)


@cache
def renderer() -> Any:
    """Return the pyvista module, ready to draw without a display.

    Raises
    ------
    NoRendererError
        pyvista is not installed, or nothing here can draw; the message names the packages.
    """
    if find_spec("pyvista") is None:
        raise NoRendererError("pictures need pyvista: pip install 'needlefem[render]'")
    working = next((window for window in WINDOWS if _draws(window)), None)
    if working is None:
        raise NoRendererError(
            "no picture can be drawn here: VTK finds no OpenGL driver; "
            f"install one (Debian: apt-get install {PACKAGES})"
        )
    os.environ["VTK_DEFAULT_OPENGL_WINDOW"] = working
    import pyvista  # noqa: PLC0415  (takes a second: only pictures pay for it)

    return pyvista


def _draws(window: str) -> bool:
    """Say whether a small picture can be drawn with a kind of window, in a process of its own."""
    environment = os.environ | {"VTK_DEFAULT_OPENGL_WINDOW": window}
    command = [sys.executable, "-c", _TRIAL]
    try:
        trial = subprocess.run(
            command, env=environment, capture_output=True, timeout=120, check=False
        )
    except subprocess.TimeoutExpired:
        return False
    return trial.returncode == 0
