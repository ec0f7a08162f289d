"""The renderer, the style of all pictures, and their files.

A missing or faulty OpenGL driver can terminate a process. Therefore the renderer is first tried in
a separate process. PyVista is imported only when a picture is drawn.
"""

import dataclasses
import io
import os
import subprocess
import sys
from collections.abc import Iterable, Iterator, Mapping, MutableMapping
from functools import cache
from importlib.util import find_spec
from itertools import chain
from pathlib import Path
from types import ModuleType
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from needlefem._arrays import Floats
from needlefem._progress import doing
from needlefem.errors import CaseError, NoRendererError
from needlefem.io.result_folder import whole_file

PACKAGES = "libegl1 libgl1 libgl1-mesa-dri libxrender1"
"""Debian packages of the software renderer and of the libraries that VTK loads."""
WINDOWS = ("vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow")
"""VTK window classes that need no display: that of the driver, and Mesa's in memory."""
_TRIAL = (
    "import pyvista as pv; p = pv.Plotter(off_screen=True, window_size=(32, 32));"
    "p.add_mesh(pv.Plane(), color='red'); assert p.screenshot(return_img=True).std() > 1"
)


@cache
def renderer() -> ModuleType:
    """Return the pyvista module after a test that it can draw without a display.

    Raises
    ------
    NoRendererError
        pyvista is not installed, or no OpenGL driver works; the message names the packages.
    """
    if find_spec("pyvista") is None:
        raise NoRendererError("pictures need pyvista: pip install 'needlefem[render]'")
    working = next((window for window in WINDOWS if _draws(window)), None)
    if working is None:
        raise NoRendererError(
            "no picture can be drawn: VTK finds no OpenGL driver; "
            f"install one (Debian: apt-get install {PACKAGES})"
        )
    os.environ["VTK_DEFAULT_OPENGL_WINDOW"] = working
    import pyvista  # noqa: PLC0415  (the import takes a second and only pictures need it)

    return pyvista


def _draws(window: str) -> bool:
    """Return whether a window class can draw a small picture, tested in a separate process."""
    environment = os.environ | {"VTK_DEFAULT_OPENGL_WINDOW": window}
    command = [sys.executable, "-c", _TRIAL]
    try:
        trial = subprocess.run(
            command, env=environment, capture_output=True, timeout=120, check=False
        )
    except subprocess.TimeoutExpired:
        return False
    return trial.returncode == 0


# The style of all pictures.


@dataclasses.dataclass(frozen=True, kw_only=True)
class Style:
    """Colours and sizes in all pictures; suitable for colour-blind readers (Okabe and Ito).

    Widths are in pixels, `text_size` is relative to the smaller side of a panel. The colour map
    is a perceptually uniform one of matplotlib.
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


# What the pictures use of PyVista, which is imported only when a picture is drawn.


Image = NDArray[np.uint8]
"""Shape (height, width, 3)."""
Place = tuple[float, float, float]


class PolyData(Protocol):
    """A mesh of PyVista: points, shape (n, 3), with values of points and of cells."""

    points: Floats
    active_texture_coordinates: Floats

    @property
    def point_data(self) -> MutableMapping[str, Floats]:
        """Values by name, shape (npoints,)."""
        ...

    @property
    def cell_data(self) -> MutableMapping[str, NDArray[np.generic]]:
        """Values or colours by name, shape (ncells,) or (ncells, 3)."""
        ...


class Camera(Protocol):
    """A `pyvista.Camera` with parallel projection."""

    parallel_projection: bool
    parallel_scale: float
    focal_point: Place
    position: Place
    up: Place


class PanelRenderer(Protocol):
    """A `pyvista.Renderer`, which draws one panel of a plotter."""

    def GetSize(self) -> tuple[int, int]:  # noqa: N802  (VTK's name)
        """Return width and height, pixels."""
        ...

    def ResetCameraClippingRange(self) -> None:  # noqa: N802
        """Show all objects, however far from the camera."""
        ...

    def AddViewProp(self, actor: object) -> None:  # noqa: N802
        """Add an object of VTK."""
        ...

    def add_actor(self, actor: object, *, reset_camera: bool, render: bool) -> object:
        """Add an object of PyVista."""
        ...


class Plotter(Protocol):
    """A `pyvista.Plotter`."""

    @property
    def renderer(self) -> PanelRenderer:
        """Renderer of the active panel."""
        ...

    @property
    def camera(self) -> Camera:
        """Camera of the active panel."""
        ...

    @property
    def actors(self) -> Mapping[str, object]:
        """Objects in the active panel, by name."""
        ...

    def subplot(self, row: int, column: int, /) -> None:
        """Make a panel the active one."""
        ...

    def add_mesh(self, mesh: PolyData, /, **options: object) -> object:
        """Draw a mesh in the active panel."""
        ...

    def render(self) -> None:
        """Draw all panels."""
        ...

    def screenshot(self, filename: Path | None = None, *, return_img: bool = True) -> Image:
        """Return the picture, and write it if there is a name."""
        ...

    def close(self) -> None:
        """Free the window."""
        ...


# Files of pictures and animations.


STILLS = (".png", ".webp", ".jpg")
MOVING = (".gif", ".webp", ".mp4")
UNSEEN = 5
"""Change of a pixel's value (of 255) that is invisible and may be lost in a PNG file."""
QUALITY = 82
"""Quality of WebP and JPEG files."""


def save(plotter: Plotter, path: Path) -> Path:
    """Save a plotter's picture in a file of one of the kinds `STILLS`, and close the plotter."""
    doing(f"drawing {path.name!a}")
    image = plotter.screenshot(return_img=True)
    plotter.close()
    return save_still(image, path)


def save_still(image: Image, path: Path) -> Path:
    """Write an image in the format of the file's name. PNG uses a palette if no colour is lost.

    Raises
    ------
    CaseError
        The suffix is not that of a picture format.
    """
    from PIL import Image as Pillow  # noqa: PLC0415  (comes with the pictures)

    require_kind(path, STILLS)
    shown = Pillow.fromarray(image)
    if path.suffix == ".png":  # a palette halves the size of the file
        cover = Pillow.Quantize.MAXCOVERAGE
        few = shown.quantize(256, method=cover, dither=Pillow.Dither.NONE)
        lost = np.abs(np.asarray(few.convert("RGB"), dtype=int) - image).max()
        shown = few if lost <= UNSEEN else shown
    with whole_file(path) as part:
        shown.save(part, quality=QUALITY, optimize=True)
    return path


def _counted(frames: Iterable[Image], what: str) -> Iterator[Image]:
    """Yield frames and report the number of frames so far."""
    for number, frame in enumerate(frames, 1):
        doing(f"{what}, frame {number}")
        yield frame


def save_moving(frames: Iterable[Image], path: Path, rate: float) -> Path:
    """Write frames one at a time; only GIF and WebP files need all frames in memory.

    Parameters
    ----------
    frames : iterable of images
    path : Path
        With the suffix .gif, .webp or .mp4.
    rate : float, 1/s
        Frames per second.

    Raises
    ------
    CaseError
        The suffix is not that of an animation format.
    NoRendererError
        MP4 without the extra `video`.
    """
    require_kind(path, MOVING)
    writer = _write_video if path.suffix == ".mp4" else _write_pillow
    with whole_file(path) as part:
        writer(_counted(frames, f"drawing {path.name!a}"), part, rate)
    return path


def require_kind(path: Path, kinds: tuple[str, ...]) -> None:
    """Raise a `CaseError` if the suffix of a file is none of the given ones."""
    if path.suffix not in kinds:
        options = ", ".join(kinds)
        raise CaseError("--out", f"'{path.name}' is not a picture of this kind", f"use {options}")


def _write_pillow(frames: Iterator[Image], path: Path, rate: float) -> None:
    from PIL import Image as Pillow  # noqa: PLC0415

    first = Pillow.fromarray(next(frames))
    how: dict[str, object] = {"quality": 60, "method": 4, "minimize_size": False}
    rest: Iterator[Pillow.Image] = (Pillow.fromarray(frame) for frame in frames)
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
