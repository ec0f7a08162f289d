"""Pictures of an insertion."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from needlefem.arrays import Floats, SkfemMesh
from needlefem.insertion.fields import displacements
from needlefem.insertion.result import Insertion
from needlefem.output.canvas import Canvas, Style, Window
from needlefem.output.driver import renderer
from needlefem.output.files import whole_file


def save(plotter: Any, path: Path) -> Path:
    """Draw what a plotter holds into a PNG file."""
    with whole_file(path) as part:
        plotter.screenshot(part)
    plotter.close()
    return path


def draw_tissue(canvas: Canvas, insertion: Insertion, depth: float | None) -> None:
    """Draw the tissue and its contours at a depth, or undeformed for None."""
    model = insertion.model
    moved = None if depth is None else displacement(insertion, depth)
    vertices = None if moved is None else moved[model.basis.nodal_dofs].T
    canvas.tissue(model.mesh, vertices)
    for region in insertion.scene.regions.values():
        points = region.contour.points
        canvas.contour(points if moved is None else points + model.displacement_at(moved, points))


def displacement(insertion: Insertion, depth: float) -> Floats:
    """Return the displacement of all dofs at a depth, shape (ndofs,), m.

    Interpolated linearly between the two states around it.
    """
    depths = insertion.depths
    after = int(np.clip(np.searchsorted(depths, depth), 1, len(depths) - 1))
    span = depths[after] - depths[after - 1]
    share = float(np.clip((depth - depths[after - 1]) / span, 0.0, 1.0)) if span else 1.0
    moved: Floats = displacements(insertion, [after - 1, after]) @ np.array([1.0 - share, share])
    return moved


def whole_window(mesh: SkfemMesh, canvas: Canvas, behind: float = 0.0) -> Window:
    """Return a window that shows the mesh and `behind` (m) of the space that the needle is in."""
    corners = canvas.screen(mesh.p.T)[:, :2]
    low, high = corners.min(axis=0), corners.max(axis=0) + np.array([behind, 0.0])
    size = 1.1 * (high - low)
    return Window(0.5 * (low + high), float(size[0]), float(size[1]))


def render(
    insertion: Insertion,
    path: str | Path,
    *,
    depth: float | None = None,
    size: Sequence[int] = (1600, 1200),
    style: Style | None = None,
) -> Path:
    """Draw the deformed tissue and the needle at a depth into a PNG file.

    Parameters
    ----------
    insertion : Insertion
    path : str or Path
    depth : float, m, optional
        The last state's when left out.
    size : (int, int)
        Pixels.
    style : Style, optional

    Raises
    ------
    NoRendererError
        Nothing here can draw; the message names what to install.
    """
    pv = renderer()
    style = style or Style()
    at = float(insertion.depths[-1]) if depth is None else depth
    plotter = pv.Plotter(off_screen=True, window_size=list(size), border=False)
    plotter.set_background(style.background)
    canvas = Canvas(plotter, insertion.axis, style)
    radius = insertion.scene.needle.tip_radius
    draw_tissue(canvas, insertion, at)
    canvas.needle(insertion.axis.tip(at), radius, at + 0.02)
    if insertion.scene.target is not None:
        canvas.target(np.array(insertion.scene.target), 2.0 * radius)
    window = whole_window(insertion.model.mesh, canvas, behind=0.012)
    canvas.look(window)
    canvas.scale_bar(window, 0.01, "1 cm")
    canvas.title(window, f"{insertion.scene.title}: depth {100 * at:.2f} cm")
    return save(plotter, Path(path))
