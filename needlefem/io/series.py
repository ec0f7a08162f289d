"""What is kept of a tissue's motion while it goes on: snapshots, histories, a summary."""

import dataclasses
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TextIO

import numpy as np

from needlefem._arrays import Vector
from needlefem.dynamics import KinematicState, Stepper, TissueSystem, kinetic_energy
from needlefem.dynamics.memory import MaxwellUpdate
from needlefem.errors import NeedlefemError
from needlefem.fem.interpolation import LinearFunctionals
from needlefem.io.files import whole_file, write_json
from needlefem.io.result_folder import result_folder
from needlefem.io.vtu import write_pvd, write_vtu


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
