"""Pictures of deformed meshes, as PNG inside the page."""

import base64
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from needlefem._arrays import Ints, Points
from needlefem.checks.reference_problem import Shape
from needlefem.plotting.canvas import THINNEST
from needlefem.plotting.images import renderer
from needlefem.plotting.view import SurfaceMesh

SIZE = (900, 640)
MOST_EDGES = 5000
"""Cells up to which their edges are drawn."""


def picture(shape: Shape) -> str:
    """Return a deformed mesh over its undeformed outline as a data URL.

    Raises
    ------
    NoRendererError
        Nothing here can draw.
    """
    pv = renderer()
    seen = SurfaceMesh(shape.solution.space)
    moved = seen.displaced(shape.solution.u)
    at = _flat(seen.rest + shape.magnified * moved)
    plotter = pv.Plotter(off_screen=True, window_size=list(SIZE), border=False)
    plotter.set_background("white")
    surface = pv.PolyData(at, faces=_counted(seen.polygons))
    surface["displacement"] = np.linalg.norm(moved, axis=1)
    plotter.add_mesh(
        surface,
        scalars="displacement",
        cmap="viridis",
        lighting=False,
        scalar_bar_args={
            "title": "displacement (m)\n", "title_font_size": 20, "n_labels": 3,
            "fmt": "%.3g", "color": "#202020", "label_font_size": 22,
            "vertical": True, "position_x": 0.85, "position_y": 0.2, "height": 0.6, "width": 0.06,
        },
    )  # fmt: skip
    if shape.solution.space.mesh.nelements <= MOST_EDGES:
        edges = pv.PolyData(at, lines=_counted(seen.edges))
        plotter.add_mesh(edges, color="#303030", line_width=THINNEST, lighting=False)
    outline = pv.PolyData(_flat(seen.rest), lines=_counted(seen.outline))
    plotter.add_mesh(outline, color="#D55E00", line_width=2.5, lighting=False)
    plotter.view_xy()
    plotter.enable_parallel_projection()
    plotter.camera.zoom(1.1)
    return _png(plotter)


def _flat(points: Points) -> Points:
    return np.column_stack([points, np.zeros(len(points))])


def _counted(numbers: Ints) -> Ints:
    """Return polygons or lines, shape (n, k), as VTK lists them."""
    return np.column_stack([np.full(len(numbers), numbers.shape[1]), numbers]).ravel()


def _png(plotter: Any) -> str:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "shape.png"
        plotter.screenshot(path)
        plotter.close()
        return "data:image/png;base64," + base64.b64encode(path.read_bytes()).decode("ascii")
