"""Case files: TOML in, a `Scene` out, and every mistake answered with a line."""

import dataclasses
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from needlefem._inputfile import read_text
from needlefem._toml import assignment, key_parts
from needlefem.casefile.expectations import read_expectations
from needlefem.casefile.meshunit import refuse_wrong_unit
from needlefem.casefile.openkeys import refuse_open
from needlefem.casefile.reader import CaseReader
from needlefem.casefile.tables import Table, required, table, tables
from needlefem.errors import CaseError, short
from needlefem.geometry.image_frame import ImageFrame
from needlefem.scene import (
    Discretisation,
    FileMesh,
    Limits,
    Motion,
    Needle,
    Outputs,
    Planning,
    Rayleigh,
    Scene,
    TargetDraw,
    canonical,
)
from needlefem.validation import refuse_unknown

SCHEMA_VERSION = 1
PLANE = 2
"""Number of axes of a case."""
SECTIONS = (
    "schema_version", "title", "axes", "mesh", "tissue", "materials", "regions", "supports",
    "obstacles", "damping", "discretisation", "needle", "motion", "target", "planning", "targets",
    "outputs", "limits", "expect", "frame",
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
    data = _spelled(_parsed(text, str(path)))
    recorded = {key: _override(data, key, value) for key, value in map(_split, overrides)}
    refuse_open(data, str(path))
    scene = read_scene(data, path.parent)
    return dataclasses.replace(scene, source=path, overrides=recorded)


def _parsed(text: str, key: str) -> dict[str, Any]:
    """Return the tables of a TOML document."""
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise CaseError(key, "tables or lists are nested too deep", "correct the file") from None
    except ValueError as error:  # not TOML, or a number of thousands of digits
        raise CaseError(key, f"not valid TOML: {error}", "correct the file") from None


def _spelled(data: dict[str, Any]) -> dict[str, Any]:
    """Return the tables with every section under the name that is read."""
    found: dict[str, Any] = {}
    for key, value in data.items():
        name = canonical(key)
        if name in found:
            raise CaseError(key, f"[{name}] is there as well", "keep one of the two")
        found[name] = value
    return found


def _split(override: str) -> tuple[str, str]:
    found = assignment(override)
    if found is None or not found[0]:
        raise CaseError("--set", f"'{override}' is no assignment", "write key=value")
    return found


def _override(data: dict[str, Any], key: str, text: str) -> Any:
    try:
        value = tomllib.loads(f"value = {text}")["value"]
    except RecursionError:
        raise CaseError(f"--set {key}", "nested too deep", "give a simpler value") from None
    except ValueError:
        value = text
    first, *rest = key_parts(key)
    *folders, name = [canonical(first), *rest]
    table = data
    for folder in folders:
        table = table.setdefault(folder, {})
        if not isinstance(table, dict):
            raise CaseError(f"--set {key}", f"'{folder}' is not a table", "check the key")
    table[name] = value
    return value


def read_scene(data: Table, folder: Path) -> Scene:
    """Return the scene of a parsed case whose files are in `folder`."""
    data = _spelled(dict(data))
    refuse_unknown(data, SECTIONS, "")
    refuse_open(data)
    version = required(data, "schema_version", "")
    if version != SCHEMA_VERSION or type(version) is not int:
        problem = f"{short(version)} is not known"
        raise CaseError("schema_version", problem, f"write {SCHEMA_VERSION}")
    axes = _axes(data)
    reader = CaseReader(len(axes), folder, axes)
    tissue = table(data, "tissue")
    refuse_unknown(tissue, ("background", "plane"), "tissue")
    target = table(data, "target") if "target" in data else None
    if target is not None:
        refuse_unknown(target, ("point",), "target")
    mesh = reader.mesh(table(data, "mesh"))  # before the regions, which may be groups of it
    regions = {n: reader.region(t, n) for n, t in tables(data, "regions").items()}
    obstacles = tables(data, "obstacles")
    scene = Scene(
        title=data.get("title", "untitled"),
        axes=axes,
        mesh=mesh,
        materials={n: reader.material(t, n) for n, t in tables(data, "materials").items()},
        background=required(tissue, "background", "tissue"),
        regions=regions,
        supports={n: reader.support(t, n) for n, t in tables(data, "supports").items()},
        obstacles={n: reader.obstacle(t, n, regions) for n, t in obstacles.items()},
        plane=tissue.get("plane", "strain"),
        damping=reader.fill(Rayleigh, data.get("damping", {}), "damping"),
        discretisation=reader.fill(
            Discretisation, data.get("discretisation", {}), "discretisation"
        ),
        needle=reader.fill(Needle, table(data, "needle"), "needle"),
        motion=reader.fill(Motion, table(data, "motion"), "motion"),
        target=None if target is None else reader.point(target, "point", "target"),
        planning=reader.fill(Planning, data.get("planning", {}), "planning"),
        targets=reader.fill(TargetDraw, data["targets"], "targets") if "targets" in data else None,
        outputs=reader.fill(Outputs, data.get("outputs", {}), "outputs"),
        limits=reader.fill(Limits, data.get("limits", {}), "limits"),
        expect=read_expectations(data.get("expect", []), axes),
        frame=reader.fill(ImageFrame, data["frame"], "frame") if "frame" in data else None,
    )
    if reader.file_mesh is not None and isinstance(mesh, FileMesh):
        refuse_wrong_unit(scene, reader.file_mesh, mesh.unit)
    return scene


def _axes(data: Table) -> tuple[str, ...]:
    axes = data.get("axes", ["y", "z"])
    if not (
        isinstance(axes, list)
        and len(axes) == PLANE
        and all(isinstance(axis, str) and axis.strip() for axis in axes)
        and axes[0] != axes[1]
    ):
        raise CaseError("axes", short(axes), 'name two different axes, such as ["y", "z"]')
    return tuple(axes)
