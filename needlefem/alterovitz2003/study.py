"""The paper's method beside ours: placement, drift, noise, time.

A third method stands between the two: the paper's coupling and time steps, with forces spread
over the needle's thickness as ours are. Under refinement it must agree with ours.
"""

import time
from itertools import pairwise

import numpy as np

from needlefem._arrays import Floats
from needlefem._table import Table
from needlefem.alterovitz2003.plan import Drifted, Timed, drift, own_plan, paper_plan, refined
from needlefem.alterovitz2003.simulation import InTime, NodeSimulation
from needlefem.errors import SimulationError
from needlefem.insertion.simulation import Simulation
from needlefem.planning.planner import Planner
from needlefem.planning.result import Release
from needlefem.scene import Scene
from needlefem.studies.common import carry_out
from needlefem.studies.targets import draw_targets

PAPERS, SPREAD, OURS = "the paper's", "conforming, spread", "ours"
METHODS: dict[str, InTime | None] = {PAPERS: InTime(), SPREAD: InTime(spread=True), OURS: None}
REFINEMENTS = (1, 2, 4)
AGREED = 2e-4
"""Largest distance of placements, spread over the same kernel, on the finest mesh, m."""
HEIGHTS, APART = 30, (5e-6, 5e-5)
"""Heights, and their distances (m), at which the map is read."""


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
    """Make names of columns differ, which a record needs."""
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
    """Read the map from height to material point beside the planned height."""
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
        columns=("method", "heights apart (um)", "miss (cm)", "depth (cm)"),
        rows=rows,
    )


def _targets(scene: Scene) -> Table:
    """Plan for the targets that the case draws."""
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
    """Return the errors of the releases that are there, cm; NaN if there is none."""
    found = [100.0 * release.placement_error for release in releases if release is not None]
    return np.array(found or [np.nan])


def _times(scene: Scene) -> Table:
    """Time one insertion to the target's depth with a corrected and with new factors."""
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
