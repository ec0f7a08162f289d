"""The renderer, the style of all pictures, and their files.

A missing or faulty OpenGL driver can terminate a process. Therefore the renderer is first tried in
a separate process. PyVista is imported only when a picture is drawn.
"""

import dataclasses
import io
import os
import subprocess
import sys
from collections.abc import Iterable, Iterator, Mapping, MutableMapping, Sequence
from functools import cache
from importlib.util import find_spec
from itertools import chain
from pathlib import Path
from types import ModuleType
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from needlefem._arrays import Floats, Ints
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


def force_unit(dim: int) -> str:
    """Return the unit of forces in words: those of plane strain are per metre of thickness."""
    return "N" if dim == 3 else "N per m of thickness"


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


# Texts and rectangles in pixels over a panel.


GLYPH = 0.6
"""Approximate width of a letter relative to the text size; long texts are drawn smaller."""


class _TextStyle(Protocol):
    """A `pyvista.TextProperty`."""

    color: str
    justification_horizontal: str
    justification_vertical: str
    orientation: float
    font_size: int


class _TextActor(Protocol):
    """A `pyvista.Text`."""

    prop: _TextStyle
    input: str
    position: tuple[float, float]

    def SetLayerNumber(self, number: int) -> None: ...  # noqa: N802  (VTK's name)


class Sheet:
    """Drawing in pixel coordinates from the lower left corner; later objects cover earlier ones.

    Parameters
    ----------
    plotter : pyvista.Plotter
        A plotter whose active subplot is this panel.
    style : Style
    """

    def __init__(self, plotter: Plotter, style: Style) -> None:
        self.plotter, self.style = plotter, style
        self.renderer = plotter.renderer
        self.wide, self.high = (float(n) for n in self.renderer.GetSize())
        least = float(style.smallest_text)
        self.text = max(style.text_size * min(self.high, 0.8 * self.wide), least)
        """Size of texts, pixels."""
        self._texts: dict[str, _TextActor] = {}

    def colour(self, name: str) -> Floats:
        """Return a colour as red, green, blue, 0 to 1."""
        found: Floats = np.array(renderer().Color(name).float_rgb)
        return found

    def width(self, text: str) -> float:
        """Return the approximate width of a text, pixels."""
        return GLYPH * self.text * len(text)

    def write(
        self,
        name: str,
        text: str,
        at: Sequence[float],
        room: float,
        *,
        justify: str = "left",
        upward: bool = False,
    ) -> None:
        """Draw a text, or replace it; it is drawn smaller if it is longer than `room` pixels."""
        size = min(self.text, room / (GLYPH * max(len(text), 1)))
        actor = self._texts.get(name)
        if actor is None:
            actor = self._texts[name] = renderer().Text(text)
            actor.prop.color = self.style.text
            actor.prop.justification_horizontal = justify
            actor.prop.justification_vertical = "bottom"
            actor.prop.orientation = 90.0 if upward else 0.0
            actor.SetLayerNumber(1)
            self.renderer.add_actor(actor, reset_camera=False, render=False)
        actor.input = text
        actor.prop.font_size = max(round(size), 1)
        actor.position = (float(at[0]), float(at[1]))

    def rectangles(self, corners: Floats, colours: Floats) -> None:
        """Draw rectangles, shape (n, 4): left, bottom, right, top; colours (n, 3), 0 to 1."""
        x0, y0, x1, y1 = corners.T
        ring = np.stack([x0, y0, x1, y0, x1, y1, x0, y1], axis=1).reshape(-1, 2)
        self._draw(ring, np.arange(len(ring)).reshape(-1, 4), colours)

    def _draw(self, points: Floats, polygons: Ints, colours: Floats) -> None:
        """Draw convex polygons with corners of shape (n, k) among points, shape (npoints, 2)."""
        from vtkmodules.vtkRenderingCore import (  # noqa: PLC0415
            vtkActor2D,
            vtkPolyDataMapper2D,
        )

        faces = np.column_stack([np.full(len(polygons), polygons.shape[1]), polygons]).ravel()
        data = renderer().PolyData(np.column_stack([points, np.zeros(len(points))]), faces=faces)
        data.cell_data["colours"] = np.round(255.0 * colours).astype(np.uint8)
        data.set_active_scalars("colours", preference="cell")
        mapper, actor = vtkPolyDataMapper2D(), vtkActor2D()
        mapper.SetInputData(data)
        actor.SetMapper(mapper)
        self.renderer.AddViewProp(actor)


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
