"""Results as plain data: the JSON contract of `plan` and `run`. Points in metres."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import NotRequired, TypedDict

import numpy as np

from needlefem._arrays import Vector
from needlefem.checks.result import CheckResult
from needlefem.geometry.image_frame import ImageFrame
from needlefem.insertion.cut_path import TipPoint
from needlefem.insertion.result import EnergyTerms, Insertion, Seed, Status
from needlefem.needle.needle_interface import InsertionAxis
from needlefem.planning.result import BlockedRelease, Evidence, Headline, Plan, Release, headline
from needlefem.planning.search import SearchResult
from needlefem.scene import Scene
from needlefem.scene.discretization import Coordinates

POINTS = (
    "target", "release_point", "placed_at", "released_at", "now_at", "final_position", "entry",
)  # fmt: skip
"""Keys of a record that are points of the case."""
NESTED = ("unplanned", "depth_only", "blocked", "seeds", "ours")
"""Keys of a record with such points below them."""


class SeedRecord(TypedDict):
    """A seed in the record of a run; see `docs/json.md`."""

    name: str
    time: NotRequired[float]
    released_at: Vector
    release_depth: float
    placed_at: Vector
    elastic_prediction: Vector
    final_position: Vector | None
    distance_from_rest: float | None
    placement_error: float | None
    status: str


def origin(scene: Scene) -> dict[str, object]:
    """Return which case a result came from, and what was replaced in it."""
    source = None if scene.source is None else scene.source.resolve()
    return {"case": scene.title, "source": source, "overrides": scene.overrides}


def check_record(check: CheckResult) -> dict[str, object]:
    """Return a check with its verdict."""
    return dataclasses.asdict(check) | {"passed": check.passed}


def pushed_record(axis: InsertionAxis, point: Vector | None) -> dict[str, object]:
    """Return how a needle on an axis brings its tip to a point: where it enters, how deep it goes.

    The depth (m) counts from the entry, whatever the coordinates of the skin are.
    """
    depth = None if point is None else float(axis.axial_coordinate(point))
    return {"entry": None if point is None else axis.entry, "release_depth": depth}


def release_record(release: Release | None, axis: InsertionAxis) -> dict[str, object] | None:
    """Return where something was released on an axis, how deep, and where it came to rest."""
    if release is None:
        return None
    return dataclasses.asdict(release) | pushed_record(axis, release.release_point)


def plan_record(plan: Plan) -> dict[str, object]:
    """Return a plan; see `docs/json.md`."""
    best = plan.best
    return {
        "status": plan.status,
        "sentence": plan.sentence,
        "target": plan.target,
        "release_point": None if best is None else best.release_point,
        "placed_at": None if best is None else best.placed_at,
        "placement_error": None if best is None else best.placement_error,
        **pushed_record(plan.insertion.axis, None if best is None else best.release_point),
        "unplanned": release_record(plan.unplanned, plan.level.axis),
        "depth_only": release_record(plan.depth_only, plan.level.axis),
        "headline": headline_record(headline(plan)),
        "insertions": plan.insertions,
        "search": search_record(plan.search, plan.solution),
        "other_solutions": plan.other_solutions,
        "scan_insertions": plan.scan_insertions,
        "ruptures": len(plan.insertion.ruptures),
        "direction": plan.insertion.axis.direction,
        "obstacles": [dataclasses.asdict(passing) for passing in plan.passings],
        "blocked": _barred_record(plan.blocked),
        "rejected_directions": [
            dataclasses.asdict(refusal) for refusal in plan.rejected_directions
        ],
        "missing": dict(plan.missing),
    } | ({} if plan.evidence is None else _evidence_record(plan.evidence, plan.missing))


def headline_record(found: Headline) -> dict[str, object]:
    """Return the estimated placement error (m), what it contains, and what it does not."""
    strains = found.validity
    return {
        "placement_error": found.placement_error,
        "contains": dict(found.contains),
        "unknown": found.unknown or None,
        "strains_beyond_limit": None if strains is None else strains.beyond_limit,
        "sentence": found.sentence,
    }


def _barred_record(barred: BlockedRelease | None) -> dict[str, object] | None:
    if barred is None:
        return None
    return dataclasses.asdict(barred.release) | dataclasses.asdict(barred.passing)


def _evidence_record(evidence: Evidence, missing: Mapping[str, str]) -> dict[str, object]:
    energies, strains, on = evidence.energy, evidence.validity, evidence.discretisation
    return {
        "missing": {**missing, **evidence.missing},
        "discretization": None if on is None else dataclasses.asdict(on),
        "energy_residual": None if energies is None else energies.residual,
        "energy": None if energies is None else energy_record(energies),
        "validity": None if strains is None else dataclasses.asdict(strains),
        "estimate": None if evidence.estimate is None else dataclasses.asdict(evidence.estimate),
        "refinement_history": [
            dataclasses.asdict(attempt) for attempt in evidence.refinement_history
        ],
        "preflight": [check_record(check) for check in evidence.preflight],
        "timings": evidence.timings,
        "skipped": evidence.skipped,
        "reasons": evidence.reasons,
        "warnings": evidence.warnings,
    }


def search_record(name: str, solution: SearchResult) -> dict[str, object]:
    """Return the heights that a search tried (relative to the target's) and their misses."""
    heights = [height for height, _ in solution.tried]
    misses = [miss for _, miss in solution.tried]
    return {
        "method": name,
        "found": solution.found,
        "lateral_offsets": heights,
        "lateral_errors": misses,
    }


def energy_record(found: EnergyTerms) -> dict[str, float]:
    """Return the energy terms, J (J/m in 2D), and the residual of the energy balance."""
    return dataclasses.asdict(found) | {
        "residual": found.residual,
        "largest_energy_gain": found.largest_energy_gain,
    }


def insertion_record(insertion: Insertion) -> dict[str, object]:
    """Return the histories of an insertion."""
    states = insertion.states
    return {
        "status": insertion.outcome.status,
        "sentence": insertion.outcome.sentence,
        "entry": insertion.axis.entry,
        "puncture_depth": insertion.puncture_depth,
        "depth": insertion.depths,
        "tip_path": insertion.tips,
        "tip_force": [state.tip_force for state in states],
        "shaft_force": [float(state.friction_force.sum()) for state in states],
        "lateral_force": [state.lateral_force.sum(axis=0) + state.tip_lateral for state in states],
        "time": [state.time for state in states],
        "tip_phase": [state.tip_phase for state in states],
        "sticking_segments": [
            None if state.slipping is None else int(np.count_nonzero(state.slipping[1:] == 0))
            for state in states
        ],
        "events": [dataclasses.asdict(event) for event in insertion.events],
        "ruptures": [dataclasses.asdict(snap) for snap in insertion.ruptures],
        "contact_solves": insertion.contact_solves,
    }


def seed_record(insertion: Insertion, reach: TipPoint) -> SeedRecord:
    """Return a seed: where the tip let it go, where it rests, and its distance to the target.

    Where the insertion broke off nothing is placed: the seed is where it would rest.
    """
    cut = insertion.puncture_depth is not None and reach.depth >= insertion.puncture_depth
    ended = insertion.outcome.status in (Status.COMPLETED, Status.NOT_PUNCTURED)
    return {
        "name": "",
        "released_at": insertion.axis.tip_position(reach.depth),
        "release_depth": reach.depth,
        "placed_at": reach.point,
        "elastic_prediction": reach.point,
        "final_position": None,
        "distance_from_rest": None,
        "placement_error": _error(reach.point, insertion.scene.target),
        "status": ("placed" if cut else "not_punctured") if ended else "not_placed",
    }


def released_record(
    seed: Seed, place: Vector, target: Coordinates | None, axis: InsertionAxis
) -> SeedRecord:
    """Return a seed that a motion released; `place` is where it is when the motion ends."""
    return {
        "name": seed.name,
        "time": seed.time,
        "released_at": seed.released_at,
        "release_depth": float(axis.axial_coordinate(seed.released_at)),
        "placed_at": seed.point,
        "elastic_prediction": seed.elastic_prediction,
        "final_position": place,
        "distance_from_rest": float(np.linalg.norm(place - seed.point)),
        "placement_error": _error(seed.point, target),
        "status": "placed" if seed.inside else "not_punctured",
    }


def _error(point: Vector, target: Coordinates | None) -> float | None:
    return None if target is None else float(np.linalg.norm(point - np.array(target)))


def with_scanner(record: Mapping[str, object], scene: Scene) -> dict[str, object]:
    """Return the record of a plan or a run with ``frame`` and ``scanner`` beside what it has.

    ``frame`` is the case's plane in the scanner; ``scanner`` has every point of the record in the
    scanner's space (m, three numbers) under the record's own keys, and the needle's direction.
    Both are None for a case without a frame.
    """
    frame = scene.frame
    if frame is None:
        return {**record, "frame": None, "scanner": None}
    direction = record.get("direction", scene.motion.direction)
    found: dict[str, object] = {
        "space": frame.space,
        "direction": frame.turned(np.array(direction)),
    }
    return {**record, "frame": dataclasses.asdict(frame), "scanner": found | _points(record, frame)}


def _points(record: Mapping[str, object], frame: ImageFrame) -> dict[str, object]:
    found: dict[str, object] = {}
    for key, value in record.items():
        if key in POINTS:
            found[key] = None if value is None else frame.to_scanner(np.array(value))
        elif key in NESTED and isinstance(value, Mapping):
            found[key] = _points(value, frame)
        elif key in NESTED and isinstance(value, Sequence):
            found[key] = [_points(item, frame) for item in value]
    return found


def scanner_lines(record: Mapping[str, object]) -> list[str]:
    """Return lines that say where a record's points are in the scanner, mm; see `with_scanner`."""
    scanner = record["scanner"]
    if not isinstance(scanner, Mapping):
        return []
    named = {
        "entry": scanner.get("entry"),
        "release at": scanner.get("release_point"),
        "comes to rest": scanner.get("placed_at"),
    }
    for number, seed in enumerate(scanner.get("seeds", ()), 1):
        named[f"seed {number} rests"] = seed["placed_at"]
    return [
        f"  in the scanner ({scanner['space']}): {name} "
        f"({', '.join(f'{1e3 * float(x):.2f}' for x in point)}) mm"
        for name, point in named.items()
        if point is not None
    ]
