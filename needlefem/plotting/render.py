"""Pictures and animations of insertions, and VTU files for ParaView and PyVista."""

import dataclasses
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from needlefem._arrays import Floats, Points
from needlefem.elements import MIXED
from needlefem.fem.recovery import CellFields
from needlefem.insertion.result import Insertion
from needlefem.io.result_folder import ours, result_folder, writing
from needlefem.io.vtu import write_objects, write_pvd, write_vtu
from needlefem.materials.voigt import tensor
from needlefem.plotting.images import (
    Image,
    Plotter,
    Style,
    renderer,
    save,
    save_moving,
    save_still,
)
from needlefem.plotting.panel import Texture, read_texture, synthetic_ultrasound
from needlefem.plotting.timeline import Frame, Timeline
from needlefem.plotting.view import View, ViewOptions, quantity, scale_of
from needlefem.scene.limits import check_count

DIGITS = 4
"""Digits of the numbers in file names."""
OBJECTS = ("needle", "path", "seed", "target")
"""The numbers 0, 1, 2, 3 of the objects in a snapshot."""


def write_snapshots(insertion: Insertion, folder: str | Path, count: int) -> Path:
    """Write VTU files at equal intervals of time; return the PVD file that lists them.

    ``insertion.pvd`` lists the files ``insertion/0000.vtu`` etc. with relative paths. Each file
    contains ``displacement`` (m) of the nodes, and for the cells ``largest_strain`` (1), the
    principal strain with the largest absolute value; ``stress`` (Pa), a tensor of nine components,
    and ``von_mises`` (Pa), where the element has an accurate stress; ``pressure`` (Pa) of a mixed
    element; ``material``, the number of the material, and ``material: NAME``, which is 1 in the
    cells of a material and 0 elsewhere. If the case has a plane in the scanner's space,
    ``scanner`` (m) is the position of the undeformed nodes there.

    ``insertion/0000-objects.vtu`` etc. contain lines and points in space, beside the deformed
    tissue, with the cell field ``object``, a number of `OBJECTS`.

    Parameters
    ----------
    insertion : Insertion
    folder : str or Path
    count : int
        Number of files, at least two.
    """
    film, model, folder = Timeline(insertion), insertion.model, Path(folder)
    values = CellFields(model)
    written, beside = [], []
    check_count(count, "snapshots", insertion.scene.limits)
    times = np.linspace(0.0, float(film.times[-1]), max(count, 2))
    with result_folder(folder, "run", "folder"):
        _remove_older(folder)
        for number, moment in enumerate(film.moments(times)):
            file = folder / "insertion" / f"{number:0{DIGITS}d}.vtu"
            nodes = {"displacement": model.nodal(moment.u)}
            if insertion.scene.frame is not None:
                nodes["scanner"] = insertion.scene.frame.to_scanner(model.nodes)
            write_vtu(file, model, nodes, _cell_data(insertion, values, moment.u))
            objects = file.with_name(f"{file.stem}-objects.vtu")
            write_objects(objects, _objects(insertion, moment))
            beside.append((moment.time, objects))
            written.append((moment.time, file))
        path = folder / "insertion.pvd"
        write_pvd(path, written, beside)
    return path


def _cell_data(
    insertion: Insertion, values: CellFields, u: Floats
) -> dict[str, NDArray[np.generic]]:
    """Return the fields of the cells in a snapshot; see `write_snapshots`."""
    scene, model = insertion.scene, insertion.model
    names = np.array([
        scene.regions[region].material if region in scene.regions else scene.default_material
        for region in model.materials
    ])  # fmt: skip
    cells: dict[str, NDArray[np.generic]] = {
        "largest_strain": values.largest_strain(u),
        "material": model.cell_materials.astype(np.int32),
    }
    for name in np.unique(names):
        cells[f"material: {name}"] = (names[model.cell_materials] == name).astype(np.int32)
    if values.has_stress:
        cells["stress"] = tensor(values.stress(u)).reshape(-1, 9)
        cells["von_mises"] = values.von_mises(u)
        if model.element.volume == MIXED:
            cells["pressure"] = values.pressure(u)
    return cells


def _objects(insertion: Insertion, moment: Frame) -> list[tuple[int, Points]]:
    """Return the numbers of `OBJECTS` and the points of what a frame shows, m."""
    axis, target = insertion.axis, insertion.scene.target
    length = 2.0 * float(np.ptp(axis.axial_coordinate(insertion.model.nodes)))
    needle = np.array([axis.tip_position(moment.depth - length), axis.tip_position(moment.depth)])
    found = {"needle": [needle], "path": [moment.path], "seed": list(moment.seeds[:, None])}
    found["target"] = [] if target is None else [np.array(target)[None]]
    return [
        (number, points)
        for number, name in enumerate(OBJECTS)
        for points in found[name]
        if len(points)
    ]


def _remove_older(folder: Path) -> None:
    """Remove the VTU files that the PVD file of an earlier call lists."""
    path = folder / "insertion.pvd"
    if path.is_file():
        with writing(folder):
            path.unlink()
            for file in ours(folder, "run"):
                if file.endswith(".vtu"):
                    (folder / file).unlink()


# Pictures of insertions: stills, panels and animations.


SYNTHETIC = "synthetic"
"""Name of the synthetic texture."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class RenderOptions:
    """Content and size of a picture.

    Parameters
    ----------
    field : str
        Quantity that is shown by colours; regions are shown if it is empty.
    texture : str
        An image file of the undeformed tissue, or ``synthetic``; no image if it is empty.
    size : (int, int)
        Width and height, pixels.
    style : Style
    """

    field: str = ""
    texture: str = ""
    size: tuple[int, int] = (1280, 720)
    style: Style = dataclasses.field(default_factory=Style)


def render(
    insertion: Insertion,
    path: str | Path,
    *,
    depth: float | None = None,
    time: float | None = None,
    beside: Insertion | None = None,
    shot: RenderOptions | None = None,
) -> Path:
    """Draw tissue, needle, path, seeds and target at one time into a file.

    Parameters
    ----------
    insertion : Insertion
    path : str or Path
        With the suffix .png, .webp or .jpg.
    depth : float, m, optional
        The first time at which the tip is at this depth is shown. The last state is shown if
        neither `depth` nor `time` is given.
    time : float, s, optional
    beside : Insertion, optional
        A second insertion on the right, at the same time or depth and with the same colour scale.
    shot : RenderOptions, optional

    Raises
    ------
    NoRendererError
        No renderer is available; the message states what to install.
    CaseError
        The element has no such field, the texture can't be read, or the suffix is unknown.
    """
    films = _films(insertion, beside)
    times = [_time(film, depth, time) for film in films]
    with Renderer(films, shot or RenderOptions(), scale_times=[[t] for t in times]) as studio:
        image = studio.picture([film.moments([t])[0] for film, t in zip(films, times, strict=True)])
    return save_still(image, Path(path))


def _time(film: Timeline, depth: float | None, time: float | None) -> float:
    if time is not None:
        return time
    return float(film.times[-1]) if depth is None else film.time_at(depth)


def _films(insertion: Insertion, beside: Insertion | None) -> list[Timeline]:
    return [Timeline(found) for found in (insertion, beside) if found is not None]


def animate(
    insertion: Insertion,
    path: str | Path,
    *,
    frames: int = 60,
    rate: float = 12.0,
    beside: Insertion | None = None,
    shot: RenderOptions | None = None,
) -> Path:
    """Draw an animation of the whole motion (.gif, .webp, or .mp4 with the extra `video`).

    The frames have equal intervals of time; the shorter of two motions remains in its last state.
    See `render` for the other parameters and the errors.
    """
    films = _films(insertion, beside)
    check_count(frames, "frames", insertion.scene.limits)
    times = frame_times(films, frames)
    with Renderer(films, shot or RenderOptions(), scale_times=[times] * len(films)) as studio:
        return save_moving(studio.pictures(times), Path(path), rate)


def frame_times(films: Sequence[Timeline], frames: int) -> Floats:
    """Return the times of frames, s, at equal intervals until the end of the longest motion."""
    return np.linspace(0.0, max(float(film.times[-1]) for film in films), max(frames, 2))


def panels(
    insertion: Insertion, path: str | Path, *, count: int = 6, shot: RenderOptions | None = None
) -> Path:
    """Draw states at equal intervals of time in one picture, side by side; see `render`."""
    shot, film = shot or RenderOptions(), Timeline(insertion)
    check_count(count, "panels", insertion.scene.limits)
    times = frame_times([film], count)
    across = min(3, len(times))
    down = -(-len(times) // across)
    size = (across * shot.size[0] // 2, down * shot.size[1] // 2)
    plotter = _plotter(shot, size, (down, across))
    look = looks([film], shot, [times])[0]
    for number, moment in enumerate(film.moments(times)):
        plotter.subplot(number // across, number % across)
        View(plotter, film, look, insertion.scene.title).show(moment)
    return save(plotter, Path(path))


class Renderer:
    """A plotter that draws all pictures of some insertions, side by side.

    Parameters
    ----------
    films : sequence of Timeline
    shot : RenderOptions
    scale_times : sequence of sequences, s
        Times of each insertion whose values the colour scale must cover.
    """

    def __init__(
        self,
        films: Sequence[Timeline],
        shot: RenderOptions,
        scale_times: Sequence[Sequence[float] | Floats],
    ) -> None:
        self.films = tuple(films)
        self.plotter = _plotter(shot, shot.size, (1, len(films)))
        self.views = []
        for number, (film, look) in enumerate(
            zip(films, looks(films, shot, scale_times), strict=True)
        ):
            self.plotter.subplot(0, number)
            self.views.append(View(self.plotter, film, look, film.insertion.scene.title))

    def __enter__(self) -> "Renderer":
        return self

    def __exit__(self, *_: object) -> None:
        self.plotter.close()

    def picture(self, moments: Sequence[Frame]) -> Image:
        """Return a picture of one frame of each insertion."""
        for view, moment in zip(self.views, moments, strict=True):
            view.show(moment)
        self.plotter.render()  # a screenshot without this call repeats the last picture
        image: Image = self.plotter.screenshot(return_img=True)
        return image

    def pictures(self, times: Sequence[float] | Floats) -> Iterator[Image]:
        """Yield a picture for each time."""
        for moments in zip(*(film.moments(times) for film in self.films), strict=True):
            yield self.picture(moments)


def looks(
    films: Sequence[Timeline], shot: RenderOptions, times: Sequence[Sequence[float] | Floats]
) -> list[ViewOptions]:
    """Return the view options of each insertion, all with the same scale."""
    if shot.texture:
        return [
            ViewOptions(texture=_texture(film, shot.texture), style=shot.style) for film in films
        ]
    if not shot.field:
        return [ViewOptions(style=shot.style) for _ in films]
    shown, values = quantity(shot.field), []
    for film, moments in zip(films, times, strict=True):
        cells = CellFields(film.model)
        values += [shown.of(cells, moment.u) for moment in film.moments(moments)]
    return [
        ViewOptions(field=shown, scale=scale_of(shown, values), style=shot.style) for _ in films
    ]


def _texture(film: Timeline, name: str) -> Texture:
    if name != SYNTHETIC:
        return read_texture(name)
    insertion = film.insertion
    return synthetic_ultrasound(insertion.scene, insertion.model, insertion.axis)


def _plotter(shot: RenderOptions, size: tuple[int, int], shape: tuple[int, int]) -> Plotter:
    plotter = renderer().Plotter(off_screen=True, shape=shape, window_size=list(size), border=False)
    plotter.set_background(shot.style.background)
    found: Plotter = plotter
    return found
