"""Insertions for pictures: a case's own motion, or a result gone through again.

Results keep no fields: they follow from the case, faster than they would be read. What is drawn
is compared with what was written.
"""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from needlefem._arrays import Floats
from needlefem.casefile.load import load_case
from needlefem.casefile.saved_case import SavedCase, read_again
from needlefem.errors import CaseError
from needlefem.insertion.result import Insertion
from needlefem.insertion.simulation import Simulation, Watch
from needlefem.planning.plan import turned
from needlefem.scene import Motion, Scene, Stage

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
    return simulation.move(simulation.entry_of_case())


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
    stages = (Stage(to=depth, release="seed"), Stage(to=-OUT))
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
