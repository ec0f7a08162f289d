"""Cost of a plan for meshes of increasing size with the same elements along the needle."""

import dataclasses
import json
import resource
import subprocess
import sys
import time
from collections.abc import Sequence

import numpy as np

from needlefem import build_model, load_case
from needlefem._arrays import Floats, SkfemMesh
from needlefem.bench import alone, median, processor_seconds
from needlefem.errors import CaseError, SimulationError
from needlefem.fem import SuperLUFactor
from needlefem.insertion import Simulation
from needlefem.mesh import cell_sizes, name_faces, name_regions
from needlefem.planning import Planner
from needlefem.plotting import ChartLine, loglog
from needlefem.scene import Scene, build_mesh, resolve
from needlefem.studies import Table

SIZES = (20_000, 200_000, 1_000_000)
"""Approximate numbers of unknowns."""
ROUNDS = 5
SLOWER, TIME_SLOPE, MEMORY_SLOPE, FACTORISATIONS = 2.0, 1.35, 1.15, 6.0
"""Largest ratio of an insertion's time to that of the smallest mesh, largest slopes of a cold
plan's time and memory over the unknowns, and most factorisations that it may take at the end."""
CAREFUL, CLOSE = 0.5, 0.97
"""Share of the missing unknowns in a round of refinement, as neighbours are refined too; share of
the requested unknowns at which a mesh is large enough."""


@dataclasses.dataclass(frozen=True)
class Measured:
    """One size: processor time in seconds, memory in MB beyond that of the imports."""

    unknowns: int
    assembly: float
    factor: float
    unordered: float
    responses_and_plan: float
    insertion: float
    solves: int
    rows: int
    memory: float
    release: list[float]

    @property
    def cold(self) -> float:
        """Factorisation, responses and plan."""
        return self.factor + self.responses_and_plan


def run(case: str) -> Table:
    """Measure every size in a process of its own."""
    found = [_in_process(case, size) for size in SIZES]
    first, last = found[0], found[-1]
    slopes = {
        "time": _slope(found, [one.cold for one in found]),
        "memory": _slope(found, [one.memory for one in found]),
    }
    slower = max(one.insertion for one in found) / first.insertion
    taken = last.cold / last.factor
    rows = [
        [
            one.unknowns, one.assembly, one.factor, one.unordered, one.responses_and_plan,
            one.cold / one.factor, 1e3 * one.insertion, one.insertion / first.insertion,
            one.rows, one.solves, round(one.memory),
        ]
        for one in found
    ]  # fmt: skip
    apart = max(float(np.abs(np.subtract(one.release, last.release)).max()) for one in found)
    return Table(
        title="a cold plan as the mesh grows around the same corridor, processor time",
        columns=("unknowns", "K (s)", "factor (s)", "by unknowns (s)", "responses and plan (s)",
                 "factor to plan, in factors", "insertion (ms)", "ratio", "rows", "solves", "MB"),
        rows=rows,
        passed=slower <= SLOWER
        and slopes["time"] <= TIME_SLOPE
        and slopes["memory"] <= MEMORY_SLOPE
        and taken <= FACTORISATIONS,
        note=f"slopes over the unknowns: time of factor, responses and plan {slopes['time']:.2f} "
        f"(may be {TIME_SLOPE:g}), memory {slopes['memory']:.2f} (may be {MEMORY_SLOPE:g}); "
        f"insertion: responses known, may be {SLOWER:g} times the first; the last may take "
        f"{FACTORISATIONS:g} factors; rows: of the compliance; solves: with the whole factor; "
        f"MB: beyond imports; by unknowns: ordered by SuperLU itself; release points within "
        f"{1e3 * apart:.2g} mm of the last",
        summary={"slopes": slopes, "slower": slower, "factorisations": taken},
        charts={"cost over unknowns": _chart(found)},
    )  # fmt: skip


def _chart(found: Sequence[Measured]) -> str:
    unknowns = [float(one.unknowns) for one in found]
    curves = {
        "factor": [one.factor for one in found],
        "responses and plan": [one.responses_and_plan for one in found],
        "insertion": [one.insertion for one in found],
    }
    lines = [ChartLine(name, unknowns, values, []) for name, values in curves.items()]
    return loglog("a plan as the mesh grows around the corridor", "unknowns", "seconds", lines)


def _slope(found: Sequence[Measured], values: Sequence[float]) -> float:
    """Return the slope in logarithms between the smallest and the largest mesh."""
    return float(np.log(values[-1] / values[0]) / np.log(found[-1].unknowns / found[0].unknowns))


def _in_process(case: str, size: int) -> Measured:
    code = "import sys; from verification.benchmarks.scaling import report; report(*sys.argv[1:])"
    command = [sys.executable, "-c", code, case, str(size)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise SimulationError(f"the mesh of {size} unknowns failed: {done.stderr.strip()[-200:]}")
    return Measured(**json.loads(done.stdout))


def report(case: str, size: str) -> None:
    """Print the cost of one size as JSON."""
    sys.stdout.write(json.dumps(dataclasses.asdict(measure(load_case(case), int(size)))))


def measure(scene: Scene, size: int) -> Measured:
    """Measure one size in this process."""
    if scene.target is None:
        raise CaseError("target.point", "missing", "the benchmark plans for it")
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    scene = resolve(scene).scene
    mesh = grown(scene, size)
    clock = [time.process_time()]
    model = build_model(scene, mesh)
    kept: list[object] = [model.stiffness.matrix]
    clock.append(time.process_time())
    kept.append(model.factor)
    clock.append(time.process_time())
    simulation = Simulation(scene, model)
    found = Planner(simulation, np.array(scene.target)).plan()
    clock.append(time.process_time())
    if found.best is None:
        raise SimulationError(f"no plan on {model.ndofs} unknowns: {found.sentence}")
    entry = simulation.entry_through(np.array(scene.target))
    spent = processor_seconds(lambda: alone(simulation, entry), ROUNDS)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assembly, factor, plan = np.diff(clock)
    start = time.process_time()
    system, _ = model.stiffness.system(model.free_dofs)
    kept.append(SuperLUFactor(system, definite=model.element.definite))
    unordered = time.process_time() - start
    return Measured(
        unknowns=len(model.free_dofs),
        assembly=float(assembly),
        factor=float(factor),
        unordered=unordered,
        responses_and_plan=float(plan),
        insertion=median(spent),
        solves=simulation.responses.solves,
        rows=simulation.responses.size,
        memory=(peak - before) / 1024.0,
        release=[float(x) for x in found.best.release_point],
    )


def grown(scene: Scene, size: int) -> SkfemMesh:
    """Return the scene's mesh, refined away from the needle until it has so many unknowns."""
    mesh = build_mesh(scene)
    contours = {n: r.contour for n, r in scene.regions.items() if r.group is None}
    ndofs = build_model(scene, mesh).ndofs
    gain = 3.0 * ndofs / mesh.nelements  # unknowns that cutting a cell brings; then as measured
    while ndofs <= CLOSE * size:
        outside = np.flatnonzero(_beside(scene, mesh) > _room(scene))
        if not outside.size:
            break
        wanted = int(CAREFUL * (size - ndofs) / gain) + 1
        largest = outside[np.argsort(-cell_sizes(mesh)[outside])][:wanted]
        finer = type(mesh)(mesh.p, mesh.t).refined(np.sort(largest))  # names go with refinement
        mesh = name_faces(name_regions(finer, contours), scene.axes)
        before, ndofs = ndofs, build_model(scene, mesh).ndofs
        gain = max(gain, (ndofs - before) / len(largest))
    return mesh


def _room(scene: Scene) -> float:
    needle = scene.needle
    return 3.0 * needle.tip_radius + max(abs(height) for height in scene.planning.offset_range)


def _beside(scene: Scene, mesh: SkfemMesh) -> Floats:
    """Return how far every cell's centroid is beside the needle's line through the target, m."""
    direction, target = np.array(scene.motion.direction), np.array(scene.target)
    apart = mesh.p[:, mesh.t].mean(axis=1).T - target
    across = apart - np.outer(apart @ direction, direction)
    found: Floats = np.linalg.norm(across, axis=1)
    return found
