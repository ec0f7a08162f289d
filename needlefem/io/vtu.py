"""VTU files of fields, PVD files of series, and histories that are written during a motion."""

import dataclasses
import os
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from needlefem._arrays import Floats, Ints, Points, Vector
from needlefem.dynamics import KinematicState, Stepper, TissueSystem, kinetic_energy
from needlefem.dynamics.system import MaxwellUpdate
from needlefem.elements import ElementType
from needlefem.errors import NeedlefemError
from needlefem.fem.function_space import FunctionSpace
from needlefem.fem.interpolation import LinearFunctionals
from needlefem.insertion.insertion_run import InsertionRun
from needlefem.insertion.result import Event
from needlefem.insertion.state import State
from needlefem.io.result_folder import result_folder, whole_file, write_json

EDGES = {
    "triangle": ((0, 1), (1, 2), (2, 0)),
    "quadrilateral": ((0, 1), (1, 2), (2, 3), (3, 0)),
    "tetrahedron": ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)),
}
"""Corners of the edges of a cell, in VTK's order."""
ORDER = {
    "triangle": (0, 1, 2),
    "quadrilateral": (0, 1, 2, 3),
    "tetrahedron": (0, 1, 2, 3),
    "hexahedron": (7, 4, 1, 5, 6, 2, 0, 3),
}
"""scikit-fem's corners in VTK's order."""
TURNED = {
    "triangle": (0, 2, 1),
    "quadrilateral": (0, 3, 2, 1),
    "tetrahedron": (0, 2, 1, 3),
    "hexahedron": (4, 5, 6, 7, 0, 1, 2, 3),
}
"""VTK's corners of a cell that scikit-fem has the other way round."""
BESIDE = {
    "triangle": (1, 2), "quadrilateral": (1, 3), "tetrahedron": (1, 2, 3), "hexahedron": (1, 3, 4),
}  # fmt: skip
"""VTK's corners next to the first, right-handed."""
NAMES = {
    ("triangle", 3): "triangle", ("triangle", 6): "triangle6",
    ("quadrilateral", 4): "quad", ("quadrilateral", 9): "quad9",
    ("tetrahedron", 4): "tetra", ("tetrahedron", 10): "tetra10",
    ("hexahedron", 8): "hexahedron",
}  # fmt: skip
"""meshio's names by shape and number of nodes."""
NONE: Mapping[str, NDArray[np.generic]] = {}


def write_vtu(
    path: Path,
    space: FunctionSpace,
    fields: Mapping[str, Floats],
    cells: Mapping[str, NDArray[np.generic]] = NONE,
) -> None:
    """Write fields on the undeformed mesh: of nodes, shape (nnodes,) or (nnodes, dim), of cells.

    Cells have curved edges where the element's nodes are those of a VTK cell. Vectors get a
    third component, as ParaView and PyVista need. Values are in SI units.
    """
    import meshio  # noqa: PLC0415  (only a file needs it)

    kind, nodes = _cells(space)
    used, numbers = np.unique(nodes, return_inverse=True)
    data = {name: _in_space(values[used]) for name, values in fields.items()}
    of_cells = {name: [_in_space(values)] for name, values in cells.items()}
    blocks = [(kind, numbers.reshape(nodes.shape))]
    mesh = meshio.Mesh(_in_space(space.nodes[used]), blocks, data, of_cells)
    with whole_file(path) as part:
        meshio.write(part, mesh, file_format="vtu")


def _cells(space: FunctionSpace) -> tuple[str, Ints]:
    """Return the kind of VTK cell and its nodes, shape (ncells, n), turned as VTK wants."""
    shape, mesh = space.element.cell, space.mesh
    order = ORDER[shape]
    name, local = _local(space.element, order)
    cells = space.cell_nodes[:, local]
    corners = np.moveaxis(mesh.p[:, mesh.t[list(order)]], 0, 2).swapaxes(0, 1)
    across = corners[:, list(BESIDE[shape])] - corners[:, :1]
    turned = np.linalg.det(across) < 0.0
    other = _local(space.element, [order[k] for k in TURNED[shape]])[1]
    cells[turned] = space.cell_nodes[turned][:, other]
    return name, cells


def _local(element: ElementType, order: Sequence[int]) -> tuple[str, Ints]:
    """Return the kind of VTK cell, and the element's nodes that it has, for corners in an order."""
    own, shape = np.asarray(element.nodes), element.cell
    corners = np.asarray(element.skfem_element().refdom.p, dtype=float).T[list(order)]
    middles = [corners[list(edge)].mean(axis=0) for edge in EDGES.get(shape, ())]
    if shape == "quadrilateral":
        middles.append(corners.mean(axis=0))
    curved = np.array([*corners, *middles])
    places = curved if len(own) == len(curved) else corners
    apart = np.abs(places[:, None] - own[None]).max(axis=2)
    return NAMES[shape, len(places)], np.argmin(apart, axis=1)


def _in_space(values: NDArray[np.generic]) -> NDArray[np.generic]:
    """Return vectors of the plane with a third component of zero; scalars as they are."""
    if values.ndim == 2 and values.shape[1] == 2:
        return np.column_stack([values, np.zeros(len(values))])
    return values


def write_objects(path: Path, objects: Sequence[tuple[int, Points]]) -> None:
    """Write lines through points, shape (n, dim), m, and single points, each with a number.

    The number is the cell field ``object``.
    """
    import meshio  # noqa: PLC0415

    blocks, numbers, first = [], [], 0
    for number, points in objects:
        at = first + np.arange(len(points))
        pairs = np.column_stack([at[:-1], at[1:]])
        blocks.append(("line", pairs) if len(at) > 1 else ("vertex", at[:, None]))
        numbers.append(np.full(max(len(at) - 1, 1), number, dtype=np.int32))
        first += len(points)
    places = _in_space(np.vstack([points for _, points in objects]))
    with whole_file(path) as part:
        mesh = meshio.Mesh(places, blocks, cell_data={"object": numbers})
        meshio.write(part, mesh, file_format="vtu")


def write_pvd(
    path: Path, snapshots: Sequence[tuple[float, Path]], beside: Sequence[tuple[float, Path]] = ()
) -> None:
    """Write the collection of VTU files by time, s; their names are relative to it.

    Files `beside` the snapshots are a part of their own.
    """
    root = ET.Element("VTKFile", type="Collection", version="0.1", byte_order="LittleEndian")
    collection = ET.SubElement(root, "Collection")
    for number, listed in enumerate((snapshots, beside)):
        for time, file in listed:
            name = Path(os.path.relpath(file, path.parent)).as_posix()
            what = {"timestep": f"{time:.9g}", "part": str(number), "file": name}
            ET.SubElement(collection, "DataSet", what)
    with whole_file(path) as part:
        ET.ElementTree(root).write(part, encoding="utf-8", xml_declaration=True)


# Snapshots, histories and summary of a motion of tissue.


@dataclasses.dataclass(frozen=True, kw_only=True)
class Recording:
    """What to keep, and where.

    Parameters
    ----------
    folder : str or Path
    every : int
        Steps between snapshots (VTU files, with ``motion.pvd``); 0 for none.
    points : mapping of names to points, shape (dim,), m
        Whose displacement and velocity go to ``motion.csv`` at every step.
    energies : bool
        Kinetic and strain energy at every step as well; they cost two products each.
    """

    folder: str | Path
    every: int = 0
    points: Mapping[str, Vector] = dataclasses.field(default_factory=dict)
    energies: bool = False


def recorded(
    motions: Iterator[KinematicState], stepper: Stepper, wanted: Recording
) -> Iterator[KinematicState]:
    """Pass motions on and keep what is wanted; memory does not grow with their number.

    Files are whole when the run ends, when it is stopped early, and when it fails.

    Raises
    ------
    OutsideError
        A point is not in the tissue.
    CaseError
        The folder holds another result, or another process is writing there.
    OutputError
        The folder can't be written.
    """
    recorder = _Recorder(stepper, wanted)
    failure: BaseException | None = None
    with result_folder(recorder.folder, "motion", "folder") as folder:
        folder.begin()
        with (
            whole_file(recorder.folder / "motion.csv") as part,
            part.open("w", encoding="utf-8") as table,
        ):
            table.write(",".join(recorder.header()) + "\n")
            try:
                for number, motion in enumerate(motions, 1):
                    recorder.keep(number, motion, table)
                    yield motion
            except GeneratorExit:  # the caller has seen enough
                pass
            except (NeedlefemError, KeyboardInterrupt) as stop:  # the part until then is kept
                failure = stop
        recorder.finish("completed" if failure is None else str(failure) or "interrupted")
        if failure is not None:
            raise failure


class _Recorder:
    def __init__(self, stepper: Stepper, wanted: Recording) -> None:
        if not isinstance(stepper.system, TissueSystem):
            raise TypeError("only a tissue has places to look at")
        self.system, self.step, self.wanted = stepper.system, stepper.step, wanted
        self.folder = Path(wanted.folder)
        self.model = self.system.model
        self.memory = MaxwellUpdate(self.system.branches, self.step)
        self.at: dict[str, LinearFunctionals] = {
            name: self.model.interpolation.at(np.asarray(point, dtype=float)[None])
            for name, point in wanted.points.items()
        }
        self.snapshots: list[tuple[float, Path]] = []
        self.steps = 0

    def header(self) -> list[str]:
        per = "J" if self.model.dim == 3 else "J/m"
        columns = ["time [s]"]
        for name in self.at:
            columns += [f"{name} u_{axis} [m]" for axis in self.model.axes]
            columns += [f"{name} v_{axis} [m/s]" for axis in self.model.axes]
        return columns + ([f"kinetic [{per}]", f"strain [{per}]"] if self.wanted.energies else [])

    def keep(self, number: int, motion: KinematicState, table: TextIO) -> None:
        self.steps, time = number, number * self.step
        u, v = self.system.nodal(motion.u), self.system.nodal(motion.v)
        row = [time]
        for weights in self.at.values():
            row += [*weights.of(u)[0], *weights.of(v)[0]]
        if self.wanted.energies:
            stored = self.memory.energy(motion.parts) if self.memory else 0.0
            row += [kinetic_energy(self.system, motion.v)]
            row += [self.system.strain_energy(motion.u) + stored]
        table.write(",".join(f"{value:.9g}" for value in row) + "\n")
        if self.wanted.every and number % self.wanted.every == 0:
            file = self.folder / "motion" / f"{number:07d}.vtu"
            write_vtu(file, self.model, {"displacement": u, "velocity": v})
            self.snapshots.append((time, file))

    def finish(self, status: str) -> None:
        folder = self.folder
        if self.snapshots:
            write_pvd(folder / "motion.pvd", self.snapshots)
        record = {
            "status": status,
            "steps": self.steps,
            "step": self.step,
            "duration": self.steps * self.step,
            "points": {name: list(point) for name, point in self.wanted.points.items()},
            "snapshots": [
                {"time": time, "file": str(file.relative_to(folder))}
                for time, file in self.snapshots
            ],
        }
        write_json(folder / "motion.json", record)


# Histories of a motion of the needle.


@dataclasses.dataclass(frozen=True, kw_only=True)
class History:
    """Records of a motion that are written during the computation.

    Parameters
    ----------
    folder : str or Path
        Folder for ``insertion.csv`` (one line per state: time, depth, speed, material point at the
        tip, forces, numbers of sticking and slipping segments, positions of seeds), ``events.csv``,
        and ``shaft.csv``.
    every : int
        ``shaft.csv`` contains the contact segments of every n-th state; 0: none.
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
        self._stiffness = course.instrument.lateral_penalty
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
        """Write the events since the last call."""
        for event in self._course.take_events():
            _line(self._events, _event_row(event))

    def shaft(self, state: State) -> None:
        segments = state.filled(self._course.segments)
        lengths = np.array([_length(segment.compliance, self._stiffness) for segment in segments])
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
    """Return the direction of slip of each segment; in path following all slip forward."""
    found = np.ones(len(state.friction_force)) if state.slipping is None else state.slipping
    return np.asarray(found, dtype=float)


def _length(compliance: float, stiffness: float) -> float:
    """Return the length of a contact segment, m; zero for the entry point."""
    return 1.0 / (compliance * stiffness) if compliance > 0.0 else 0.0


def _event_row(event: Event) -> list[object]:
    name = event.name.replace(",", ";")
    return [event.time, event.depth, event.kind, name, *event.point, event.energy]


def _line(table: TextIO, cells: list[object] | list[str]) -> None:
    words = [f"{c:.9g}" if isinstance(c, float) else str(c) for c in cells]
    table.write(",".join("" if word == "nan" else word for word in words) + "\n")
