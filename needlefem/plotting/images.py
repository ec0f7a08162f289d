"""Pictures and animations as files."""

import io
from collections.abc import Iterable, Iterator
from importlib.util import find_spec
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from needlefem._progress import doing
from needlefem.errors import CaseError, NoRendererError
from needlefem.io.result_folder import whole_file

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
