"""Computations that a plan omits: time with and without them, and the difference of results."""

import dataclasses
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import numpy as np

from needlefem import load_case
from needlefem.bench import children_seconds, median, processor_seconds
from needlefem.dynamics import Damping, TissueSystem
from needlefem.errors import CaseError
from needlefem.fem import CachedCompliance
from needlefem.insertion import Insertion, Simulation, TipTrajectory, displacements
from needlefem.planning import Planner
from needlefem.plotting import Bar, bars
from needlefem.scene import DYNAMIC, Scene, Stage, resolve, vary
from needlefem.studies import Table
from verification.studies.dynamics import DAMPING, moving

ROUNDS = 3
SHARE = 0.6
"""Of the largest depth, where answers are compared."""
EXACT, BETWEEN, SLOW = 1e-10, 1e-6, 1e-5
"""Largest differences, m: of what is the same but for round-off, of what is interpolated between
states, and of slow motion with inertia (``needlefem study dynamics``)."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Skip:
    """Something left out, and how it is forced.

    Parameters
    ----------
    name : str
        Its key in what a result says was skipped.
    forced : str
        How a user has it done all the same.
    lean, full : callable
        Without it and with it; both return what is compared.
    allowed : float
        Largest difference.
    seconds : callable
        Takes a task and a number of rounds, returns seconds.
    """

    name: str
    forced: str
    lean: Callable[[], Any]
    full: Callable[[], Any]
    allowed: float = EXACT
    seconds: Callable[[Callable[[], object], int], list[float]] = processor_seconds


def run(case: str) -> Table:
    """Time everything that a case's plan does without, forced on and off."""
    scene = load_case(case)
    if scene.target is None:
        raise CaseError("target.point", "missing", "the benchmark plans for it")
    return table(resolve(scene).scene)


def table(scene: Scene) -> Table:
    """Return the table of a resolved scene."""
    rows: list[list[Any]] = []
    passed = True
    for skip in skips(scene):
        apart = float(np.max(np.abs(np.asarray(skip.lean()) - np.asarray(skip.full()))))
        lean, full = (median(skip.seconds(task, ROUNDS)) for task in (skip.lean, skip.full))
        passed &= apart <= skip.allowed
        rows.append([skip.name, skip.forced, 1e3 * lean, 1e3 * full, full / lean, apart,
                     skip.allowed])  # fmt: skip
    return Table(
        title=f"{scene.title}: what is skipped, medians of {ROUNDS} rounds, processor time",
        columns=("skipped", "forced by", "ms without", "ms with", "ratio", "difference (m)",
                 "allowed"),
        rows=rows,
        passed=passed,
        charts={
            scene.title: bars("without and with what is skipped", "milliseconds", [
                Bar(f"{row[0]}, {word}", row[2 + series], series=series)
                for row in rows for series, word in enumerate(("without", "with"))
            ])
        },
        note="difference: of places of the tip, of what the needle touches, or of releases",
    )  # fmt: skip


class Ways:
    """A scene's plan with and without what it skips.

    Parameters
    ----------
    scene : Scene
        Resolved, with a target.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene, self.shared = scene, Simulation(scene)
        self.entry = self.shared.entry_of_case()
        self.depth = SHARE * scene.motion.max_depth
        self.target = np.array(scene.target)
        self.insert()

    def insert(self, simulation: Simulation | None = None) -> Insertion:
        """Push the needle in, somewhat deeper than where answers are compared."""
        beyond = self.depth + 4.0 * self.scene.discretization.path_spacing
        ready = simulation or self.shared
        ready.forget()
        return ready.insert(self.entry, lambda state: state.depth > beyond)

    def tip(self, simulation: Simulation | None = None) -> Any:
        """Return the material point at the tip at the depth of comparison."""
        reach = TipTrajectory(self.insert(simulation)).at_depth(self.depth)
        assert reach is not None
        return reach.point

    def pieces(self, simulation: Simulation | None = None) -> Any:
        """Return where the pieces of the path are beside the axis."""
        count = int(SHARE * self.depth / self.scene.discretization.path_spacing)
        return [piece.offset for piece in self.insert(simulation).segments[:count]]

    def with_key(self, key: str, value: object) -> Simulation:
        """Return a simulation of the scene with a key replaced."""
        return Simulation(vary(self.scene, {key: value}), self.shared.model)

    def slow(self) -> Any:
        """Insert with inertia, at the case's speed."""
        scene = moving(self.scene, DYNAMIC[0], self.scene.motion.speed, DAMPING)
        return self.tip(Simulation(scene, self.shared.model))

    def everywhere(self) -> Any:
        """Insert with the responses of all nodes."""
        whole = Simulation(self.scene, self.shared.model)
        whole.responses = CachedCompliance(whole.model)
        whole.responses.rows(np.arange(whole.model.nnodes))
        return self.tip(whole)

    def weighed(self) -> Any:
        """Assemble mass and damping as well."""
        system = TissueSystem(self.shared.model, Damping(mass_rate=1.0, stiffness_time=1e-3))
        system.products(*(np.ones(system.size) for _ in range(3)))
        return self.tip()

    def retracted(self) -> Any:
        """Return where in the world a seed is once the needle is out."""
        stages = (Stage(depth=self.depth, release="seed"), Stage(depth=0.0))
        return self.with_key("motion.stages", stages).move(self.entry).states[-1].seeds[0]

    def planned(self, search: str) -> Any:
        """Return the height that a search finds."""
        return Planner(self.shared, self.target).plan(search).solution.height

    def repeated(self) -> Any:
        """Plan with a model of its own for every insertion."""
        planner = Planner(self.shared, self.target)
        found = planner.plan("root").solution
        for height, _ in found.tried:
            simulation = Simulation(self.scene)
            simulation.insert(simulation.entry_through(self.target + height @ planner.laterals))
        return found.height


def skips(scene: Scene) -> list[Skip]:
    """Return all that a scene's plan does without."""
    ways = Ways(scene)
    return [
        Skip(name="dynamics", forced=f"discretization.integrator = '{DYNAMIC[0]}'",
             lean=ways.tip, full=ways.slow, allowed=SLOW),
        Skip(name="time_steps", forced="discretization.integrator = 'quasi_static'",
             lean=ways.pieces,
             full=lambda: ways.pieces(ways.with_key("discretization.integrator", "quasi_static"))),
        Skip(name="reassembly", forced="a Simulation of its own", lean=ways.tip,
             full=lambda: ways.tip(Simulation(scene))),
        Skip(name="responses_elsewhere", forced="responses.rows(all nodes)",
             lean=ways.tip, full=ways.everywhere),
        Skip(name="retraction", forced="motion.stages", lean=ways.tip, full=ways.retracted,
             allowed=BETWEEN),
        Skip(name="mass_and_damping", forced="dynamics.TissueSystem", lean=ways.tip,
             full=ways.weighed),
        Skip(name="full_fields", forced="insertion.fields.displacements",
             lean=lambda: touched(ways.insert()), full=lambda: touched(ways.insert(), fully=True)),
        Skip(name="pictures", forced="--out", lean=lambda: _imported("needlefem.cli.plan"),
             full=lambda: _imported("needlefem.cli.plan, pyvista, meshio"), allowed=0.0,
             seconds=children_seconds),
        Skip(name="further_insertions", forced="--search golden",
             lean=lambda: ways.planned("root"), full=lambda: ways.planned("golden"),
             allowed=scene.planning.interval_tolerance),
        Skip(name="repetition", forced="a Simulation for every insertion",
             lean=lambda: ways.planned("root"), full=ways.repeated),
    ]  # fmt: skip


def touched(insertion: Insertion, *, fully: bool = False) -> Any:
    """Return where the pieces of the path are in the last state, from contact or from the field."""
    last = insertion.states[-1]
    if not fully:
        return last.segment_displacement
    fields = displacements(insertion, range(len(insertion.states)))
    field = insertion.model.nodal(fields[:, -1])
    pieces = last.filled(insertion.segments)
    means = np.array([piece.weights @ field[piece.nodes] for piece in pieces])
    return means @ insertion.axis.frame.T


def _imported(modules: str) -> float:
    subprocess.run([sys.executable, "-c", f"import {modules}"], check=True)
    return 0.0
