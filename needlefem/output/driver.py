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
_TRIAL = (
    "import pyvista as pv; p = pv.Plotter(off_screen=True, window_size=(32, 32));"
    "p.add_mesh(pv.Plane()); p.screenshot(return_img=True)"
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
    os.environ.pop("DISPLAY", None)  # off screen always: a display that can't be opened kills VTK
    trial = subprocess.run(
        [sys.executable, "-c", _TRIAL], capture_output=True, text=True, timeout=120, check=False
    )
    if trial.returncode != 0:
        raise NoRendererError(
            "no picture can be drawn here: VTK finds no OpenGL driver; "
            f"install one (Debian: apt-get install {PACKAGES})"
        )
    import pyvista  # noqa: PLC0415  (takes a second: only pictures pay for it)

    pyvista.global_theme.allow_empty_mesh = True
    return pyvista
