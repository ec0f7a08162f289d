"""Pictures of mode shapes."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from needlefem._arrays import Floats, Points
from needlefem.fem.tissue_model import TissueModel
from needlefem.needle.insertion_axis import InsertionAxis
from needlefem.plotting.backend import renderer
from needlefem.plotting.body import Body
from needlefem.plotting.canvas import Canvas
from needlefem.plotting.images import save
from needlefem.plotting.panel import Panel, Window
from needlefem.plotting.style import Style
from needlefem.scene import Scene

ACROSS = 3
"""Panels in a row."""
SWING = 0.06
"""Largest displacement that is drawn, over the size of the tissue."""


def draw_modes(
    scene: Scene, model: TissueModel, frequencies: Floats, shapes: Sequence[Points], path: Path
) -> Path:
    """Draw the tissue deformed by modes, a panel each, under their frequencies (Hz).

    `shapes` are nodal fields, shape (nnodes, dim); their size is that of the picture's choice.

    Raises
    ------
    NoRendererError
        Nothing here can draw.
    """
    pv = renderer()
    style = Style()
    across = min(ACROSS, len(shapes))
    down = -(-len(shapes) // across)
    plotter = pv.Plotter(
        off_screen=True, shape=(down, across), window_size=[560 * across, 600 * down], border=False
    )
    plotter.set_background(style.background)
    axis = InsertionAxis(model.nodes[0], np.array(scene.motion.direction))
    size = float(np.ptp(model.nodes, axis=0).max())
    for number, (hertz, shape) in enumerate(zip(frequencies, shapes, strict=True)):
        plotter.subplot(number // across, number % across)
        canvas = Canvas(plotter, axis, style)
        largest = float(np.linalg.norm(shape, axis=1).max())
        field = model.dof_vector(SWING * size / largest * shape)
        body = Body(canvas, model)
        body.draw_regions()
        body.to(field)
        for region in scene.regions.values():
            points = region.contour.points
            canvas.contour(points + model.displacement_at(field, points))
        panel = Panel(plotter, style)
        # the same window for all, with room for the largest swing
        panel.look(Window.around(canvas.screen(model.mesh.p.T), 0.02 + 1.5 * SWING))
        panel.line(f"mode {number + 1}: {hertz:.3g} Hz")
    return save(plotter, path)
