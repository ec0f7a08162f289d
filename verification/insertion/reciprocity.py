"""Betti's theorem, invariance under motions of the frame, and the tissue after the retraction."""

import dataclasses

import numpy as np

from needlefem import build_model
from needlefem.checks import Problem, ProblemResult, Quantity, reciprocity, rectangle
from needlefem.elements import CATALOGUE
from needlefem.insertion import Insertion, Simulation, TipPhase, displacements, energy_terms
from needlefem.materials import Isotropic
from needlefem.scene import Scene, Stage, build_mesh, vary
from verification.support.organ_in_gel import organ_in_gel

FRAMES = {
    "shifted": (0.0, (0.02, -0.01), False),
    "turned by 90 degrees": (0.5 * np.pi, (0.0, 0.0), False),
    "turned by 40 degrees and shifted": (0.7, (0.01, 0.3), False),
    "mirrored": (0.0, (0.06, 0.0), True),
    "mirrored and turned": (0.4, (0.0, 0.0), True),
}
"""Angle, shift (m), and whether the frame is mirrored first."""
QUICK = ("turned by 40 degrees and shifted", "mirrored and turned")
"""Frames of a quick run: each kind of motion occurs in one of them."""


def scene(element: str, friction: float = 10e3) -> Scene:
    """Return an organ in gel and a motion: insertion, dwell, partial retraction, insertion, out."""
    stages = (
        Stage(depth=0.03),
        Stage(dwell=1.0),
        Stage(depth=0.01, release="seed"),
        Stage(depth=0.032),
        Stage(depth=-0.001),
    )
    return organ_in_gel(
        element, 16, 1.5e-3, max_depth=0.035, stages=stages, tip_radius=2e-3, friction=friction,
        corners=32,
    )  # fmt: skip


def moved(plain: Scene, angle: float, shift: tuple[float, float], mirror: bool) -> Insertion:
    """Return the motion in a transformed mesh and frame, transformed back."""
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    frame = turn @ np.diag([-1.0 if mirror else 1.0, 1.0])
    mesh = build_mesh(plain)
    points = np.ascontiguousarray(frame @ mesh.doflocs + np.array(shift)[:, None])
    entry = frame @ np.array(plain.motion.entry) + np.array(shift)
    direction = frame @ np.array(plain.motion.direction)
    turned = vary(plain, {"motion.entry": tuple(entry), "motion.direction": tuple(direction)})
    model = build_model(turned, dataclasses.replace(mesh, doflocs=points))
    simulation = Simulation(turned, model)
    found = simulation.move(simulation.entry_of_case())
    back = [
        dataclasses.replace(state, tip=frame.T @ (state.tip - np.array(shift)))
        for state in found.states
    ]
    return dataclasses.replace(found, states=tuple(back))


def apart(one: Insertion, other: Insertion) -> float:
    """Return the largest difference of paths and forces, relative to the largest value of each."""
    if len(one.states) != len(other.states):
        return np.inf
    forces = [np.array([state.force for state in found.states]) for found in (one, other)]
    tips = float(np.max(np.abs(one.tips - other.tips)) / np.max(one.tips))
    return max(tips, float(np.max(np.abs(forces[0] - forces[1])) / np.max(np.abs(forces[0]))))


def at_rest(found: Insertion) -> float:
    """Return the displacement after the retraction, relative to the largest during the motion."""
    last, deepest = len(found.states) - 1, int(np.argmax(found.depths))
    sizes = np.max(np.abs(displacements(found, [last, deepest])), axis=0)
    return float(sizes[0] / sizes[1]) if found.states[-1].tip_phase is TipPhase.OUTSIDE else np.inf


def run(quick: bool) -> ProblemResult:
    """Compare compliances, motions in transformed frames, and the tissue after the retraction."""
    answers = []
    for name, element in CATALOGUE.items():
        for ratio in (0.3, 0.4999):
            model = rectangle(element, Isotropic(youngs_modulus=1.0, poissons_ratio=ratio), 12)
            label = f"{name}, nu {ratio}: responses apart"
            value = reciprocity(model).value
            answers.append(Quantity(label=label, value=value, tolerance=1e-9, recorded=False))
    for element in ("P1",) if quick else ("P1", "P2"):
        plain = scene(element)
        found = moved(plain, 0.0, (0.0, 0.0), mirror=False)
        energies = energy_terms(found)
        values = {f"motion {name}": apart(found, moved(plain, *frame))
                  for name, frame in FRAMES.items() if name in QUICK or not quick}  # fmt: skip
        values["displacement with the needle out"] = at_rest(found)
        without = moved(scene(element, friction=0.0), 0.0, (0.0, 0.0), mirror=False)
        values["displacement with the needle out, no friction"] = at_rest(without)
        seed = found.states[-1].seeds[0] - found.seeds[0].point
        values["seed at rest off its material"] = float(np.max(np.abs(seed)) / 0.01)
        values["ledger"] = energies.residual
        values["given by a step, over the work"] = (
            -energies.smallest_dissipation / energies.total_absolute_work
        )
        answers += [
            Quantity(label=f"{element}: {label}", value=value, tolerance=1e-9, recorded=False)
            for label, value in values.items()
        ]
    return ProblemResult(quantities=answers)


PROBLEM = Problem(
    name="reciprocity and frames",
    requirement="The compliance is symmetric. Results do not depend on a shift, rotation or mirror "
    "image of the scene. The displacement after the retraction is zero.",
    reference="exact; E. Betti 1872",
    tolerance_rationale="round-off times the condition of the system",
    run=run,
)
