"""PyVista, imported late and only where it can draw.

A missing or broken OpenGL driver can kill a process outright, so that it is tried in one of its
own first.
"""

import dataclasses
import io
import os
import subprocess
import sys
from collections.abc import Iterable, Iterator
from functools import cache
from importlib.util import find_spec
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from needlefem._progress import doing
from needlefem.errors import CaseError, NoRendererError
from needlefem.io.result_folder import whole_file

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


# How everything in pictures looks.


@dataclasses.dataclass(frozen=True, kw_only=True)
class Style:
    """How everything looks; colours are safe for the colour-blind (Okabe and Ito).

    Widths are in pixels, `text_size` over the smaller side of a panel. The colour map is one of
    matplotlib's perceptually uniform ones.
    """

    background: str = "white"
    tissue: tuple[str, ...] = ("#f4e7c5", "#e3b5a4", "#c9d5e8", "#cfe3cf", "#dcc9e6", "#d2c6ae")
    mesh: str = "#8a7f6a"
    outline: str = "#5b3a29"
    on_image: str = "#f0e442"
    on_field: str = "white"
    needle: str = "#20262e"
    seed: str = "#0072B2"
    target: str = "#D55E00"
    path: str = "#009E73"
    obstacle: str = "#8c8f94"
    support: str = "#56606b"
    folded: str = "#D55E00"
    text: str = "#202020"
    grid: str = "#e4e4e4"
    colour_map: str = "viridis"
    mesh_width: float = 0.6
    outline_width: float = 3.0
    path_width: float = 3.0
    text_size: float = 0.034
    smallest_text: int = 9


# Pictures and animations as files.


Image = NDArray[np.uint8]
"""Shape (height, width, 3)."""
STILLS = (".png", ".webp", ".jpg")
MOVING = (".gif", ".webp", ".mp4")
UNSEEN = 5
"""Change of a pixel (of 255) that nobody sees: a PNG may lose it."""
QUALITY = 82
"""Of WebP and JPEG."""


def save(plotter: Any, path: Path) -> Path:
    """Draw what a plotter holds into a file of one of the kinds `STILLS`, and close it."""
    doing(f"drawing {path.name!a}")
    image = plotter.screenshot(return_img=True)
    plotter.close()
    return save_still(image, path)


def save_still(image: Image, path: Path) -> Path:
    """Write an image; the file's name says how. PNG gets a palette where no colour is lost.

    Raises
    ------
    CaseError
        No kind of picture has such a name.
    """
    from PIL import Image as Pillow  # noqa: PLC0415  (comes with the pictures)

    require_kind(path, STILLS)
    shown = Pillow.fromarray(image)
    if path.suffix == ".png":  # a palette halves the file
        cover = Pillow.Quantize.MAXCOVERAGE
        few = shown.quantize(256, method=cover, dither=Pillow.Dither.NONE)
        lost = np.abs(np.asarray(few.convert("RGB"), dtype=int) - image).max()
        shown = few if lost <= UNSEEN else shown
    with whole_file(path) as part:
        shown.save(part, quality=QUALITY, optimize=True)
    return path


def _counted(frames: Iterable[Image], what: str) -> Iterator[Image]:
    """Yield frames, and tell how many there are so far."""
    for number, frame in enumerate(frames, 1):
        doing(f"{what}, frame {number}")
        yield frame


def save_moving(frames: Iterable[Image], path: Path, rate: float) -> Path:
    """Write frames as they come; memory does not grow with their number but for GIF and WebP.

    Parameters
    ----------
    frames : iterable of images
    path : Path
        Ends in .gif, .webp or .mp4.
    rate : float, 1/s
        Frames a second.

    Raises
    ------
    CaseError
        No kind of animation has such a name.
    NoRendererError
        MP4 without the extra `video`.
    """
    require_kind(path, MOVING)
    writer = _write_video if path.suffix == ".mp4" else _write_pillow
    with whole_file(path) as part:
        writer(_counted(frames, f"drawing {path.name!a}"), part, rate)
    return path


def require_kind(path: Path, kinds: tuple[str, ...]) -> None:
    """Raise a `CaseError` where a file's name ends in none of some kinds."""
    if path.suffix not in kinds:
        options = ", ".join(kinds)
        raise CaseError("--out", f"'{path.name}' is no picture of this kind", f"use {options}")


def _write_pillow(frames: Iterator[Image], path: Path, rate: float) -> None:
    from PIL import Image as Pillow  # noqa: PLC0415

    first = Pillow.fromarray(next(frames))
    how: dict[str, Any] = {"quality": 60, "method": 4, "minimize_size": False}
    rest: Iterator[Any] = (Pillow.fromarray(frame) for frame in frames)
    if path.suffix == ".gif":
        first = first.quantize(128, dither=Pillow.Dither.NONE)
        rest = (image.quantize(palette=first, dither=Pillow.Dither.NONE) for image in rest)
        how = {"optimize": False, "disposal": 1}
    written = io.BytesIO()
    first.save(written, format=path.suffix[1:].upper(), save_all=True, append_images=rest,
               duration=round(1000.0 / rate), loop=0, **how)  # fmt: skip
    path.write_bytes(written.getvalue())


def _write_video(frames: Iterator[Image], path: Path, rate: float) -> None:
    if find_spec("imageio_ffmpeg") is None:
        raise NoRendererError("MP4 needs imageio-ffmpeg: pip install 'needlefem[video]'")
    from imageio_ffmpeg import write_frames  # noqa: PLC0415

    first = next(frames)
    high, wide = (n - n % 2 for n in first.shape[:2])
    video = write_frames(str(path), (wide, high), fps=rate, macro_block_size=2, quality=7)
    video.send(None)
    for frame in chain([first], frames):
        video.send(np.ascontiguousarray(frame[:high, :wide]))
    video.close()
