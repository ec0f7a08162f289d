"""Pictures of a motion: forces against depth, what sticks and slips against time."""

from pathlib import Path

import numpy as np

from needlefem._arrays import Floats
from needlefem.insertion.result import Insertion
from needlefem.plotting.backend import renderer
from needlefem.plotting.charts import Axis, Chart
from needlefem.plotting.images import save
from needlefem.plotting.style import Style

STICK_COLOURS = ("#0072B2", "#8C8C8C", "#D55E00")
"""Slips backward, sticks, slips forward."""


def draw_forces(insertion: Insertion, path: Path) -> Path:
    """Draw the needle's force, and the tip's part of it, against depth."""
    style, states = Style(), insertion.states
    depths = 100.0 * insertion.depths
    unit = "N" if insertion.model.dim == 3 else "N/m"
    plotter = renderer().Plotter(off_screen=True, window_size=[1600, 1000])
    plotter.set_background(style.background)
    whole = np.array([state.force for state in states])
    tip = np.array([state.tip_force for state in states])
    chart = Chart(
        plotter, style, title="Force on the needle", x=Axis.over("depth (cm)", depths),
        y=Axis.over(f"force ({unit})", np.concatenate([whole, tip, [0.0]])),
        legend=((style.seed, "tip and shaft"), (style.target, "tip")),
    )  # fmt: skip
    chart.curve(depths, whole, style.seed, 5.0)
    chart.curve(depths, tip, style.target, 3.0)
    return save(plotter, path)


def draw_sticking(insertion: Insertion, path: Path) -> Path:
    """Draw where along the path the shaft sticks and slips, against time."""
    style = Style()
    times, places, ways = _stick_map(insertion)
    places = 100.0 * places
    plotter = renderer().Plotter(off_screen=True, window_size=[1600, 1000])
    plotter.set_background(style.background)
    names = ("slips backward", "sticks", "slips forward")
    chart = Chart(
        plotter, style, title="What of the shaft sticks and slips",
        x=Axis(label="time (s)", low=0.0, high=1.02 * float(times[-1]) or 1.0),
        y=Axis(label="length of the cut path (cm)", low=0.0, high=1.04 * float(places[-1]) or 1.0),
        legend=tuple(zip(STICK_COLOURS, names, strict=True)),
    )  # fmt: skip
    step, place = np.nonzero(ways < 2.0)
    if step.size:
        ends = times[step], times[step + 1], places[place], places[place + 1]
        palette = np.array([chart.colour(colour) for colour in STICK_COLOURS])
        chart.blocks(np.stack(ends, axis=1), palette[ways[step, place].astype(np.intp) + 1])
    return save(plotter, path)


def _stick_map(insertion: Insertion) -> tuple[Floats, Floats, Floats]:
    """Return times, places along the path (m), and ways of slipping between them; 9: no needle."""
    states = [state for state in insertion.states if not state.jumping]
    stiffness = insertion.instrument.lateral_stiffness
    lengths = [1.0 / (p.compliance * stiffness) for p in insertion.pieces[1:]]
    last = max((s.inserted_length for s in states), default=0.0)
    places = np.concatenate([[0.0], np.cumsum(lengths)])
    places = np.append(places, last) if last > places[-1] * (1.0 + 1e-9) else places
    times = np.array([state.time for state in states])
    keep = np.concatenate([[True], np.diff(times) > 0.0])
    ways = np.full((int(keep.sum()) - 1, len(places) - 1), 9.0)
    for row, state in enumerate(np.array(states, dtype=object)[keep][1:]):
        slipping = np.ones(len(state.friction_force)) if state.slipping is None else state.slipping
        filled = slipping[1 : ways.shape[1] + 1]
        ways[row, : len(filled)] = filled
    return times[keep], places, ways
