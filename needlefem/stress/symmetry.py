"""Symmetric images of a scene, whose results must be the images of its result."""

import dataclasses
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from needlefem._arrays import Floats, SkfemMesh
from needlefem.casefile.load import load_case
from needlefem.fem.tissue_model import TissueModel
from needlefem.geometry.contour import Contour
from needlefem.scene import Scene, vary
from needlefem.scene.build import build_model
from needlefem.scene.resolve import resolve
from needlefem.stress.drawncase import DrawnCase, Units, in_units
from needlefem.stress.inputfiles import write_drawn_case
from needlefem.stress.scenes import Fault, SceneAnswer, carry_out

SAME = 1e-6
"""Largest distance between the image of the result and the result of the image, over the depth."""
NUDGE = 1e-9
"""Relative change of the needle's forces, and of its entry over the depth, that detects scenes with
several solutions: their result then changes by more than `SAME`, a thousand times as much."""
ANGLE = 0.7
"""Angle of the rotation, rad."""
UNITS = Units(length=10.0 / 3.0, force=0.07, time=11.0)
"""Factors of the scaled scene."""


def check_symmetry(
    case: DrawnCase, scene: Scene, model: TissueModel, answer: SceneAnswer
) -> tuple[str, Fault | None]:
    """Return ``met``, ``missed`` with a fault, or ``several solutions``."""
    if case.check == "scaling":
        away, what = _scaled(case, answer)
    else:
        away, what = _moved(case, scene, model, answer)
    if away <= SAME:
        return "met", None
    found = _sensitive(case, scene, model, answer)
    if found:
        return "several solutions", None
    detail = f"{what}: {away:.2e} of the depth"
    return "missed", Fault(requirement=case.check, detail=detail)


def distance(first: SceneAnswer, second: SceneAnswer, turn: Floats) -> tuple[float, str]:
    """Return the largest difference of two results, over the first's depth, and its quantity.

    The first is turned and scaled by `turn`, shape (2, 2), before.
    """
    if first.status != second.status:
        return np.inf, f"status {first.status} and {second.status}"
    if len(first.points) != len(second.points):
        return np.inf, f"{len(first.points)} and {len(second.points)} points"
    scale = first.depth * float(np.sqrt(abs(np.linalg.det(turn))))
    pairs = [("last tip, seeds", first.points, second.points)]
    if len(first.path) == len(second.path):
        pairs.append(("path", first.path, second.path))
    worst, name = 0.0, "nothing"
    for label, one, other in pairs:
        if len(one):
            away = float(np.linalg.norm(one @ turn.T - other, axis=1).max()) / scale
            if away >= worst:
                worst, name = away, label
    return worst, name


def _scaled(case: DrawnCase, answer: SceneAnswer) -> tuple[float, str]:
    with tempfile.TemporaryDirectory(prefix="needlefem-stress-") as folder:
        scene = load_case(write_drawn_case(in_units(case, UNITS), Path(folder)))
        found, _ = carry_out(scene, case.command)
    return distance(answer, found, UNITS.length * np.eye(2))


def _moved(
    case: DrawnCase, scene: Scene, model: TissueModel, answer: SceneAnswer
) -> tuple[float, str]:
    cosine, sine = np.cos(ANGLE), np.sin(ANGLE)
    turn = np.array([[cosine, -sine], [sine, cosine]])
    if case.check == "mirror":
        turn = np.diag([-1.0, 1.0])
    mesh = turned_mesh(model.mesh, turn)
    image = turned_scene(scene, turn)
    found, _ = carry_out(image, case.command, build_model(image, mesh))
    return distance(answer, found, turn)


def turned_mesh(mesh: SkfemMesh, turn: Floats) -> SkfemMesh:
    """Return the mesh with its points multiplied by an orthogonal matrix."""
    cells = mesh.t
    if np.linalg.det(turn) < 0.0:  # keep the orientation of the cells
        cells = cells[[0, *range(len(cells) - 1, 0, -1)]]
    return type(mesh)(
        np.ascontiguousarray(turn @ mesh.p),
        np.ascontiguousarray(cells),
        _boundaries=mesh.boundaries,
        _subdomains=mesh.subdomains,
    )


def turned_scene(scene: Scene, turn: Floats) -> Scene:
    """Return the scene with all points and directions multiplied by an orthogonal matrix.

    Its mesh has to be turned as well, and given to the model.
    """

    def moved(values: ArrayLike) -> tuple[float, ...]:
        return tuple((turn @ np.array(values)).tolist())

    scene = resolve(scene).scene
    changes: dict[str, object] = {"motion.direction": moved(scene.motion.direction)}
    if scene.motion.entry:
        changes["motion.entry"] = moved(scene.motion.entry)
    if scene.target is not None:
        changes["target"] = moved(scene.target)
    for name, law in scene.materials.items():
        for key in ("fibre", "axis_1", "axis_2"):
            if hasattr(law, key):
                changes[f"materials.{name}.{key}"] = moved(getattr(law, key))
    for name, region in scene.regions.items():
        changes[f"regions.{name}.contour"] = Contour(region.contour.points @ turn.T)
    for name, support in scene.supports.items():
        directions = [np.eye(scene.dim)[scene.axes.index(axis)] for axis in support.fixed]
        if support.direction or len(directions) == 1:
            (direction,) = [support.direction] if support.direction else directions
            image = dataclasses.replace(support, fixed=(), direction=moved(direction))
            changes[f"supports.{name}"] = image
    return vary(scene, changes)


def _sensitive(case: DrawnCase, scene: Scene, model: TissueModel, answer: SceneAnswer) -> bool:
    """Return whether a change of the scene by `NUDGE` changes its result by more than `SAME`."""
    needle = scene.needle
    for sign in (1.0, -1.0):
        factor = 1.0 + sign * NUDGE
        changes: dict[str, object] = {"needle.cutting_force": factor * needle.cutting_force}
        for name, region in scene.regions.items():
            if region.cutting_force is not None:
                changes[f"regions.{name}.cutting_force"] = factor * region.cutting_force
        if _nudged(case, vary(scene, changes), model, answer):
            return True
        across = np.array([-scene.motion.direction[1], scene.motion.direction[0]])
        step = sign * NUDGE * scene.motion.max_depth * across
        field = "target" if case.command == "plan" else "motion.entry"
        begin = scene.target if case.command == "plan" else scene.motion.entry
        beside = dataclasses.replace(answer)
        if begin and _nudged(case, vary(scene, {field: _added(begin, step)}), model, beside):
            return True
    return False


def _added(point: tuple[float, ...], step: Floats) -> tuple[float, ...]:
    return tuple((np.array(point) + step).tolist())


def _nudged(case: DrawnCase, scene: Scene, model: TissueModel, answer: SceneAnswer) -> bool:
    found, _ = carry_out(scene, case.command, model)
    return distance(answer, found, np.eye(2))[0] > SAME
