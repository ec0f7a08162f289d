"""Pictures of scenes, insertions and plans: stills, panels, animations, charts.

Rendering needs the extra packages of ``needlefem[render]``, which are imported when something is
drawn. Pictures show results and never compute new ones. One picture at a time or depth is drawn
with `needlefem.render`.
"""

from typing import TYPE_CHECKING

from needlefem._exports import lazy_exports

if TYPE_CHECKING:
    from needlefem.plotting.canvas import Canvas
    from needlefem.plotting.figures import (
        draw_depth,
        draw_forces,
        draw_height,
        draw_modes,
        draw_plan,
        draw_setup,
        draw_sticking,
    )
    from needlefem.plotting.images import Image, Style, renderer, save_moving
    from needlefem.plotting.notebook import html_of, png_of
    from needlefem.plotting.panel import synthetic_ultrasound
    from needlefem.plotting.quantities import QUANTITIES, FieldQuantity
    from needlefem.plotting.render import (
        Renderer,
        RenderOptions,
        animate,
        frame_times,
        panels,
        write_snapshots,
    )
    from needlefem.plotting.stages import draw_stages
    from needlefem.plotting.timeline import Frame, Timeline
    from needlefem.plotting.verification_report import Bar, ChartLine, bars, loglog
    from needlefem.plotting.view import SurfaceMesh, View, ViewOptions

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
        canvas="Canvas",
        figures="draw_depth draw_forces draw_height draw_modes draw_plan draw_setup draw_sticking",
        images="Image Style renderer save_moving",
        notebook="html_of png_of",
        panel="synthetic_ultrasound",
        quantities="FieldQuantity QUANTITIES",
        render="RenderOptions Renderer animate frame_times panels write_snapshots",
        stages="draw_stages",
        timeline="Frame Timeline",
        verification_report="Bar ChartLine bars loglog",
        view="SurfaceMesh View ViewOptions",
    )
