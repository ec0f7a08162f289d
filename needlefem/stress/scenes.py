"""Run random scenes, check the requirements, and report the results."""

import dataclasses
import json
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from needlefem._arrays import Floats, Points
from needlefem._table import Table
from needlefem.casefile.load import load_case
from needlefem.errors import NeedlefemError
from needlefem.fem.tissue_model import TissueModel
from needlefem.insertion.energy_balance import energy_terms
from needlefem.insertion.motion_schedule import motion_stages
from needlefem.insertion.result import Insertion, Status, validity
from needlefem.insertion.simulation import Simulation
from needlefem.insertion.state import TipPhase
from needlefem.io.records import energy_record, insertion_record
from needlefem.io.result_folder import to_json
from needlefem.planning.adaptive import PlanRequest, attempt_plan
from needlefem.planning.result import Plan, PlanStatus
from needlefem.scene import Scene
from needlefem.stress.draw import draw_case
from needlefem.stress.drawncase import DrawnCase
from needlefem.stress.inputfiles import write_drawn_case
from needlefem.stress.pool import Lost, WorkerLimits, work_through

ENERGY = 1e-9
"""Largest energy residual, and largest energy gain in a step, over the total absolute work."""
SAME_DEPTH = 1e-9
"""Largest difference of the last depth from the prescribed one, over the largest depth."""
INSIDE = 1e-7
"""Largest distance of a boundary point outside of the tissue by round-off, over its size."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Fault:
    """A violated requirement."""

    requirement: str
    detail: str

    def __str__(self) -> str:
        return f"{self.requirement}: {self.detail.strip().splitlines()[-1]}"


@dataclasses.dataclass(frozen=True, kw_only=True)
class SceneRun:
    """Result of a random scene.

    Parameters
    ----------
    number : int
    kinds : dict
        Random choices by aspect.
    status : str
        The insertion's or the plan's; ``refused`` with an error of the package's own, ``exception``
        with any other, ``lost`` without an answer.
    sentence : str
    faults : tuple of Fault
    symmetry : str
        ``met``, ``missed`` or ``several solutions``; empty where none was checked.
    seconds : float
        Processor time.
    """

    number: int
    kinds: dict[str, str]
    status: str
    sentence: str
    faults: tuple[Fault, ...] = ()
    symmetry: str = ""
    seconds: float = 0.0

    @property
    def complete(self) -> bool:
        """Whether the motion or the plan is complete."""
        return self.status in (Status.COMPLETED, PlanStatus.PLANNED)


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class SceneAnswer:
    """Final positions in a scene, which its symmetric images must share.

    Parameters
    ----------
    status : str
    sentence : str
    points : array, shape (n, 2), m
        Material point at the tip in the last state and resting places of seeds; for a plan the
        release point and where it places.
    path : array, shape (nstates, 2), m
        Material points at the tip in all states.
    depth : float, m
        Largest prescribed depth.
    """

    status: str
    sentence: str
    points: Points
    path: Points
    depth: float


def carry_out(
    scene: Scene, command: str, model: TissueModel | None = None
) -> tuple[SceneAnswer, Insertion | None]:
    """Run or plan a scene; return the final positions, and the insertion if there is one."""
    simulation = Simulation(scene, model)
    if command == "plan":
        assert scene.target is not None
        return _planned(
            scene, attempt_plan(simulation, PlanRequest(target=np.array(scene.target))).plan
        )
    simulation.check()
    insertion = simulation.move(simulation.entry_of_case())
    ends = [insertion.tips[-1:], *(seed.point[None] for seed in insertion.seeds)]
    answer = SceneAnswer(
        status=insertion.outcome.status,
        sentence=insertion.outcome.sentence,
        points=np.concatenate(ends),
        path=insertion.tips,
        depth=scene.motion.max_depth,
    )
    return answer, insertion


def _planned(scene: Scene, plan: Plan) -> tuple[SceneAnswer, Insertion | None]:
    points = np.zeros((0, scene.dim))
    if plan.best is not None:
        points = np.array([plan.best.release_point, plan.best.placed_at])
    answer = SceneAnswer(
        status=plan.status,
        sentence=plan.sentence,
        points=points,
        path=np.zeros((0, scene.dim)),
        depth=scene.motion.max_depth,
    )
    return answer, plan.insertion


def run_scene(seed: int, number: int) -> SceneRun:
    """Draw a scene, run it, and check all requirements."""
    begun = time.process_time()
    with tempfile.TemporaryDirectory(prefix="needlefem-stress-") as folder:
        found = check_case(draw_case(seed, number), number, Path(folder))
    return dataclasses.replace(found, seconds=time.process_time() - begun)


def check_case(case: DrawnCase, number: int, folder: Path) -> SceneRun:
    """Write a random case into a folder, run it and check it."""
    from needlefem.stress.symmetry import check_symmetry  # noqa: PLC0415  (it runs scenes, too)

    kinds = dict(case.kinds)
    try:
        scene = load_case(write_drawn_case(case, folder))
        simulation = Simulation(scene)
        answer, insertion = carry_out(scene, case.command, simulation.model)
        faults = list(faults_of(scene, case.command, insertion)) if insertion is not None else []
        symmetry = ""
        if case.check:
            symmetry, fault = check_symmetry(case, scene, simulation.model, answer)
            faults += [fault] if fault is not None else []
    except NeedlefemError as error:
        return SceneRun(number=number, kinds=kinds, status="refused", sentence=str(error))
    except Exception as error:  # the purpose is to report any exception
        fault = Fault(requirement="no exception", detail=traceback.format_exc())
        sentence = f"{type(error).__name__} at {_place(error)}: {error}"
        return SceneRun(
            number=number, kinds=kinds, status="exception", sentence=sentence, faults=(fault,)
        )
    return SceneRun(
        number=number,
        kinds=kinds,
        status=str(answer.status),
        sentence=answer.sentence,
        faults=tuple(faults),
        symmetry=symmetry,
    )


def _place(error: BaseException) -> str:
    """Return file and function of the innermost frame of the package in a traceback."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if "needlefem" in frame.filename] or frames
    return f"{Path(own[-1].filename).name}:{own[-1].name}"


def faults_of(scene: Scene, command: str, insertion: Insertion) -> Iterator[Fault]:
    """Yield the requirements that an insertion violates."""
    states = insertion.states
    energies = energy_terms(insertion)
    if not np.all(np.isfinite([*insertion.depths, *insertion.tips.ravel()])):
        yield Fault(requirement="finite numbers", detail="a depth or a tip is not finite")
        return
    if not insertion.outcome.sentence:
        yield Fault(requirement="a sentence", detail=f"none with {insertion.outcome.status}")
    if not energies.residual <= ENERGY:
        detail = f"{energies.residual:.2e} of the total absolute work"
        yield Fault(requirement="energy residual", detail=detail)
    if not energies.largest_energy_gain <= ENERGY:
        detail = f"a step creates {energies.largest_energy_gain:.2e} of the total absolute work"
        yield Fault(requirement="energy created", detail=detail)
    if command == "run" and insertion.outcome.status is Status.COMPLETED:
        wanted = motion_stages(scene.motion)[-1].end
        off = states[-1].depth - wanted
        if abs(off) > SAME_DEPTH * scene.motion.max_depth:
            detail = f"the last depth is {states[-1].depth:.9g} m, {off:+.2e} m off {wanted:.9g} m"
            yield Fault(requirement="last depth", detail=detail)
    yield from _outside(insertion)
    json.loads(to_json(insertion_record(insertion) | {"energy": energy_record(energies)}))
    validity(insertion, len(states) - 1)


def _outside(insertion: Insertion) -> Iterator[Fault]:
    """Yield a fault for tips and seeds outside of the tissue."""
    model = insertion.model
    size = float(np.max(np.ptp(model.mesh.p, axis=1)))
    within = [state for state in insertion.states if state.tip_phase is not TipPhase.OUTSIDE]
    places = {"tip": np.array([state.tip for state in within]).reshape(-1, model.dim)}
    seeds = [seed.point for seed in insertion.seeds if seed.inside]
    places["seed"] = np.array(seeds).reshape(-1, model.dim)
    for name, points in places.items():
        off = _distance_outside(model, points)
        if len(off) and off.max() > INSIDE * size:
            worst = int(np.argmax(off))
            where = ", ".join(f"{x:.6g}" for x in points[worst])
            detail = f"{name} {worst} at ({where}) m lies {off.max():.2e} m outside the tissue"
            yield Fault(requirement="inside the tissue", detail=detail)


def _distance_outside(model: TissueModel, points: Points) -> Floats:
    """Return the distance of each point from the mesh; 0 inside, m."""
    found = np.zeros(len(points))
    if not len(points):
        return found
    outside = np.flatnonzero(model.interpolation.locator.find(points)[0] < 0)
    mesh = model.mesh
    ends = mesh.p[:, mesh.facets[:, mesh.boundary_facets()]]
    begin, along = ends[:, 0].T, (ends[:, 1] - ends[:, 0]).T
    for number in outside:
        away = points[number] - begin
        share = np.clip(np.sum(away * along, axis=1) / np.sum(along**2, axis=1), 0.0, 1.0)
        found[number] = np.linalg.norm(away - share[:, None] * along, axis=1).min()
    return found


# Many random scenes, and a report of their results.


COUNT = 2000
"""Default number of scenes."""
LIMITS = WorkerLimits(seconds=120.0, clock=600.0, memory=4e9)
"""Limits of a scene and its symmetric image together: a minute of processor time each."""
COMPLETE = 0.95
"""Smallest share of scenes with a complete motion or plan."""
TELL = 30.0
"""Seconds between progress messages."""


def run_scenes(
    seed: int, numbers: Sequence[int], processes: int, tell: Callable[[str], None]
) -> list[SceneRun]:
    """Run the scenes with given numbers; `tell` is called with progress messages.

    Fewer are returned where Ctrl-C or a signal stops the run.
    """
    work = partial(run_scene, seed)
    runs: list[SceneRun] = []
    told = time.monotonic()
    try:
        for number, answer in work_through(work, numbers, processes=processes, limits=LIMITS):
            runs.append(_lost(seed, number, answer) if isinstance(answer, Lost) else answer)
            if time.monotonic() - told > TELL:
                told = time.monotonic()
                faulty = sum(bool(run.faults) for run in runs)
                tell(f"{len(runs)} of {len(numbers)} scenes, {faulty} with a fault")
    except KeyboardInterrupt as stop:  # the results so far are reported
        tell(str(stop) or "interrupted")
    return sorted(runs, key=lambda run: run.number)


def _lost(seed: int, number: int, lost: Lost) -> SceneRun:
    fault = Fault(requirement="an answer", detail=lost.reason)
    kinds = dict(draw_case(seed, number).kinds)
    return SceneRun(
        number=number, kinds=kinds, status="lost", sentence=lost.reason, faults=(fault,)
    )


def write_scene(seed: int, number: int, folder: Path) -> Path:
    """Write a scene as a case file."""
    case = draw_case(seed, number)
    return write_drawn_case(
        case, folder, f"scene {number} of seed {seed}: needlefem {case.command}"
    )


def command(kind: str, seed: int, number: int) -> str:
    """Return the command that runs one scene (or input) alone."""
    return f"needlefem verify --stress {kind} --seed {seed} --only {number}"


def passed(runs: Sequence[SceneRun], asked: int) -> bool:
    """Return whether all requested scenes were run without faults and enough are complete."""
    complete = sum(run.complete for run in runs)
    faulty = any(run.faults for run in runs)
    return len(runs) == asked and complete >= COMPLETE * asked and not faulty


def summary(runs: Sequence[SceneRun], asked: int) -> Table:
    """Return the table of statuses and of random choices, each with its faults."""
    rows = [*_rows("status", runs, lambda run: run.status)]
    rows += _rows("symmetry checked", [run for run in runs if run.symmetry], _symmetry)
    aspects = sorted({aspect for run in runs for aspect in run.kinds})
    for aspect in aspects:
        having = [run for run in runs if aspect in run.kinds]
        rows += _rows(aspect, having, partial(_kind, aspect))
    complete = sum(run.complete for run in runs)
    seconds = sum(run.seconds for run in runs)
    faulty = sum(bool(run.faults) for run in runs)
    note = (
        f"{len(runs)} of {asked} scenes run, {complete} complete "
        f"({100.0 * complete / max(len(runs), 1):.1f} %), {faulty} with a fault, "
        f"{seconds:.0f} s of processor time"
    )
    return Table(
        title="random scenes",
        columns=("aspect", "kind", "scenes", "complete", "faults"),
        rows=rows,
        passed=passed(runs, asked),
        note=note,
    )


def _kind(aspect: str, run: SceneRun) -> str:
    return run.kinds[aspect]


def _symmetry(run: SceneRun) -> str:
    return f"{run.kinds['symmetry']}: {run.symmetry}"


def _rows(
    aspect: str, runs: Iterable[SceneRun], label: Callable[[SceneRun], str]
) -> list[list[str]]:
    runs = list(runs)
    counts = Counter(label(run) for run in runs)
    rows = []
    for name, count in sorted(counts.items(), key=lambda item: (-item[1], item[0])):
        of_name = [run for run in runs if label(run) == name]
        complete = sum(run.complete for run in of_name)
        faulty = sum(bool(run.faults) for run in of_name)
        rows.append([aspect, name, str(count), str(complete), str(faulty)])
    return rows


def listing(seed: int, runs: Sequence[SceneRun]) -> list[str]:
    """Return lines about each scene that has a fault or is not complete."""
    lines = []
    for run in runs:
        if run.complete and not run.faults:
            continue
        what = "; ".join(map(str, run.faults))
        said = run.sentence.splitlines()[0] if run.sentence else ""
        lines.append(f"scene {run.number} [{run.status}] {what or said}")
        lines.append(f"    {command('scenes', seed, run.number)}")
    return lines


def record(seed: int, runs: Sequence[SceneRun], asked: int) -> dict[str, object]:
    """Return all results for JSON."""
    return {
        "seed": seed,
        "asked": asked,
        "run": len(runs),
        "passed": passed(runs, asked),
        "scenes": [
            {
                "number": run.number,
                "status": run.status,
                "sentence": run.sentence,
                "faults": [vars(fault) for fault in run.faults],
                "symmetry": run.symmetry,
                "kinds": run.kinds,
                "seconds": run.seconds,
                "command": command("scenes", seed, run.number),
            }
            for run in runs
        ],
    }
