import json
import tracemalloc
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv

from needlefem.checks import rectangle
from needlefem.dynamics import (
    CentralDifference,
    Integrator,
    KinematicState,
    Newmark,
    QuasiStatic,
    TissueSystem,
    constant,
    iterate,
    last,
)
from needlefem.elements import CATALOGUE
from needlefem.errors import SimulationError
from needlefem.io import Recording, recorded
from needlefem.materials import Isotropic, Viscoelastic

GEL = Isotropic(youngs_modulus=1.0, poissons_ratio=0.3, density=1.0)
CORNER = np.array([1.0, 1.0])


def run(
    folder: Path, element: str = "P2", **wanted: object
) -> tuple[TissueSystem, list[KinematicState]]:
    system = TissueSystem(rectangle(CATALOGUE[element], GEL, 3))
    stepper = Newmark().stepper(system, 0.1)
    force = system.traction("y_max", lambda points: np.tile([0.01, 0.0], (len(points), 1)))
    motions = iterate(stepper, stepper.at_rest(), constant(force), 10)
    keep = Recording(folder=folder, points={"corner": CORNER}, **wanted)  # type: ignore[arg-type]
    return system, list(recorded(motions, stepper, keep))


@pytest.mark.parametrize("element", CATALOGUE)
def test_snapshots_open_in_pyvista_with_their_times(element: str, tmp_path: Path) -> None:
    system, motions = run(tmp_path, element, every=5)
    reader = pv.get_reader(tmp_path / "motion.pvd")
    assert reader.time_values == pytest.approx([0.5, 1.0])
    reader.set_active_time_value(1.0)
    grid = reader.read()[0]
    assert grid.compute_cell_sizes().cell_data["Area"].sum() == pytest.approx(1.0)
    nodes = system.nodal(motions[-1].u)
    at = [int(np.argmin(np.sum((system.model.nodes - p) ** 2, 1))) for p in grid.points[:, :2]]
    assert grid.point_data["displacement"][:, :2] == pytest.approx(nodes[at], abs=1e-12)


def test_history_and_summary(tmp_path: Path) -> None:
    system, motions = run(tmp_path, energies=True)
    with (tmp_path / "motion.csv").open() as file:
        header = file.readline().strip().split(",")
        rows = np.loadtxt(file, delimiter=",")
    assert header[:3] == ["time [s]", "corner u_y [m]", "corner u_z [m]"]
    assert header[-2:] == ["kinetic [J/m]", "strain [J/m]"]
    u = system.model.interpolation.at(CORNER[None]).of(system.nodal(motions[-1].u))[0]
    assert rows[-1, 1:3] == pytest.approx(u, rel=1e-8)
    assert rows[-1, -1] == pytest.approx(system.strain_energy(motions[-1].u), rel=1e-8)
    record = json.loads((tmp_path / "motion.json").read_text())
    assert (record["status"], record["steps"], record["snapshots"]) == ("completed", 10, [])


def test_a_run_that_fails_leaves_whole_files(tmp_path: Path) -> None:
    system = TissueSystem(rectangle(CATALOGUE["P1"], GEL, 3))
    stepper = Newmark().stepper(system, 0.1)

    def broken() -> Iterator[KinematicState]:
        yield from iterate(stepper, stepper.at_rest(), None, 3)
        raise SimulationError("it broke")

    with pytest.raises(SimulationError, match="it broke"):
        list(recorded(broken(), stepper, Recording(folder=tmp_path, every=2)))
    assert len((tmp_path / "motion.csv").read_text().splitlines()) == 4
    assert json.loads((tmp_path / "motion.json").read_text())["status"] == "it broke"
    assert not list(tmp_path.rglob(".part-*"))


def test_stopping_early_keeps_what_there_is(tmp_path: Path) -> None:
    system = TissueSystem(rectangle(CATALOGUE["P1"], GEL, 3))
    stepper = Newmark().stepper(system, 0.1)
    motions = iterate(stepper, stepper.at_rest(), None, 1000)
    for number, _ in enumerate(recorded(motions, stepper, Recording(folder=tmp_path)), 1):
        if number == 7:
            break
    assert json.loads((tmp_path / "motion.json").read_text())["steps"] == 7


@pytest.mark.parametrize("integrator", [Newmark(), CentralDifference(), QuasiStatic()])
def test_memory_does_not_grow_with_the_steps(integrator: Integrator, tmp_path: Path) -> None:
    law = Viscoelastic(
        youngs_modulus=1.0, poissons_ratio=0.3, density=1.0, shares=(0.4,), times=(2.0,)
    )
    system = TissueSystem(rectangle(CATALOGUE["P1"], law, 6))
    stepper = integrator.stepper(system, 0.01)
    force = system.traction("y_max", lambda points: np.tile([0.01, 0.0], (len(points), 1)))

    def most(count: int) -> int:
        """Return the largest memory in use during a recorded run, bytes."""
        keep = Recording(
            folder=tmp_path, points={"corner": CORNER}, energies=True, every=count // 2
        )
        rest = np.zeros(system.size)
        tracemalloc.start()
        last(recorded(iterate(stepper, stepper.start(rest, rest), constant(force), count),
                      stepper, keep))  # fmt: skip
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return peak

    most(10)  # what is imported and kept once
    short, long = most(100), most(3000)
    one_motion = 4 * 8 * system.size
    assert long < short + 2 * one_motion
