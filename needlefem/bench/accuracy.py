"""Error of a plan against processor time for elements, sizes, path spacings and integrators."""

import dataclasses
import math
import time
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from needlefem._arrays import Vector
from needlefem._table import Table
from needlefem.bench.timing import median
from needlefem.casefile.load import load_case
from needlefem.checks.work_precision import Point, front
from needlefem.elements import CATALOGUE
from needlefem.errors import CaseError
from needlefem.planning.adaptive import ReferenceSolution
from needlefem.planning.plan import plan
from needlefem.planning.result import Plan, PlanStatus
from needlefem.plotting.charts import ChartLine, loglog
from needlefem.scene import BoxMesh, Scene, contour_sizes, vary
from needlefem.scene.resolve import resolve, with_element

ROUNDS = 3
LONG = 2.0
"""Seconds of processor time after which a plan is not repeated."""
ENOUGH = 1e-4
"""Largest allowed error of the case's own discretisation, m."""
TWICE = 2.0
"""Factor in time by which another discretisation must be faster, and as accurate, to be better."""
OWN = "the case's own"
"""Name of the entrant with the unchanged case."""


@dataclasses.dataclass(frozen=True, eq=False)
class Entrant:
    """A variant of a plan: its family in the chart, its name, and the function that plans."""

    family: str
    name: str
    go: Callable[[], Plan]


def run(case: str) -> Table:
    """Plan on many discretisations; measure time, and error on the reference tissue."""
    scene = load_case(case)
    return race(scene, entrants(scene), ReferenceSolution(scene, _target(scene)))


def race(scene: Scene, entered: Sequence[Entrant], exact: ReferenceSolution) -> Table:
    """Return error and time of entrants; the first one is the unchanged case."""
    found = {entrant: _timed(entrant.go) for entrant in entered}
    plans = [made for made, _ in found.values()]
    errors = exact.errors(plans)
    points = [
        Point(entrant.name, place, made.level.model.ndofs, seconds, error)
        for place, ((entrant, (made, seconds)), error) in enumerate(
            zip(found.items(), errors, strict=True)
        )
    ]
    best, own = front(points), points[0]
    beaten = [
        p.entrant for p in points if TWICE * p.seconds <= own.seconds and p.error <= own.error
    ]
    rows = [
        [entrant.family, p.entrant, p.unknowns, 1e3 * p.error, _said(made), p.seconds,
         p.seconds / own.seconds, str(made.status), "*" if p in best else ""]
        for entrant, made, p in zip(entered, plans, points, strict=True)
    ]  # fmt: skip
    verdict = "; ".join(beaten) or "none"
    point = ", ".join(f"{100.0 * x:.6f}" for x in exact.release)
    return Table(
        title=f"{scene.title}: error of the placement against seconds of the whole plan",
        columns=("", "discretization", "dofs", "error (mm)", "estimate (mm)", "CPU (s)",
                 "over own", "status", "front"),
        rows=rows,
        passed=own.error <= ENOUGH and not beaten,
        note=f"exact: release at ({point}) cm on {exact.unknowns} unknowns; *: none is both faster "
        f"and more accurate; twice as fast as the case's own and as accurate: {verdict}",
        summary={"error": own.error, "beaten": len(beaten)},
        charts={f"{scene.title}: error and seconds": _chart(entered, points, best)},
    )  # fmt: skip


def entrants(scene: Scene) -> list[Entrant]:
    """Return the case's own discretisation, followed by all alternatives."""
    if not isinstance(scene.mesh, BoxMesh):
        raise CaseError("mesh.file", "a mesh from a file has the sizes it has", "take a box")
    element = resolve(scene).scene.discretization.element
    found = [Entrant(OWN, element, _planned(scene, {}))]
    for name in CATALOGUE:
        for label, changes in sizes(scene.mesh, scene).items():
            found.append(Entrant(name, f"{name}, {label}", _planned(scene, changes, name)))
    for label, changes in steps(resolve(scene).scene).items():
        found.append(Entrant("steps, regimes", label, _planned(scene, changes)))
    for accuracy in (1e-4, 2e-5):
        label = f"accuracy = {1e3 * accuracy:g} mm"
        changes = {"planning.accuracy": accuracy}
        found.append(Entrant("chosen", label, _planned(scene, changes)))
    return found


def sizes(mesh: BoxMesh, scene: Scene | None = None) -> dict[str, dict[str, object]]:
    """Return changes of a scene's mesh: coarser, unchanged, finer where refined, and elsewhere.

    Without refinement all sizes change. If the scene is given, those of its regions change too.
    """
    refine = mesh.refine
    refined = refine.corridor_size > 0.0 or refine.contour_size > 0.0
    found: dict[str, dict[str, object]] = {}
    for label, factor in (("as it is", 1.0), ("x 2", 2.0), ("x 1/2", 0.5)):
        if not refined:
            found[label] = _divided(mesh, factor)
            continue
        changes = {
            "mesh.refine.corridor_size": factor * refine.corridor_size,
            "mesh.refine.contour_size": factor * refine.contour_size,
            **({} if scene is None else contour_sizes(scene, factor)),
        }
        name = label if factor == 1.0 else f"refined {label}"
        found[name] = changes
        found[f"{name}, elsewhere x 2".removeprefix("as it is, ")] = changes | _divided(mesh, 2.0)
    return found


def _divided(mesh: BoxMesh, factor: float) -> dict[str, object]:
    return {"mesh.divisions": tuple(max(1, round(n / factor)) for n in mesh.divisions)}


def steps(scene: Scene) -> dict[str, dict[str, object]]:
    """Return changes of a resolved scene's path spacing, kernel and integrator."""
    numbers = scene.discretization
    spacing, points = numbers.path_spacing, numbers.tip_quadrature_points
    found: dict[str, dict[str, object]] = {
        f"path spacing x {factor:g}": {"discretization.path_spacing": factor * spacing}
        for factor in (2.0, 0.5)
    }
    for factor in (0.25, 4.0):
        found[f"kernel points x {factor:g}"] = {
            "discretization.tip_quadrature_points": round(factor * points)
        }
    for regime in ("quasi_static", "generalized_alpha"):
        found[regime] = {"discretization.integrator": regime, "planning.estimate": False}
    return found


def _planned(
    scene: Scene, changes: Mapping[str, object], element: str | None = None
) -> Callable[[], Plan]:
    varied = vary(scene if element is None else with_element(scene, element), changes)
    return lambda: plan(varied)


def _timed(go: Callable[[], Plan]) -> tuple[Plan, float]:
    """Return a plan and its median processor time in seconds."""
    seconds: list[float] = []
    while len(seconds) < ROUNDS and sum(seconds) < LONG:
        start = time.process_time()
        made = go()
        seconds.append(time.process_time() - start)
    return made, median(seconds)


def _target(scene: Scene) -> Vector:
    if scene.target is None:
        raise CaseError("target.point", "missing", "the benchmark plans for it")
    return np.array(scene.target)


def _said(made: Plan) -> object:
    known = None if made.evidence is None else made.evidence.estimate
    return "" if known is None or made.status is not PlanStatus.PLANNED else 1e3 * known.error


def _chart(entered: Sequence[Entrant], points: Sequence[Point], best: set[Point]) -> str:
    lines = []
    for family in dict.fromkeys(entrant.family for entrant in entered):
        own = [
            p for e, p in zip(entered, points, strict=True)
            if e.family == family and math.isfinite(p.error)
        ]  # fmt: skip
        own.sort(key=lambda p: p.seconds)
        ringed = [place for place, p in enumerate(own) if p in best]
        if own:
            lines.append(
                ChartLine(family, [p.seconds for p in own], [p.error for p in own], ringed)
            )
    return loglog("placement (ringed: beaten by none)", "CPU seconds", "error (m)", lines)
