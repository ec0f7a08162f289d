"""Options and keys without effect: options and ``--set`` are refused, keys of a file reported.

A value without effect would look like a result that does not depend on it.
"""

import argparse
import dataclasses
from collections.abc import Iterator, Mapping, Sequence

from needlefem._toml import dotted_key
from needlefem.errors import CaseError
from needlefem.scene import DYNAMIC, BoxMesh, Scene, canonical, field_of
from needlefem.scene.resolve import resolve

FOLDER = "results are written to --out DIR"
PICTURES = "a plan alone has pictures to choose from"
STAGES = "a plan pushes the needle once; run carries stages out"
UNUSED: Mapping[str, Mapping[str, str]] = {
    "run": {
        "planning": "'run' does not plan",
        "targets": "only 'study targets' and others draw targets",
        "outputs.folder": FOLDER,
        "outputs.pictures": PICTURES,
    },
    "plan": {
        "motion.entry": "a plan chooses the entry; move target.point or give motion.direction",
        "motion.stages": STAGES,
        "motion.times": STAGES,
        "motion.depths": STAGES,
        "targets": "only 'study targets' and others draw targets",
        "outputs.folder": FOLDER,
    },
    "modes": {
        "needle": "modes are those of the tissue without a needle",
        "damping": "modes are those of undamped tissue",
        "planning": "'modes' does not plan",
        "targets": "'modes' does not plan",
        "outputs.folder": FOLDER,
        "outputs.pictures": PICTURES,
    },
}
"""By command: beginnings of the keys that change nothing in it, and why."""


def refuse_unused_keys(scene: Scene, command: str) -> None:
    """Raise a `CaseError` for the first ``--set`` key that would change nothing.

    Parameters
    ----------
    scene : Scene
        With the overrides that its case was read with.
    command : str
        ``run``, ``plan`` or ``modes``.
    """
    if not scene.overrides:
        return
    reasons = [*UNUSED[command].items(), *_without_effect(scene, command)]
    for given in scene.overrides:
        key = canonical(given)
        for unused, why in reasons:
            if key == unused or key.startswith(f"{unused}."):
                raise CaseError(f"--set {given}", f"would be ignored: {why}", "leave it out")


def unused_keys(scene: Scene, command: str) -> list[str]:
    """Return a sentence for each value of the case that other values leave without effect.

    Keys that another command uses are no reason for one: a case is read by all of them. A value
    that is the default changes nothing and is not told.
    """
    reasons = [("outputs.folder", FOLDER), *_without_effect(scene, command)]
    return [
        f"{key} has no effect: {why}"
        for key, why in dict(reasons).items()
        if key not in map(canonical, scene.overrides) and _differs(scene, key)
    ]


def _differs(scene: Scene, key: str) -> bool:
    """Say whether a field of a scene has another value than its default."""
    table, _, name = key.rpartition(".")
    owner = field_of(scene, table) if table else scene
    for field in dataclasses.fields(owner):
        if field.name == name:
            if field.default_factory is not dataclasses.MISSING:
                return bool(getattr(owner, name) != field.default_factory())
            return bool(getattr(owner, name) != field.default)
    return False


def refuse_unused_options(options: argparse.Namespace, rules: Sequence[tuple[str, str]]) -> None:
    """Raise a `CaseError` for the first option that was given although it would be ignored.

    Parameters
    ----------
    options : Namespace
    rules : sequence of (str, str)
        Names of options that are ignored here, and why.
    """
    for name, why in rules:
        if getattr(options, name) not in (None, False, "", 0, []):
            flag = "--" + name.replace("_", "-")
            raise CaseError(flag, f"would be ignored: {why}", "leave it out")


def _without_effect(scene: Scene, command: str) -> Iterator[tuple[str, str]]:
    """Yield keys that change nothing in this scene, because of others in it."""
    chosen = resolve(scene).scene
    if command != "modes":
        yield from _of_integrators(chosen, stepped=command == "run" and _has_stages(chosen))
    if chosen.needle.static_friction_ratio == 1.0:
        yield "needle.slip_weakening_distance", "static friction is kinetic friction here"
    if chosen.needle.tip == "point":
        yield "discretization.tip_quadrature_points", "a point has no kernel"
    yield from _of_meshes(chosen)
    if command == "plan" and not chosen.obstacles:
        yield "planning.directions", "no obstacle makes a plan turn"
    if chosen.planning.accuracy == 0.0:
        yield "planning.max_unknowns", "planning.accuracy is 0"


def _of_meshes(scene: Scene) -> Iterator[tuple[str, str]]:
    """Yield element sizes that this mesh does not use."""
    mesh = scene.mesh
    if not isinstance(mesh, BoxMesh):
        for name in scene.regions:
            yield dotted_key(["regions", name, "contour_size"]), "the mesh is from a file"
        return
    if mesh.refine.corridor_size == 0.0:
        for part in ("corridor_width", "corridor_depth"):
            yield f"mesh.refine.{part}", "mesh.refine.corridor_size is 0"
    if not scene.regions:
        yield "mesh.refine.contour_size", "there are no regions"


def _has_stages(scene: Scene) -> bool:
    return bool(scene.motion.stages or scene.motion.times)


def _of_integrators(scene: Scene, *, stepped: bool) -> Iterator[tuple[str, str]]:
    """Yield the keys of other integrators than the scene's."""
    name = scene.discretization.integrator
    how = f"the integrator is '{name}'; choose discretization.integrator"
    if name not in DYNAMIC:
        yield "damping", how
        yield "discretization.mass_matrix", how
    if name != "generalized_alpha":
        yield "discretization.rho_inf", how
    if name != "newmark":
        yield "discretization.newmark_gamma", how
    if name == "path_following" and not stepped:
        yield "discretization.time_step", how
