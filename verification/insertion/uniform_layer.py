"""A needle in a uniform layer: force, energy balance, rigid limit, position in the mesh."""

import numpy as np

from needlefem import simulate
from needlefem.checks import Curve, Problem, ProblemResult, Quantity
from needlefem.insertion import Insertion, energy_terms
from needlefem.materials import Isotropic
from needlefem.scene import BoxMesh, Discretization, Motion, Needle, Scene, Stage, Support, vary

DEPTH, CUTTING, FRICTION, MODULUS = 0.03, 50.0, 10e3, 30e3
"""Depth, m; cutting force, N/m; friction, Pa; Young's modulus, Pa."""
STIFFER = (8, 64, 512)
PLACES = {
    "along a mesh line": (0.027, (0.0, 1.0)),
    "through cells": (0.0287, (0.0, 1.0)),
    "through vertices, obliquely": (0.018, (5.0**-0.5, 2.0 * 5.0**-0.5)),
}
"""Entry of the needle, m, and its direction."""


def layer(element: str, entry: float = 0.0287) -> Scene:
    """Return a uniform square with an insertion and a retraction."""
    return Scene(
        title="uniform layer",
        axes=("y", "z"),
        mesh=BoxMesh(size=(0.06, 0.06), divisions=(20, 20)),
        materials={"gel": Isotropic(youngs_modulus=MODULUS, poissons_ratio=0.45)},
        default_material="gel",
        regions={},
        supports={"walls": Support(faces=("y_min", "y_max", "z_max"))},
        discretization=Discretization(element=element, path_spacing=1e-3, tip_quadrature_points=48),
        needle=Needle(tip_radius=2e-3, cutting_force=CUTTING, shaft_friction=FRICTION),
        motion=Motion(
            direction=(0.0, 1.0),
            entry=(entry, 0.0),
            max_depth=DEPTH,
            stages=(Stage(depth=DEPTH), Stage(depth=-1e-3)),
        ),
    )


def pushed(element: str) -> list[Quantity]:
    """Compare the forces of both methods with cutting force plus friction times path length."""
    answers = []
    for way in ("path_following", "quasi_static"):
        changes = {"discretization.integrator": way, "motion.stages": ()}
        insertion = simulate(vary(layer(element), changes))
        steps = np.linalg.norm(np.diff(insertion.tips, axis=0), axis=1)
        length = np.sum(steps) if way == "path_following" else insertion.states[-1].inserted_length
        exact = CUTTING + FRICTION * float(length)
        label = element if way == "path_following" else f"{element}, stepped"
        energies, force = energy_terms(insertion), insertion.states[-1].force
        answers += [
            Quantity(label=f"{label}: force", value=force, reference=exact, tolerance=1e-10),
            Quantity(label=f"{label}: strain identity", value=energies.strain_energy_mismatch,
                     tolerance=1e-10, recorded=False),
            Quantity(label=f"{label}: ledger", value=energies.residual, tolerance=1e-6,
                   recorded=False),
        ]  # fmt: skip
        if way == "path_following":
            rough = energy_terms(insertion, trapezoidal=True).residual
            label = f"{element}: ledger, trapezoidal"
            answers.append(Quantity(label=label, value=rough, tolerance=2e-2))
    return answers


PRESCRIBED = 1e3
"""Largest time step, s. It is not reached, but with it the work is summed over time steps that are
limited by the travel of the needle, and not over the longer steps of path following."""


def cycle(element: str, stiffer: float) -> dict[str, float]:
    """Return the differences between a cycle in stiffer tissue and in rigid tissue, by quantity."""
    law = Isotropic(youngs_modulus=stiffer * MODULUS, poissons_ratio=0.45)
    changes = {"materials": {"gel": law}, "discretization.time_step": PRESCRIBED}
    found = simulate(vary(layer(element), changes))
    states, energies = found.states, energy_terms(found)
    deepest = int(np.argmax(found.depths))
    work = _work(found, deepest)
    half = states[deepest + int(np.argmin(np.abs(found.depths[deepest:] - 0.5 * DEPTH)))]
    lost = energies.friction + energies.cutting
    friction = FRICTION * DEPTH
    return {
        "force": 1.0 - states[deepest].force / (CUTTING + friction),
        "work": 1.0 - work / (DEPTH * (CUTTING + 0.5 * friction)),
        "force drawn out by half": half.force / (-FRICTION * half.depth) - 1.0,
        "lost in a cycle": 1.0 - lost / (DEPTH * (CUTTING + friction)),
    }


def _work(found: Insertion, last: int) -> float:
    force = np.array([state.force for state in found.states[: last + 1]])
    return float(0.5 * (force[1:] + force[:-1]) @ np.diff(found.depths[: last + 1]))


def rigid_limit(element: str) -> tuple[list[Quantity], list[Curve]]:
    """Check that the rigid limit is approached with order one in 1 / E."""
    found = [cycle(element, stiffer) for stiffer in STIFFER]
    answers, curves = [], []
    for name in found[0]:
        errors = tuple(values[name] for values in found)
        curve = Curve(element=element, quantity=name, order=1.0, sizes=(1.0, 1 / 8, 1 / 64),
                      dofs=STIFFER, seconds=(0.0,) * 3, errors=errors)  # fmt: skip
        curves.append(curve)
        answers += [
            Quantity(label=f"{element}, rigid limit, {name}: order in 1/E", value=curve.observed,
                   reference=1.0, tolerance=0.05),
            Quantity(label=f"{element}, rigid limit, {name}: off at 512 E", value=errors[-1],
                   tolerance=1e-3),
        ]  # fmt: skip
    return answers, curves


def places(element: str) -> list[Quantity]:
    """Compare forces on a mesh line, through cells, and 1e-9 of a cell beside the line."""
    answers = []
    for name, (entry, direction) in PLACES.items():
        paths = [_forces(element, entry + 1e-9 * 0.003 * side, direction) for side in (0, -1, 1)]
        same = all(len(path) == len(paths[0]) for path in paths)
        value = (
            np.max(np.abs(np.array(paths[1:]) - paths[0])) / np.max(paths[0]) if same else np.inf
        )
        label = f"{element}, {name}: force beside, off"
        answers.append(Quantity(label=label, value=float(value), tolerance=1e-6, recorded=False))
    return answers


def _forces(element: str, entry: float, direction: tuple[float, float]) -> np.ndarray:
    found = simulate(vary(layer(element, entry), {"motion.direction": direction}))
    return np.array([state.force for state in found.states])


def run(quick: bool) -> ProblemResult:
    """Test force, energy balance, rigid limit, and positions in the mesh."""
    answers, curves = [], []
    for element in ("P1", "P2"):
        answers += pushed(element)
        if not quick:
            limits, found = rigid_limit(element)
            answers += limits + places(element)
            curves += found
    return ProblemResult(quantities=answers, curves=curves)


PROBLEM = Problem(
    name="uniform layer",
    requirement="In a uniform layer the force is f_c + tau times the length of the material path. "
    "The energy balance has no residual. The error of the rigid limit is proportional to 1 / E. "
    "The position of element edges has no influence.",
    reference="exact; equilibrium of the needle with slip on the full shaft",
    tolerance_rationale="round-off; the trapezoidal energy balance has an error of second order in "
    "each step; friction changes its sign within the first step of the retraction",
    run=run,
)
