"""Pictures of a motion: forces against depth, what sticks and slips against time."""

from pathlib import Path

import numpy as np

from needlefem.arrays import Floats
from needlefem.insertion.result import Insertion
from needlefem.output.charts import line_chart
from needlefem.output.driver import renderer
from needlefem.output.images import save
from needlefem.output.style import Style

STICK_COLOURS = ("#0072B2", "#8C8C8C", "#D55E00")
"""Slips backward, sticks, slips forward."""


def draw_forces(insertion: Insertion, path: Path) -> Path:
    """Draw the needle's force, and the tip's part of it, against depth."""
    style, states = Style(), insertion.states
    depths = 100.0 * insertion.depths
    unit = "N" if insertion.model.dim == 3 else "N/m"
    plotter = renderer().Plotter(off_screen=True, window_size=[1600, 1000])
    plotter.set_background(style.background)
    title = "Force on the needle"
    chart = line_chart(plotter, title, "depth (cm)", f"force ({unit})")
    whole = np.array([state.force for state in states])
    tip = np.array([state.tip_force for state in states])
    chart.line(depths, whole, color=style.seed, width=4.0, label="tip and shaft")
    chart.line(depths, tip, color=style.target, width=3.0, label="tip")
    low, high = float(min(whole.min(), 0.0)), float(whole.max())
    room = 0.06 * (high - low) or 1.0
    chart.y_range = [low - room, high + 4.0 * room]  # for the legend
    return save(plotter, path)


def draw_sticking(insertion: Insertion, path: Path) -> Path:
    """Draw where along the path the shaft sticks and slips, against time."""
    pv, style = renderer(), Style()
    times, places, ways = _stick_map(insertion)
    across, up = _Ticks(float(times[-1])), _Ticks(100.0 * float(places[-1]))
    grid = pv.RectilinearGrid(times / across.end, 0.6 * 100.0 * places / up.end, [0.0])
    grid.cell_data["way"] = ways.ravel(order="F")
    plotter = pv.Plotter(off_screen=True, window_size=[1600, 1100])
    plotter.set_background(style.background)
    shown = grid.threshold((-1.5, 1.5), scalars="way")
    plotter.add_mesh(shown, scalars="way", cmap=list(STICK_COLOURS), clim=(-1.5, 1.5),
                     show_scalar_bar=False, lighting=False)  # fmt: skip
    names = zip(("slips backward", "sticks", "slips forward"), STICK_COLOURS, strict=True)
    plotter.add_legend([list(name) for name in names], bcolor="white", size=(0.2, 0.11),
                       loc="upper left", face="rectangle")  # fmt: skip
    plotter.show_bounds(
        bounds=(0.0, 1.0, 0.0, 0.6, 0.0, 0.0),
        axes_ranges=[0.0, across.end, 0.0, up.end, 0.0, 0.0],
        n_xlabels=across.count, n_ylabels=up.count, show_zaxis=False, fmt="%g",
        xtitle="time (s)", ytitle="length of the cut path (cm)",
        font_size=16, bold=False, color=style.text, ticks="outside", location="outer",
    )  # fmt: skip
    plotter.view_xy()
    plotter.camera.parallel_projection = True
    plotter.camera.focal_point = (0.5, 0.33, 0.0)
    plotter.camera.position = (0.5, 0.33, 1.0)
    plotter.camera.parallel_scale = 0.46
    return save(plotter, path)


class _Ticks:
    """Round ticks from 0 to at least a number: their end and count."""

    def __init__(self, last: float) -> None:
        last = last if last > 0.0 else 1.0
        power = 10.0 ** np.floor(np.log10(last / 8.0))
        step = next(float(n * power) for n in (1, 2, 5, 10) if last / (n * power) <= 8.0)
        self.count = int(np.ceil(last / step - 1e-9)) + 1
        self.end = step * (self.count - 1)


def _stick_map(insertion: Insertion) -> tuple[Floats, Floats, Floats]:
    """Return times, places along the path (m), and ways of slipping between them; 9: no needle."""
    states = [state for state in insertion.states if not state.jumping]
    stiffness = insertion.instrument.lateral_stiffness
    lengths = [1.0 / (p.compliance * stiffness) for p in insertion.pieces[1:]]
    last = max((s.covered for s in states), default=0.0)
    places = np.concatenate([[0.0], np.cumsum(lengths)])
    places = np.append(places, last) if last > places[-1] * (1.0 + 1e-9) else places
    times = np.array([state.time for state in states])
    keep = np.concatenate([[True], np.diff(times) > 0.0])
    ways = np.full((int(keep.sum()) - 1, len(places) - 1), 9.0)
    for row, state in enumerate(np.array(states, dtype=object)[keep][1:]):
        slipping = np.ones(len(state.axial)) if state.slipping is None else state.slipping
        filled = slipping[1 : ways.shape[1] + 1]
        ways[row, : len(filled)] = filled
    return times[keep], places, ways
