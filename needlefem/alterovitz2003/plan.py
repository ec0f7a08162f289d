"""A plan by the method of R. Alterovitz et al., IROS 2003, compared with that of needlefem.

The method has nodes on the needle, lumped mass, Newmark's steps of 1/30 s, and golden section over
the insertion height.
"""

import dataclasses
import time
from itertools import pairwise

import numpy as np

from needlefem._arrays import Floats, Vector
from needlefem._table import Table
from needlefem.alterovitz2003.simulation import InTime, NodeSimulation
from needlefem.errors import CaseError, SimulationError
from needlefem.insertion.cut_path import TipPoint
from needlefem.insertion.result import Insertion
from needlefem.insertion.simulation import Simulation, Watch, discretised
from needlefem.planning.planner import Planner, carry_out
from needlefem.planning.reading import InsertionReader
from needlefem.planning.result import Evidence, Plan, Release, with_headline
from needlefem.scene import BoxMesh, Scene, contour_sizes, vary
from needlefem.studies.targets import draw_targets

SKIPPED = {
    "retraction": "elastic tissue and the first seed: it comes to rest where it was released",
    "reassembly": "matrices change around moved nodes only, as a correction of one factor",
}
NOT_MADE = dict.fromkeys(("estimate", "energy", "validity"), "not made for the paper's method")
DRIFT_REFINEMENTS = (1, 2)


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Timed:
    """A plan with its cost.

    Parameters
    ----------
    name : str
    plan : Plan
    seconds : float
        Processor time of model and search, without checks and evidence.
    steps : int
        Number of time steps; 0 for path following.
    """

    name: str
    plan: Plan
    seconds: float
    steps: int = 0


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Drifted:
    """Final position of an unplanned seed on one mesh.

    Parameters
    ----------
    refined : int
        Refinement of the mesh relative to that of the case.
    status : str
        Status of the insertion.
    placed_at : array, shape (dim,), m, or None
        None if the tip never was at the target.
    punctured_at : float, m, or None
        Depth at which the skin was cut.
    """

    refined: int
    status: str
    placed_at: Vector | None
    punctured_at: float | None


def paper_plan(
    scene: Scene, numbers: InTime | None = None, target: Vector | None = None,
    *, watch: Watch | None = None,
) -> Timed:  # fmt: skip
    """Return the plan by the paper's method.

    Parameters
    ----------
    scene : Scene
        With P1 triangles in 2D.
    numbers : InTime, optional
        By default those of the paper.
    target : array, shape (dim,), m, optional
    watch : callable, optional

    Raises
    ------
    CaseError
        The scene is not valid, has another element, or no target in the tissue.
    CheckFailedError
        The discretisation fails a check.
    """
    begin = time.process_time()
    simulation = NodeSimulation(scene, numbers, watch=watch)
    planner = Planner(simulation, _target(scene, target))
    model = time.process_time()
    checks = simulation.check(planner.entry)
    ready = time.process_time()
    found = planner.plan("golden")
    end = time.process_time()
    evidence = Evidence(
        preflight=checks,
        energy=None,
        validity=None,
        missing=NOT_MADE,
        discretisation=discretised(simulation, planner.entry),
        warnings=(*simulation.warnings, *_warnings(simulation)),
        skipped=SKIPPED,
        reasons=simulation.resolved.reasons,
        timings={"model": model - begin, "preflight": ready - model, "search": end - ready},
    )
    name = "conforming, needle as thick as ours" if simulation.numbers.spread else "the paper's"
    return Timed(
        name=name,
        plan=with_headline(found, evidence),
        seconds=model - begin + end - ready,
        steps=simulation.time_steps,
    )


def own_plan(scene: Scene, search: str = "root", target: Vector | None = None) -> Timed:
    """Return the plan by path following and a search, for comparison."""
    begin = time.process_time()
    planner = Planner(Simulation(scene), _target(scene, target))
    found = planner.plan(search)
    return Timed(name=f"ours, {search}", plan=found, seconds=time.process_time() - begin)


def _target(scene: Scene, target: Vector | None) -> Vector:
    chosen = target if target is not None else scene.target
    if chosen is None:
        raise CaseError("target.point", "missing", "give a target to plan for")
    return np.asarray(chosen, dtype=float)


def _warnings(simulation: NodeSimulation) -> list[str]:
    found = []
    if not simulation.numbers.spread:
        found.append("forces act on nodes: the result does not converge under refinement")
    if simulation.waited:
        found.append(
            f"in {simulation.waited} of {simulation.time_steps} steps the tip could not advance, "
            "because no node could follow it"
        )
    return found


def refined(scene: Scene, times: int) -> Scene:
    """Return the scene on a mesh whose elements are smaller by a factor.

    Raises
    ------
    CaseError
        The mesh is not a box.
    """
    if not isinstance(scene.mesh, BoxMesh):
        raise CaseError("mesh", "only boxes are refined here", "compare on meshes of your own")
    wanted = scene.mesh
    return vary(
        scene,
        {
            "mesh.divisions": tuple(times * n for n in wanted.divisions),
            "mesh.refine.corridor_size": wanted.refine.corridor_size / times,
            **contour_sizes(scene, 1.0 / times),
        },
    )


def drift(
    scene: Scene, numbers: InTime | None, refinements: tuple[int, ...] = DRIFT_REFINEMENTS
) -> list[Drifted]:
    """Return the final position of the case's unplanned seed on finer meshes.

    Parameters
    ----------
    scene : Scene
    numbers : InTime or None
        None selects path following.
    refinements : tuple of int
    """
    found = []
    for times in refinements:
        finer = refined(scene, times)
        simulation = Simulation(finer) if numbers is None else NodeSimulation(finer, numbers)
        reach, insertion = unplanned(simulation, _target(scene, None))
        found.append(
            Drifted(
                refined=times,
                status=str(insertion.outcome.status),
                placed_at=None if reach is None else reach.point,
                punctured_at=insertion.puncture_depth,
            )
        )
    return found


def unplanned(simulation: Simulation, target: Vector) -> tuple[TipPoint | None, Insertion]:
    """Return the material at the tip when it is at the target in space, and how it was reached.

    The result is None if the insertion ended before.
    """
    entry = simulation.entry_through(target)
    depth = float(simulation.direction @ (target - entry.point))
    insertion = simulation.insert(entry, lambda state: state.depth > depth + 2e-3)
    return InsertionReader(insertion, target).at_depth(depth).reach, insertion


# Comparison of the paper's method with needlefem: placement, drift, noise, time. A third method has
# the coupling and time steps of the paper, with forces distributed over the needle's thickness.
# Under refinement its results must agree with those of needlefem.


PAPERS, SPREAD, OURS = "the paper's", "conforming, spread", "ours"
METHODS: dict[str, InTime | None] = {PAPERS: InTime(), SPREAD: InTime(spread=True), OURS: None}
REFINEMENTS = (1, 2, 4)
AGREED = 2e-4
"""Largest distance of placements with the same tip kernel on the finest mesh, m."""
HEIGHTS, APART = 30, (5e-6, 5e-5)
"""Number of heights, and their distances (m)."""


def study(scene: Scene, other: Scene | None = None) -> list[Table]:
    """Return plans, drift, noise and times; plans are carried out on the other case, if given."""
    plans = [
        paper_plan(scene, InTime()),
        paper_plan(scene, InTime(spread=True)),
        own_plan(scene, "golden"),
        own_plan(scene),
    ]
    height = plans[-1].plan.solution.height
    tables = [_placements(scene, other, plans), _drifts(scene), _noise(scene, height)]
    return [*tables, _times(scene), *([_targets(scene)] if scene.targets else [])]


def _placements(scene: Scene, other: Scene | None, plans: list[Timed]) -> Table:
    rows = []
    for one in plans:
        plan = one.plan
        row = [one.name, *_point(plan.unplanned, placed=True), *_point(plan.depth_only)]
        row += [_error(plan.depth_only), *_point(plan.best), _error(plan.best)]
        row += [str(plan.insertions), str(one.steps or "none"), f"{one.seconds:.2f}"]
        if other is not None:
            reach = carry_out(other, plan)
            target = np.array(scene.target)
            missed = None if reach is None else float(np.linalg.norm(reach.point - target))
            row.append("not reached" if missed is None else f"{100.0 * missed:.4f}")
        rows.append(row)
    columns = ["method", "unplanned rests at (cm)", "depth only (cm)", "error (cm)"]
    columns += ["planned release (cm)", "error (cm)", "insertions", "time steps", "processor s"]
    if other is not None:
        columns.append(f"error on '{other.title}' (cm)")
    return Table(title="plans of one target", columns=_different(columns), rows=rows)


def _different(names: list[str]) -> tuple[str, ...]:
    """Return unique column names, as a record needs them."""
    return tuple(f"{name} " if name in names[:i] else name for i, name in enumerate(names))


def _point(release: Release | None, *, placed: bool = False) -> list[str]:
    if release is None:
        return ["never"]
    point = release.placed_at if placed else release.release_point
    return [", ".join(f"{100.0 * float(x):.3f}" for x in point)]


def _error(release: Release | None) -> str:
    return "" if release is None else f"{100.0 * release.placement_error:.2g}"


def _drifts(scene: Scene) -> Table:
    found = {name: drift(scene, numbers, REFINEMENTS) for name, numbers in METHODS.items()}
    apart = [_apart(a, b) for a, b in zip(found[SPREAD], found[OURS], strict=True)]
    rows = []
    for name, points in found.items():
        for number, one in enumerate(points):
            cut = "never" if one.punctured_at is None else f"{100.0 * one.punctured_at:.4f}"
            row = [name, one.refined, cut, _where(one), _moved(points, number)]
            rows.append([*row, f"{100.0 * apart[number]:.4f}" if name == SPREAD else ""])
    falls = all(later < earlier for earlier, later in pairwise(apart))
    return Table(
        title="where the unplanned seed ends, on finer meshes",
        columns=(
            "method", "refined", "skin cut at (cm)", "rests at (cm)", "moved (cm)",
            "from ours (cm)",
        ),
        rows=rows,
        passed=bool(falls and apart[-1] <= AGREED),
        note=f"from ours: must fall, to at most {100.0 * AGREED:g} cm",
    )  # fmt: skip


def _where(one: Drifted) -> str:
    if one.placed_at is None:
        return one.status
    return ", ".join(f"{100.0 * float(x):.4f}" for x in one.placed_at)


def _moved(points: list[Drifted], number: int) -> str:
    here, before = points[number].placed_at, points[number - 1].placed_at
    if not number or here is None or before is None:
        return ""
    return f"{100.0 * float(np.linalg.norm(here - before)):.4f}"


def _apart(one: Drifted, other: Drifted) -> float:
    if one.placed_at is None or other.placed_at is None:
        return np.inf
    return float(np.linalg.norm(one.placed_at - other.placed_at))


def _noise(scene: Scene, start: Floats) -> Table:
    """Evaluate the material point as a function of the height around the planned one."""
    rows = []
    target = np.array(scene.target)
    for name, numbers in METHODS.items():
        simulation = Simulation(scene) if numbers is None else NodeSimulation(scene, numbers)
        planner = Planner(simulation, target)
        for apart in APART:
            values = []
            for number in range(HEIGHTS):
                reading = planner.read(start + number * apart).level()
                reach = reading.reach
                if reach is None:
                    raise SimulationError(f"{name}: {reading.sentence}")
                values.append([float((reach.point - target) @ planner.laterals[0]), reach.depth])
            second = np.abs(np.diff(np.array(values), 2, axis=0)).max(axis=0)
            rows.append([name, 1e6 * apart, 100.0 * float(second[0]), 100.0 * float(second[1])])
    return Table(
        title=f"noise: largest second difference over {HEIGHTS} heights beside the planned one",
        columns=("method", "increment (um)", "lateral error (cm)", "depth (cm)"),
        rows=rows,
    )


def _targets(scene: Scene) -> Table:
    """Plan for the targets of the case."""
    targets = draw_targets(scene)
    rows = []
    found = {
        PAPERS: [paper_plan(scene, target=target) for target in targets],
        OURS: [own_plan(scene, target=target) for target in targets],
    }
    for name, plans in found.items():
        errors = _missed([one.plan.best for one in plans])
        naive = _missed([one.plan.unplanned for one in plans])
        spent = float(np.mean([one.seconds for one in plans]))
        shown = [f"{values.mean():.2g} ({values.std(ddof=1):.1g})" for values in (naive, errors)]
        rows.append([name, *shown, float(errors.max()), len(plans) - len(errors), spent])
    columns = (
        "unplanned, mean (SD) (cm)",
        "planned, mean (SD) (cm)",
        "worst (cm)",
        "no plan",
        "processor s",
    )
    return Table(title=f"{len(targets)} targets", columns=("method", *columns), rows=rows)


def _missed(releases: list[Release | None]) -> Floats:
    """Return the errors of the existing releases, cm; NaN if there is none."""
    found = [100.0 * release.placement_error for release in releases if release is not None]
    return np.array(found or [np.nan])


def _times(scene: Scene) -> Table:
    """Time one insertion to the target's depth with a corrected factor and with new factors."""
    rows = []
    for times in REFINEMENTS[:2]:
        finer = refined(scene, times)
        for name, numbers in {
            "the paper's, one factor corrected": InTime(),
            "the paper's, factorised anew": InTime(refactor=True),
            "ours": None,
        }.items():
            simulation = Simulation(finer) if numbers is None else NodeSimulation(finer, numbers)
            first, second = _insert(simulation), _insert(simulation)
            steps = simulation.time_steps // 2 if isinstance(simulation, NodeSimulation) else "none"
            unknowns = len(simulation.model.free_dofs)
            rows.append([unknowns, name, steps, first, second])
    return Table(
        title="processor seconds of an insertion to the target's depth, the first and the next",
        columns=("unknowns", "method", "time steps", "first (s)", "next (s)"),
        rows=rows,
    )


def _insert(simulation: Simulation) -> float:
    entry = simulation.entry_through(np.array(simulation.scene.target))
    depth = float(simulation.direction @ (np.array(simulation.scene.target) - entry.point))
    simulation.forget()
    begin = time.process_time()
    simulation.insert(entry, lambda state: state.depth > depth)
    return time.process_time() - begin
