"""Cost of an animation relative to a minimal PyVista loop that renders the same frames."""

import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from needlefem import load_case, simulate
from needlefem._arrays import Floats
from needlefem.bench import in_turn, median
from needlefem.insertion import Insertion
from needlefem.plotting import (
    Image,
    Renderer,
    RenderOptions,
    Timeline,
    animate,
    frame_times,
    save_moving,
)
from needlefem.studies import Table

FRAMES = 60
SIZE = (1280, 720)
RATE = 12.0
ROUNDS = 3
MOST = 1.3
"""Largest ratio to the minimal loop."""
VARIANTS = ((), ("discretization.element=P2",), ("mesh.divisions=[84, 84]",))
"""Changes of the case: as it is, with curved edges, with ten times as many cells."""


class Bare:
    """Prepared meshes and plotter, with the points of each frame."""

    def __init__(self, film: Timeline, shot: RenderOptions) -> None:
        times = frame_times([film], FRAMES)
        studio = Renderer([film], shot, scale_times=[times])
        self._plotter = studio.plotter
        mappers: list[Any] = [
            getattr(actor, "mapper", None) for actor in self._plotter.actors.values()
        ]
        self._meshes = [mapper.dataset for mapper in mappers if hasattr(mapper, "dataset")]
        self._frames: list[list[tuple[Floats, Floats | None]]] = []
        for moment in film.moments(times):
            studio.views[0].show(moment)
            self._frames.append([(mesh.points.copy(), _scalars(mesh)) for mesh in self._meshes])

    def frames(self) -> Iterator[Image]:
        """Yield the frames of the minimal loop."""
        for frame in self._frames:
            for mesh, (points, scalars) in zip(self._meshes, frame, strict=True):
                mesh.points = points
                if scalars is not None:
                    mesh.point_data["field"] = scalars
            self._plotter.render()
            yield self._plotter.screenshot(return_img=True)

    def close(self) -> None:
        """Close the window."""
        self._plotter.close()


def _scalars(mesh: Any) -> Floats | None:
    return mesh.point_data["field"].copy() if "field" in mesh.point_data else None


def run(case: str) -> Table:
    """Time whole animations of a case's insertion as GIF against bare loops."""
    rows: list[list[object]] = []
    worst = 0.0
    for overrides in VARIANTS:
        insertion = simulate(load_case(case, overrides))
        element = insertion.model.element.name
        with tempfile.TemporaryDirectory() as folder:
            for field in ("", "displacement"):
                ours, bare = _times(
                    insertion, RenderOptions(field=field, size=SIZE), Path(folder) / "a.gif"
                )
                cells = insertion.model.mesh.nelements
                worst = max(worst, ours / bare)
                rows.append([cells, element, field or "regions", ours, bare, ours / bare])
    return Table(
        title=f"{FRAMES} frames of {' x '.join(map(str, SIZE))} as GIF; medians of {ROUNDS} rounds",
        columns=("cells", "element", "coloured by", "animate (s)", "bare PyVista (s)", "ratio"),
        rows=rows,
        passed=worst <= MOST,
        note="bare: plotter, meshes and points there from the start; render, screenshot, GIF; "
        f"the ratio may be {MOST:g}",
        summary={"worst": worst},
    )


def _times(insertion: Insertion, shot: RenderOptions, file: Path) -> tuple[float, float]:
    """Return the median seconds of our animation and of the bare loop."""
    bare = Bare(Timeline(insertion), shot)
    seconds = in_turn(
        {
            "ours": lambda: animate(insertion, file, frames=FRAMES, rate=RATE, shot=shot),
            "bare": lambda: save_moving(bare.frames(), file, RATE),
        },
        ROUNDS,
        time.perf_counter,
    )
    bare.close()
    return median(seconds["ours"]), median(seconds["bare"])
