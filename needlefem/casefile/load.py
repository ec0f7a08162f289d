"""Case files: TOML in, a `Scene` out, and every mistake answered with a line."""

import dataclasses
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from needlefem.casefile.expectations import read_expectation
from needlefem.casefile.openkeys import refuse_open
from needlefem.casefile.reader import DIMENSIONS, Reader
from needlefem.casefile.tables import Table, refuse_unknown, required, table, tables
from needlefem.errors import CaseError, nearest
from needlefem.frame import Frame
from needlefem.inputfile import read_text
from needlefem.scene import (
    Discretisation,
    Needle,
    Outputs,
    Planning,
    Rayleigh,
    Scene,
    TargetDraw,
)

SCHEMA_VERSION = 1
SECTIONS = (
    "schema_version", "title", "axes", "mesh", "tissue", "materials", "regions", "supports",
    "obstacles", "damping", "discretisation", "needle", "motion", "target", "planning", "targets",
    "outputs", "expect", "frame",
)  # fmt: skip


def load_case(path: str | Path, overrides: Sequence[str] = ()) -> Scene:
    """Read a case.

    Parameters
    ----------
    path : str or Path
        The TOML file; contour files are looked for beside it.
    overrides : sequence of str
        ``"needle.tip_radius=1 mm"`` replaces a key of the file; recorded in the scene.

    Raises
    ------
    CaseError
        Anything in it that can't be used; the message names key, value and remedy.
    """
    path = Path(path)
    text = read_text(path, "case", remedy="give the path of a case.toml")
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise CaseError(str(path), f"not valid TOML: {error}", "correct the file") from None
    recorded = {key: _override(data, key, value) for key, value in map(_split, overrides)}
    scene = read_scene(data, path.parent)
    return dataclasses.replace(scene, source=path, overrides=recorded)


def _split(override: str) -> tuple[str, str]:
    key, equals, value = override.partition("=")
    if not equals or not key.strip():
        raise CaseError("--set", f"'{override}' is no assignment", "write key=value")
    return key.strip(), value.strip()


def _override(data: dict[str, Any], key: str, text: str) -> Any:
    try:
        value = tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        value = text
    *folders, name = key.split(".")
    table = data
    for folder in folders:
        table = table.setdefault(folder, {})
        if not isinstance(table, dict):
            raise CaseError(f"--set {key}", f"'{folder}' is not a table", "check the key")
    table[name] = value
    return value


def read_scene(data: Table, folder: Path) -> Scene:
    """Return the scene of a parsed case whose files are in `folder`."""
    refuse_unknown(data, SECTIONS, "")
    refuse_open(data)
    version = required(data, "schema_version", "")
    if version != SCHEMA_VERSION:
        raise CaseError("schema_version", f"{version!r} is not known", f"write {SCHEMA_VERSION}")
    axes = _axes(data)
    reader = Reader(len(axes), folder, axes)
    tissue = table(data, "tissue")
    refuse_unknown(tissue, ("background", "plane"), "tissue")
    plane = _plane(tissue)
    target = table(data, "target") if "target" in data else None
    if target is not None:
        refuse_unknown(target, ("point",), "target")
    mesh = reader.mesh(table(data, "mesh"))  # before the regions, which may be groups of it
    regions = {n: reader.region(t, n) for n, t in tables(data, "regions").items()}
    obstacles = tables(data, "obstacles")
    scene = Scene(
        title=str(data.get("title", "untitled")),
        axes=axes,
        mesh=mesh,
        materials={n: reader.material(t, n) for n, t in tables(data, "materials").items()},
        background=str(required(tissue, "background", "tissue")),
        regions=regions,
        supports={n: reader.support(t, n) for n, t in tables(data, "supports").items()},
        obstacles={n: reader.obstacle(t, n, regions) for n, t in obstacles.items()},
        plane=plane,
        damping=reader.fill(Rayleigh, data.get("damping", {}), "damping"),
        discretisation=reader.fill(
            Discretisation, data.get("discretisation", {}), "discretisation"
        ),
        needle=reader.fill(Needle, table(data, "needle"), "needle"),
        motion=reader.motion(table(data, "motion")),
        target=None if target is None else reader.point(target, "point", "target"),
        planning=reader.fill(Planning, data.get("planning", {}), "planning"),
        targets=reader.fill(TargetDraw, data["targets"], "targets") if "targets" in data else None,
        outputs=reader.fill(Outputs, data.get("outputs", {}), "outputs"),
        expect=tuple(read_expectation(item, i) for i, item in enumerate(data.get("expect", ()))),
        frame=reader.fill(Frame, data["frame"], "frame") if "frame" in data else None,
    )
    _check_names(scene)
    return scene


def _axes(data: Table) -> tuple[str, ...]:
    axes = tuple(data.get("axes", ("y", "z")))
    if len(axes) not in DIMENSIONS or len(set(axes)) != len(axes):
        raise CaseError("axes", f"{list(axes)}", 'name two different axes, such as ["y", "z"]')
    return axes


def _plane(tissue: Table) -> str:
    plane = str(tissue.get("plane", "strain"))
    if plane not in ("strain", "stress"):
        raise CaseError("tissue.plane", f"'{plane}' is not known", "write 'strain' or 'stress'")
    return plane


def _check_names(scene: Scene) -> None:
    used = {"tissue.background": scene.background}
    used |= {f"regions.{n}.material": region.material for n, region in scene.regions.items()}
    for key, name in used.items():
        if name not in scene.materials:
            raise CaseError(key, f"no material '{name}'", nearest(name, scene.materials))
    if scene.targets is not None and scene.targets.region not in scene.regions:
        name = scene.targets.region
        raise CaseError("targets.region", f"no region '{name}'", nearest(name, scene.regions))
    for n, support in scene.supports.items():
        for name in support.regions:
            if name not in scene.regions:
                remedy = nearest(name, scene.regions)
                raise CaseError(f"supports.{n}.regions", f"no region '{name}'", remedy)
    for direction in scene.planning.directions:
        if len(direction) != scene.dim or not any(direction):
            remedy = f"give {scene.dim} numbers each, not all zero"
            raise CaseError("planning.directions", f"{list(direction)}", remedy)
    low, high = scene.planning.height_range
    if low >= high:
        raise CaseError("planning.height_range", f"{low:g} to {high:g} m is empty", "swap the ends")
