"""Compare the requested accuracy and the stated error of plans with their true error.

Targets are planned with `planning.accuracy`. Each plan is carried out on a reference
discretisation. Its error there must be smaller than the requested accuracy and the stated error,
and the estimate (the stated error without safety factor) must be within a factor five of it.
"""

import dataclasses

import numpy as np

from needlefem._arrays import Vector
from needlefem._table import Table
from needlefem.errors import CaseError
from needlefem.planning.adaptive import placed_on, reference, true_error
from needlefem.planning.plan import plan
from needlefem.planning.result import RefinementStep
from needlefem.scene import Scene, vary
from needlefem.studies.targets import draw_targets

COUNT = 20
REQUESTS = (1e-4, 2e-5)
"""Requested accuracies, m."""
FACTOR = 5.0
"""Largest ratio of estimate and true error, in both directions."""
AGREE = 0.2 * min(REQUESTS)
"""Largest distance between the placements of one release on two reference discretisations, m."""


def study(scene: Scene, other: Scene | None = None) -> list[Table]:
    """Return a table of the reference discretisations, and one of targets for each accuracy."""
    del other
    return [agreement(scene), *requests(scene)]


def agreement(scene: Scene) -> Table:
    """Return the placement of the case's own plan on the reference discretisations."""
    if scene.target is None:
        raise CaseError("target.point", "missing", "the study needs a target")
    found, places, rows = plan(scene), [], list[list[object]]()
    for cells in ("triangle", "quadrilateral"):
        exact = reference(scene, found.target, cells)
        placed = placed_on(exact, found)
        if placed is not None:
            places.append(placed)
            error = 1e3 * (placed - found.target)
            name, unknowns = exact.model.element.name, len(exact.model.free_dofs)
            rows.append([name, unknowns, *error.tolist(), float(np.linalg.norm(error))])
    apart = float(np.linalg.norm(places[0] - places[-1])) if len(places) > 1 else np.inf
    return Table(
        title="the case's plan on discretizations taken as exact",
        columns=("element", "unknowns", *(f"error in {a} (mm)" for a in scene.axes), "error (mm)"),
        rows=rows,
        passed=apart <= AGREE,
        note=f"they differ by {1e3 * apart:.2g} mm (at most {1e3 * AGREE:g} mm)",
    )


def requests(
    scene: Scene, accuracies: tuple[float, ...] = REQUESTS, count: int = COUNT
) -> list[Table]:
    """Return discretisation, estimate and true error by target, for each accuracy."""
    wanted = scene.targets and dataclasses.replace(scene.targets, count=count)
    targets = draw_targets(dataclasses.replace(scene, targets=wanted))
    rows = [planned(scene, target, accuracies) for target in targets]
    return [
        _table(scene, accuracy, list(found))
        for accuracy, found in zip(accuracies, zip(*rows, strict=True), strict=True)
    ]


def planned(scene: Scene, target: Vector, accuracies: tuple[float, ...]) -> list[list[object]]:
    """Return the rows of a target, one per accuracy."""
    exact = reference(scene, target)
    errors: dict[bytes, float] = {}
    rows: list[list[object]] = []
    for accuracy in accuracies:
        found = plan(vary(scene, {"planning.accuracy": accuracy}), target)
        evidence, place = found.evidence, [float(100.0 * x) for x in target]
        if (
            evidence is None
            or evidence.estimate is None
            or not evidence.refinement_history
            or not found.best
        ):
            rows.append([*place, *[""] * 8, str(found.status), False, False, False])
            continue
        release = found.best.release_point.tobytes()  # two accuracies may have the same plan
        if release not in errors:
            errors[release] = true_error(exact, found)
        said, error, stated = evidence.estimate.error, errors[release], evidence.estimate.at_most
        lengths = [1e3 * length for length in (said, stated, error)]
        cells = [len(evidence.refinement_history), *lengths, said / error, str(found.status)]
        holds = error <= accuracy, error <= stated, error / FACTOR <= said <= FACTOR * error
        rows.append([*place, *_chosen(evidence.refinement_history[-1]), *cells, *holds])
    return rows


def _chosen(last: RefinementStep) -> list[object]:
    sizes = (last.corridor, last.contour, last.bulk, last.path)
    return [last.element, "/".join(f"{1e3 * size:.3g}" for size in sizes), last.unknowns]


def _table(scene: Scene, accuracy: float, rows: list[list[object]]) -> Table:
    met, stated, near = (sum(bool(row[place]) for row in rows) for place in (-3, -2, -1))
    counts = {"met": met, "holds": stated, "near": near}
    return Table(
        title=f"accuracy = {1e3 * accuracy:g} mm",
        columns=(
            *(f"{axis} (cm)" for axis in scene.axes), "element", "sizes (mm)", "unknowns", "tried",
            "estimate (mm)", "stated (mm)", "error (mm)", "ratio", "status", "below", "holds",
            "near",
        ),
        rows=rows,
        passed=met == stated == near == len(rows),
        note=f"of {len(rows)} errors {met} are below the accuracy, {stated} below the stated "
        f"error, {near} within a factor {FACTOR:g} of the estimate; sizes: along the needle, at "
        "contours, elsewhere, path spacing",
        summary={f"{name}_{1e3 * accuracy:g}": count for name, count in counts.items()},
    )  # fmt: skip
