"""Pictures of scenes, insertions and plans: stills, panels, animations, charts.

Rendering needs the extra packages of ``needlefem[render]``, which are imported when something is
drawn. Pictures show results and never compute new ones. One picture at a time or depth is drawn
with `needlefem.render`.
"""

from typing import TYPE_CHECKING

from needlefem._exports import lazy_exports

if TYPE_CHECKING:
    from needlefem.plotting.canvas import Canvas, SurfaceMesh
    from needlefem.plotting.charts import (
        Bar,
        ChartLine,
        bars,
        draw_depth,
        draw_forces,
        draw_height,
        draw_sticking,
        loglog,
    )
    from needlefem.plotting.figures import draw_modes, draw_plan, draw_setup, draw_stages
    from needlefem.plotting.images import Image, Style, renderer, save_moving
    from needlefem.plotting.notebook import html_of, png_of
    from needlefem.plotting.panel import synthetic_ultrasound
    from needlefem.plotting.render import (
        Renderer,
        RenderOptions,
        animate,
        frame_times,
        panels,
        write_snapshots,
    )
    from needlefem.plotting.timeline import Frame, Timeline
    from needlefem.plotting.view import QUANTITIES, FieldQuantity, View, ViewOptions

__all__ = [
    "QUANTITIES",
    "Bar",
    "Canvas",
    "ChartLine",
    "FieldQuantity",
    "Frame",
    "Image",
    "RenderOptions",
    "Renderer",
    "Style",
    "SurfaceMesh",
    "Timeline",
    "View",
    "ViewOptions",
    "animate",
    "bars",
    "draw_depth",
    "draw_forces",
    "draw_height",
    "draw_modes",
    "draw_plan",
    "draw_setup",
    "draw_stages",
    "draw_sticking",
    "frame_times",
    "html_of",
    "loglog",
    "panels",
    "png_of",
    "renderer",
    "save_moving",
    "synthetic_ultrasound",
    "write_snapshots",
]

if not TYPE_CHECKING:
    __getattr__, __dir__ = lazy_exports(
        __name__,
        canvas="Canvas SurfaceMesh",
        charts="Bar ChartLine bars draw_depth draw_forces draw_height draw_sticking loglog",
        figures="draw_modes draw_plan draw_setup draw_stages",
        images="Image Style renderer save_moving",
        notebook="html_of png_of",
        panel="synthetic_ultrasound",
        render="RenderOptions Renderer animate frame_times panels write_snapshots",
        timeline="Frame Timeline",
        view="FieldQuantity QUANTITIES View ViewOptions",
    )
