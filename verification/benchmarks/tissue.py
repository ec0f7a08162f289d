"""Cost of a time step of the tissue relative to its necessary products and solution."""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np

from needlefem import build_model, load_case
from needlefem._arrays import Floats
from needlefem.bench import in_turn, median
from needlefem.dynamics import (
    CentralDifference,
    Damping,
    GeneralizedAlpha,
    KinematicState,
    Newmark,
    QuasiStatic,
    Stepper,
    TissueSystem,
)
from needlefem.errors import CaseError
from needlefem.plotting import ChartLine, loglog
from needlefem.scene import BoxMesh, Scene, resolve, with_element
from needlefem.studies import Table

SIZES = (1_300, 20_000, 200_000)
"""Approximate numbers of unknowns."""
ROUNDS = 15
WORK = 1e6
"""Product of unknowns and steps in one timing."""
MOST = 1.2
"""Largest ratio of a damped Newmark step to its two products and its back-substitution."""
STEP = 1e-3
SHORT = {
    "M x, K x, back-substitution": "bare products",
    "generalised-alpha, damped": "gen.-alpha, damped",
    "central difference, lumped mass": "central differences",
}
"""Names for the chart's legend."""
DAMPING = Damping(mass_rate=1.0, stiffness_time=1e-4)


def run(case: str) -> Table:
    """Time steps of all integrators on the case's tissue, P1, on finer and finer boxes."""
    scene = load_case(case)
    rows: list[list[Any]] = []
    worst = 0.0
    for size in SIZES:
        found, unknowns, bare = _times(_with_unknowns(scene, size))
        for name, seconds in found.items():
            rows.append([unknowns, name, 1e3 * seconds, seconds / bare])
            if name.startswith("Newmark"):
                worst = max(worst, seconds / bare)
    return Table(
        title=f"{scene.title}: time steps of the tissue, medians of {ROUNDS} rounds",
        columns=("unknowns", "a step of", "ms", "ratio"),
        rows=rows,
        charts={scene.title: _chart(rows)},
        passed=worst <= MOST,
        note="ratio: over M x, K x and one back-substitution of the step's operator; for Newmark "
        f"it may be {MOST:g}",
        summary={"worst": worst},
    )


def _chart(rows: list[list[Any]]) -> str:
    lines = [
        ChartLine(
            SHORT.get(name, name),
            *zip(*((row[0], row[2]) for row in rows if row[1] == name), strict=True),
        )
        for name in dict.fromkeys(row[1] for row in rows)
    ]
    return loglog("a time step of the tissue", "unknowns", "milliseconds", lines)


def _with_unknowns(scene: Scene, size: int) -> Scene:
    if not isinstance(scene.mesh, BoxMesh):
        raise CaseError("mesh.file", "a mesh of one size", "use a case with a box")
    plain = with_element(scene, "P1")
    across = round(np.sqrt(0.5 * size))
    box = BoxMesh(
        size=scene.mesh.size,
        origin=scene.mesh.origin,
        divisions=(across,) * scene.dim,
    )
    return resolve(dataclasses.replace(plain, mesh=box)).scene


def _times(scene: Scene) -> tuple[dict[str, float], int, float]:
    """Return seconds a step by integrator, the unknowns, and seconds of the bare operations."""
    model = build_model(scene)
    plain, damped = TissueSystem(model), TissueSystem(model, DAMPING)
    lumped = TissueSystem(model, lumping="row-sum")
    explicit = CentralDifference(refuse_unstable=False)
    steppers: dict[str, Stepper] = {
        "Newmark, damped": Newmark().stepper(damped, STEP),
        "Newmark": Newmark().stepper(plain, STEP),
        "generalised-alpha, damped": GeneralizedAlpha().stepper(damped, STEP),
        "quasi_static": QuasiStatic().stepper(plain, STEP),
        "central difference, lumped mass": explicit.stepper(lumped, 1e-6),
    }
    count = max(3, int(WORK / plain.size))
    mass, stiffness = plain.mass, model.free_block(model.stiffness.matrix.tocsr())
    factor, x = plain.factor(4.0 / STEP**2, 0.0, 1.0), np.ones(plain.size)

    def bare() -> None:
        for _ in range(count):
            mass @ x
            stiffness @ x
            factor.solve(x)

    tasks: dict[str, Callable[[], object]] = {"M x, K x, back-substitution": bare}
    for name, stepper in steppers.items():
        tasks[name] = _steps(stepper, x, count)
    found = {name: median(s) / count for name, s in in_turn(tasks, ROUNDS).items()}
    return found, plain.size, found["M x, K x, back-substitution"]


def _steps(stepper: Stepper, force: Floats, count: int) -> Callable[[], KinematicState]:
    def go() -> KinematicState:
        motion = KinematicState(*(np.zeros_like(force) for _ in range(3)))
        for _ in range(count):
            motion = stepper.step_under_load(motion, force, force)
        return motion

    return go
