"""``needlefem render``, and the insertions that pictures need.

Results contain no fields. Fields are computed again from the case, which is faster than reading
them, and compared with the stored result.
"""

import argparse
import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from needlefem._arrays import Floats
from needlefem.casefile.load import SavedCase, load_case, read_again
from needlefem.cli.common import GOOD, named, progress, refuse_unused_options, say, say_json, warn
from needlefem.errors import CaseError, short
from needlefem.insertion.insertion_run import SaveAt
from needlefem.insertion.result import Insertion
from needlefem.insertion.simulation import Simulation, Watch
from needlefem.io.result_folder import probe
from needlefem.planning.plan import turned
from needlefem.plotting.figures import draw_setup
from needlefem.plotting.images import MOVING, STILLS, renderer, require_kind
from needlefem.plotting.render import RenderOptions, animate, panels, render
from needlefem.plotting.view import quantity
from needlefem.scene import Motion, Scene, Stage
from needlefem.scene.limits import check_count
from needlefem.units import parse_quantity

SAME = 1e-9
"""Difference of depths and tips, m, up to which a run is the one that was written."""
CLOSE = 5e-5
"""The same of where a planned seed rests: the plan interpolates between depths."""
OUT = 1e-3
"""How far in front of the skin a needle ends that carried a plan out, m."""


def scene_of(path: str, overrides: Sequence[str]) -> Scene:
    """Return the scene of a case, or of a result's case.

    Raises
    ------
    CaseError
        It can't be read, or a result is to be changed.
    """
    return (
        load_case(path, overrides)
        if Path(path).suffix == ".toml"
        else _again(path, overrides).scene
    )


def replay(path: str, overrides: Sequence[str], watch: Watch | None) -> Insertion:
    """Return what a case's needle does, or what a result's did.

    A plan is carried out: insertion, release, and the needle out again.

    Raises
    ------
    CaseError
        It can't be read, or the case gives another result than was written.
    """
    if Path(path).suffix == ".toml":
        return _moved(load_case(path, overrides), watch)
    again = _again(path, overrides)
    scene = _carried_out(again) if again.planned else again.scene
    insertion = _moved(scene, watch)
    if not (_placed_as_planned(insertion, again) if again.planned else _same(insertion, again)):
        remedy = "write it anew with run --out or plan --out"
        raise CaseError(path, "its case gives another result by now", remedy)
    return insertion


def _again(path: str, overrides: Sequence[str]) -> SavedCase:
    if overrides:
        raise CaseError("--set", "changes cases, not results", "give the case.toml")
    return read_again(path)


def _moved(scene: Scene, watch: Watch | None) -> Insertion:
    simulation = Simulation(scene, watch=watch)
    return simulation.move(simulation.entry_of_case(), SaveAt(fields=True))


def _carried_out(again: SavedCase) -> Scene:
    """Return the plan's scene with a motion to its release point and out of the tissue."""
    release = again.record["release_point"]
    if release is None:
        raise CaseError("release_point", "the plan has none", "render its case instead")
    scene = turned(again.scene, again.record.get("direction", again.scene.motion.direction))
    simulation = Simulation(scene)
    point = np.array(release)
    entry = simulation.entry_through(point)
    depth = float((point - entry.point) @ simulation.direction)
    stages = (Stage(depth=depth, release="seed"), Stage(depth=-OUT))
    motion: Motion = dataclasses.replace(
        scene.motion, entry=tuple(entry.point.tolist()), stages=stages, times=(), depths=()
    )
    return dataclasses.replace(scene, motion=motion)


def _same(insertion: Insertion, again: SavedCase) -> bool:
    tips = np.array(again.record["tip_path"])
    return tips.shape == insertion.tips.shape and _near(tips, insertion.tips, SAME)


def _placed_as_planned(insertion: Insertion, again: SavedCase) -> bool:
    place = again.record["placed_at"]
    if place is None or not insertion.seeds:
        return False
    return _near(insertion.seeds[0].point, np.array(place), CLOSE)


def _near(one: Floats, other: Floats, length: float) -> bool:
    return bool(np.max(np.abs(one - other)) <= length)


# ``needlefem render``.


FRAMES, RATE = 60, 12.0
"""Of an animation, and how many of them a second, where nothing is said."""
FASTEST = 240.0
MOST_PANELS = 60
MOST_PIXELS = 8000


def main(options: argparse.Namespace) -> int:
    """Draw a case or a result into a file; return the exit status."""
    renderer()  # before anything is simulated
    shot = RenderOptions(field=options.field, texture=options.texture, size=_size(options.size))
    if options.field:
        quantity(options.field)
    path = Path(named(options.out))
    _refuse_unused(options, path)
    still = options.setup or options.panels or options.time or options.depth
    require_kind(path, STILLS if still else tuple(dict.fromkeys((*STILLS, *MOVING))))
    probe(path)
    if options.setup:
        draw_setup(scene_of(options.case, options.overrides), path, size=shot.size)
    else:
        _draw(options, path, shot)
    record = {"file": str(path), "field": options.field or None, "texture": options.texture or None}
    if options.json:
        say_json(record)
    else:
        say(f"wrote {path}")
    return 0


def _refuse_unused(options: argparse.Namespace, path: Path) -> None:
    """Refuse what the kind of picture would ignore, and numbers that make none."""
    moving = ("frames", "rate")
    if options.setup:
        names = ("compare", "field", "texture", "time", "depth", "panels", *moving)
        refuse_unused_options(options, [(n, "--setup draws the scene alone") for n in names])
    if options.panels is not None:
        whole = ("compare", "time", "depth", *moving)
        refuse_unused_options(options, [(n, "panels show the whole motion") for n in whole])
        if not 1 <= options.panels <= MOST_PANELS:
            remedy = f"give 1 to {MOST_PANELS}"
            raise CaseError("--panels", f"{options.panels} is out of range", remedy)
    if options.time and options.depth:
        raise CaseError("--depth", "would be ignored: --time is there as well", "keep one")
    if options.time or options.depth or path.suffix not in MOVING:
        refuse_unused_options(options, [(n, "this is not an animation") for n in moving])
    if options.rate is not None and not 0.0 < options.rate <= FASTEST:
        raise CaseError("--rate", f"{options.rate:g} is out of range", f"give up to {FASTEST:g}")
    if options.frames is not None:
        limits = scene_of(options.case, options.overrides).limits
        check_count(options.frames, "--frames", limits)


def _draw(options: argparse.Namespace, path: Path, shot: RenderOptions) -> None:
    watch = progress("moving")
    insertion = replay(options.case, options.overrides, watch)
    beside = replay(options.compare, options.overrides, watch) if options.compare else None
    shown = [found for found in (insertion, beside) if found is not None]
    ends = [found.outcome for found in shown if found.outcome.status not in GOOD]
    warn([f"the motion is shown as far as it goes: {end.sentence}" for end in ends])
    time = parse_quantity(options.time, "time", "--time") if options.time else None
    depth = parse_quantity(options.depth, "length", "--depth") if options.depth else None
    still = time is not None or depth is not None
    if options.panels:
        panels(insertion, path, count=options.panels, shot=shot)
    elif path.suffix in MOVING and not still:
        frames = FRAMES if options.frames is None else options.frames
        rate = RATE if options.rate is None else options.rate
        animate(insertion, path, frames=frames, rate=rate, beside=beside, shot=shot)
    else:
        render(insertion, path, depth=depth, time=time, beside=beside, shot=shot)


def _size(text: str) -> tuple[int, int]:
    parts = text.split("x")
    numbers = [int(part) for part in parts if part.isdecimal() and len(part) < 9]
    if len(parts) != 2 or len(numbers) != 2 or numbers[0] < 200 or numbers[1] < 150:
        problem = f"{short(text)} is not a size"
        raise CaseError("--size", problem, "write width x height, as in 1280x720")
    if max(numbers) > MOST_PIXELS:
        problem = f"{short(text)} is out of range"
        raise CaseError("--size", problem, f"at most {MOST_PIXELS} pixels each way")
    return numbers[0], numbers[1]
