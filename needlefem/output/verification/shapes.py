"""Pictures of deformed meshes, as PNG inside the page."""

import base64
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from needlefem.arrays import Points
from needlefem.checks.problem import Shape
from needlefem.output.driver import renderer

SIZE = (900, 640)


def picture(shape: Shape) -> str:
    """Return a deformed mesh over its undeformed outline as a data URL.

    Raises
    ------
    NoRendererError
        Nothing here can draw.
    """
    pv = renderer()
    mesh = shape.solution.space.mesh
    moved = shape.solution.at_vertices()
    plotter = pv.Plotter(off_screen=True, window_size=list(SIZE), border=False)
    plotter.set_background("white")
    cells = mesh.t.T
    faces = np.column_stack([np.full(len(cells), cells.shape[1]), cells]).ravel()
    surface = pv.PolyData(_flat(mesh.p.T + shape.magnified * moved), faces=faces)
    surface["displacement"] = np.linalg.norm(moved, axis=1)
    plotter.add_mesh(
        surface,
        scalars="displacement",
        cmap="viridis",
        show_edges=len(cells) <= 5000,
        edge_color="#303030",
        line_width=0.6,
        lighting=False,
        scalar_bar_args={
            "title": "", "n_labels": 3, "fmt": "%.3g", "color": "#202020", "label_font_size": 22,
            "vertical": True, "position_x": 0.85, "position_y": 0.2, "height": 0.6, "width": 0.06,
        },
    )  # fmt: skip
    _outline(pv, plotter, mesh)
    plotter.view_xy()
    plotter.enable_parallel_projection()
    plotter.camera.zoom(1.1)
    return _png(plotter)


def _flat(points: Points) -> Points:
    return np.column_stack([points, np.zeros(len(points))])


def _outline(pv: Any, plotter: Any, mesh: Any) -> None:
    edges = mesh.facets[:, mesh.boundary_facets()].T
    lines = np.column_stack([np.full(len(edges), 2), edges]).ravel()
    outline = pv.PolyData(_flat(mesh.p.T), lines=lines)
    plotter.add_mesh(outline, color="#D55E00", line_width=2.5, lighting=False)


def _png(plotter: Any) -> str:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "shape.png"
        plotter.screenshot(path)
        plotter.close()
        return "data:image/png;base64," + base64.b64encode(path.read_bytes()).decode("ascii")
