"""Histories of a needle's motion, written while it goes on."""

import dataclasses
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import TextIO

import numpy as np

from needlefem._arrays import Floats
from needlefem.insertion.insertion_run import InsertionRun
from needlefem.insertion.result import Event
from needlefem.insertion.state import State
from needlefem.io.result_folder import result_folder, whole_file


@dataclasses.dataclass(frozen=True, kw_only=True)
class History:
    """What to keep of a motion, and where.

    Parameters
    ----------
    folder : str or Path
        Gets ``insertion.csv`` (a line a state: time, depth, speed, material at the tip, forces,
        what sticks and slips, where seeds are), ``events.csv``, and ``shaft.csv``.
    every : int
        States between those whose shaft is written, piece by piece, to ``shaft.csv``; 0: none.
    """

    folder: str | Path
    every: int = 1


def recorded_states(course: InsertionRun, wanted: History) -> Iterator[State]:
    """Pass a motion's states on and write their histories; memory does not grow with them.

    Files are whole when the motion ends, when it is stopped early, and when it is interrupted.

    Raises
    ------
    CaseError
        The folder holds another result, or another process is writing there.
    OutputError
        The folder can't be written.
    """
    folder, stopped = Path(wanted.folder), None
    with result_folder(folder, "run", "folder") as result:
        result.begin()
        with ExitStack() as stack:
            tables = [
                stack.enter_context(
                    stack.enter_context(whole_file(folder / name)).open("w", encoding="utf-8")
                )
                for name in ("insertion.csv", "events.csv", "shaft.csv")
            ]
            writer = _Writer(course, *tables)
            try:
                for number, state in enumerate(course.iterate()):
                    writer.state(state)
                    if wanted.every and number % wanted.every == 0:
                        writer.shaft(state)
                    yield state
            except GeneratorExit:  # the caller has seen enough
                pass
            except KeyboardInterrupt as stop:  # the part until then is kept
                stopped = stop
            writer.events()
        if stopped is not None:
            raise stopped


class _Writer:
    def __init__(self, course: InsertionRun, states: TextIO, events: TextIO, shaft: TextIO) -> None:
        self._course, self._before = course, (0.0, 0.0)
        self._states, self._events, self._shaft = states, events, shaft
        self._stiffness = course.instrument.lateral_stiffness
        axes, solid = course.model.axes, course.model.dim == 3
        self._names = course.releases
        force, line, energy = ("N", "N/m", "J") if solid else ("N/m", "Pa", "J/m")
        places = [f"{a} [m]" for a in axes]
        seeds = [f"{name} {place}" for name in self._names for place in places]
        _line(states, ["time [s]", "depth [m]", "speed [m/s]", "tip", *places,
                       f"tip force [{force}]", f"shaft force [{force}]", "sticking pieces",
                       "slipping forward", "slipping backward", *seeds])  # fmt: skip
        _line(events, ["time [s]", "depth [m]", "event", "name", *places, f"energy [{energy}]"])
        _line(shaft, ["time [s]", "from [m]", "to [m]", f"friction [{line}]",
                      *(f"lateral {n} [{line}]" for n in range(1, len(axes))), "slip"])  # fmt: skip

    def state(self, state: State) -> None:
        time, depth = self._before
        speed = (state.depth - depth) / (state.time - time) if state.time > time else 0.0
        slipping = _slipping(state)
        counts = [int(np.count_nonzero(slipping[1:] == way)) for way in (0, 1, -1)]
        seeds = np.full(len(self._names) * len(state.tip), np.nan)
        seeds[: state.seeds.size] = state.seeds.ravel()
        _line(self._states, [state.time, state.depth, speed, state.tip_phase, *state.tip,
                             state.tip_force, float(state.friction_force.sum()), *counts,
                             *seeds])  # fmt: skip
        self._before = (state.time, state.depth)
        self.events()

    def events(self) -> None:
        """Write what happened since, and forget it."""
        for event in self._course.take_events():
            _line(self._events, _event_row(event))

    def shaft(self, state: State) -> None:
        pieces = state.filled(self._course.pieces)
        lengths = np.array([_length(piece.compliance, self._stiffness) for piece in pieces])
        ends = np.cumsum(lengths)
        slipping = _slipping(state)
        for number in np.flatnonzero(lengths):
            length = lengths[number]
            _line(
                self._shaft,
                [
                    state.time,
                    ends[number] - length,
                    ends[number],
                    state.friction_force[number] / length,
                    *state.lateral_force[number] / length,
                    int(slipping[number]),
                ],
            )


def _slipping(state: State) -> Floats:
    """Return the way in which every piece slips; on a march all slip forward."""
    found = np.ones(len(state.friction_force)) if state.slipping is None else state.slipping
    return np.asarray(found, dtype=float)


def _length(compliance: float, stiffness: float) -> float:
    """Return the length of a piece, m; the entry point has none."""
    return 1.0 / (compliance * stiffness) if compliance > 0.0 else 0.0


def _event_row(event: Event) -> list[object]:
    name = event.name.replace(",", ";")
    return [event.time, event.depth, event.kind, name, *event.point, event.energy]


def _line(table: TextIO, cells: list[object] | list[str]) -> None:
    words = [f"{c:.9g}" if isinstance(c, float) else str(c) for c in cells]
    table.write(",".join("" if word == "nan" else word for word in words) + "\n")
