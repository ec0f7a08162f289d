"""Functions that several commands use."""

import argparse
import dataclasses
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING

from needlefem._progress import doing
from needlefem._toml import dotted_key
from needlefem.cli import streams
from needlefem.errors import CaseError, NoRendererError
from needlefem.insertion.result import Status
from needlefem.insertion.simulation import Watch
from needlefem.insertion.state import State
from needlefem.io.result_folder import ResultFolder, result_folder, to_json
from needlefem.scene import DYNAMIC, BoxMesh, Scene, canonical, field_of
from needlefem.scene.resolve import resolve

if TYPE_CHECKING:
    from needlefem.planning.result import Plan


GOOD = (Status.COMPLETED, Status.NOT_PUNCTURED)
"""How a motion ends that did what it was told."""


say = streams.say


def say_json(record: object) -> None:
    """Print a record as the one JSON object of a command."""
    say(to_json(record))


def warn(warnings: Iterable[str]) -> None:
    """Print warnings on standard error, a line each."""
    for sentence in warnings:
        streams.tell(f"warning: {sentence}")


def result_of(
    options: argparse.Namespace, command: str
) -> AbstractContextManager[ResultFolder | None]:
    """Return the locked folder of ``--out`` as a context, or one of None without that option.

    Raises
    ------
    CaseError
        The option is empty, or the folder holds another result.
    OutputError
        The folder can't be made or written.
    """
    return nullcontext(None) if options.out is None else result_folder(named(options.out), command)


def undrawn(draw: Callable[[], object]) -> NoRendererError | None:
    """Draw the pictures of a result that is written; return the error where nothing can draw."""
    try:
        draw()
    except NoRendererError as error:
        return error
    return None


def named(path: str, option: str = "--out") -> str:
    """Return the path that an option gives, or refuse an empty one."""
    if not path.strip():
        raise CaseError(option, f"'{path}' is not a valid name", "give a path")
    return path


def progress(title: str) -> Watch:
    """Return what tells depth and number of the insertions to `needlefem._progress`."""
    count = 0

    def watch(state: State) -> None:
        nonlocal count
        count += state.depth == 0.0
        doing(f"{title}, insertion {count}, depth {100 * state.depth:.2f} cm")

    return watch


def centimetres(point: Iterable[float]) -> str:
    """Return a point as text in cm."""
    return "(" + ", ".join(f"{100.0 * float(x):.3f}" for x in point) + ") cm"


def release_lines(plan: "Plan") -> list[str]:
    """Return a line for every release of a plan: where, how deep behind the skin, how near.

    The coordinates of a release and its depth differ where the origin is not on the skin. What
    the search left of the planned one is no error of its placement, and is said elsewhere.
    """
    best, level = plan.insertion.axis, plan.level.axis
    releases = {
        "release at": (plan.best, best),
        "unplanned": (plan.unplanned, level),
        "depth only": (plan.depth_only, level),
    }
    found = []
    for name, (release, axis) in releases.items():
        if release is None:
            why = plan.missing.get(name.replace(" ", "_"))
            found += [f"  {name:11s} not known: {why}"] if why else []
            continue
        error = f", error {100 * release.placement_error:.2g} cm"
        note = f" ({release.note})" if release.note else ""
        found.append(
            f"  {name:11s} {centimetres(release.release_point)}, "
            f"depth {100 * float(axis.axial_coordinate(release.release_point)):.3f} cm -> "
            f"{centimetres(release.placed_at)}"
            f"{'' if release is plan.best and not note else error}{note}"
        )
    if plan.best is not None:
        found.insert(0, f"  entry at    {centimetres(best.entry)}; depths are measured from there")
    return found


def search_line(plan: "Plan") -> str:
    """Return what the search took, and what it left of the target on the plan's own model."""
    left = ""
    if plan.best is not None:
        left = f", {100 * plan.best.placement_error:.2g} cm residual on this model"
    target = centimetres(plan.target)
    return f"  {plan.insertions} insertions ({plan.search}), target {target}{left}"


# Options and keys without effect: options and ``--set`` are refused, keys of a file reported.
#
# A value without effect would look like a result that does not depend on it.


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
    if name != "hht":
        yield "discretization.hht_alpha", how
    if name != "newmark":
        yield "discretization.newmark_gamma", how
    if name == "path_following" and not stepped:
        yield "discretization.time_step", how
