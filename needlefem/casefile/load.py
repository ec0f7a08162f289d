"""Case files: TOML to a `Scene`, including expectations and cases of saved results."""

import dataclasses
import json
import tomllib
import typing
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from needlefem._inputfile import read_text
from needlefem._toml import assignment, key_of, key_parts, quoted
from needlefem.casefile.reader import (
    CaseReader,
    Table,
    refuse_open,
    refuse_wrong_unit,
    required,
    table,
    tables,
    text_of,
)
from needlefem.errors import CaseError, short
from needlefem.geometry.image_frame import ImageFrame
from needlefem.io.expectations import check_key
from needlefem.scene import (
    Discretization,
    Expectation,
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
from needlefem.scene.version_1 import OldWord, renewed_case, renewed_path, report
from needlefem.units import UNITS, parse_quantity
from needlefem.validation import filled, refuse_unknown

if typing.TYPE_CHECKING:
    from needlefem.io.saved_result import SavedResult


def read_expectations(items: object, axes: Sequence[str]) -> tuple[Expectation, ...]:
    """Return the expectations of a case: its [[expect]] tables; `axes` may pick coordinates."""
    if not isinstance(items, list):
        raise CaseError("expect", f"{short(items)} is not a list of tables", "write [[expect]]")
    found = tuple(read_expectation(item, number) for number, item in enumerate(items))
    for number, item in enumerate(found):
        check_key(item.key, axes, f"expect.{number}.key")
    return found


def read_expectation(item: object, number: int) -> Expectation:
    """Return the expectation of one [[expect]] table; `number` counts them."""
    prefix = f"expect.{number}"
    if not isinstance(item, dict):
        raise CaseError(prefix, f"{short(item)} is not a table", "write [[expect]]")
    refuse_unknown(item, ("key", "value", "tolerance", "kind", "source"), prefix)
    value, unit = _any_quantity(required(item, "value", prefix), f"{prefix}.value")
    tolerance = None
    if "tolerance" in item:
        bound, _ = _any_quantity(item["tolerance"], f"{prefix}.tolerance")
        if isinstance(bound, tuple):
            raise CaseError(f"{prefix}.tolerance", "a list", "write one number")
        tolerance = bound
    fields = {
        "key": required(item, "key", prefix),
        "value": value,
        "tolerance": tolerance,
        "unit": unit,
        "kind": item.get("kind", ""),
        "source": item.get("source", ""),
    }
    return filled(Expectation, fields, prefix)


def _any_quantity(raw: object, key: str) -> tuple[float | tuple[float, ...], str]:
    """Return a value in SI and its unit ('' for a plain number); a list gives a tuple."""
    if isinstance(raw, list):
        if not raw or any(isinstance(item, list) for item in raw):
            raise CaseError(key, f"{short(raw)} is not a point", "give a number for each axis")
        parts = [_any_quantity(item, key) for item in raw]
        return tuple(typing.cast(float, value) for value, _ in parts), parts[0][1]
    if isinstance(raw, int | float) and not isinstance(raw, bool):
        return float(raw), ""
    unit = str(raw).strip().partition(" ")[2].strip()
    for dimension, units in UNITS.items():
        if unit in units:
            return parse_quantity(raw, dimension, key), unit
    raise CaseError(
        key, f"{short(raw)} is not a number with a unit", "write a number, or one with a unit"
    )


# Case files.


SCHEMA_VERSIONS = (1, 2)
PLANE = 2
"""Number of axes of a case."""
SECTIONS = (
    "schema_version", "title", "axes", "mesh", "tissue", "materials", "regions", "supports",
    "obstacles", "damping", "discretization", "needle", "motion", "target", "planning", "targets",
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
    old: list[OldWord] = []
    data = renewed_case(spelled(parsed(text, str(path))), old)
    recorded = {key: _override(data, key, value, old) for key, value in map(_split, overrides)}
    if old:
        remedy = f"'needlefem upgrade {path}' rewrites the file"
        warnings.warn(f"{report(old, str(path))}; {remedy}", FutureWarning, stacklevel=2)
    refuse_open(data, str(path))
    scene = _scene(data, path.parent)
    return dataclasses.replace(scene, source=path, overrides=recorded)


def parsed(text: str, key: str) -> dict[str, object]:
    """Return the tables of a TOML document."""
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise CaseError(key, "tables or lists are nested too deep", "correct the file") from None
    except ValueError as error:  # not TOML, or a number of thousands of digits
        raise CaseError(key, f"not valid TOML: {error}", "correct the file") from None


def spelled(data: Table) -> dict[str, object]:
    """Return the tables with every section under the name that is read."""
    found: dict[str, object] = {}
    for key, value in data.items():
        name = canonical(key)
        if name in found:
            raise CaseError(key, f"[{name}] is there as well", "keep one of the two")
        found[name] = value
    return found


def _split(override: str) -> tuple[str, str]:
    found = assignment(override)
    if found is None or not found[0]:
        raise CaseError("--set", f"'{override}' is not an assignment", "write key=value")
    return found


def _override(data: dict[str, object], key: str, text: str, old: list[OldWord]) -> object:
    try:
        value = tomllib.loads(f"value = {text}")["value"]
    except RecursionError:
        raise CaseError(f"--set {key}", "nested too deep", "give a simpler value") from None
    except ValueError:
        value = text
    first, *rest = key_parts(key)
    path = renewed_path([canonical(first), *rest], old)
    *folders, name = path
    table = data
    for folder in folders:
        inner = table.setdefault(folder, {})
        if not isinstance(inner, dict):
            raise CaseError(f"--set {key}", f"'{folder}' is not a table", "check the key")
        table = inner
    table[name] = renewed_case(value, old, tuple(path))
    return value


def read_scene(data: Table, folder: Path) -> Scene:
    """Return the scene of a parsed case whose files are in `folder`."""
    return _scene(renewed_case(spelled(dict(data)), []), folder)


def _scene(data: Table, folder: Path) -> Scene:
    """Return the scene of the tables of a case in the words of version 2."""
    refuse_unknown(data, SECTIONS, "")
    refuse_open(data)
    version = required(data, "schema_version", "")
    if version not in SCHEMA_VERSIONS or type(version) is not int:
        problem = f"{short(version)} is not known"
        raise CaseError("schema_version", problem, f"write {SCHEMA_VERSIONS[-1]}")
    axes = _axes(data)
    reader = CaseReader(len(axes), folder, axes)
    tissue = table(data, "tissue")
    refuse_unknown(tissue, ("default_material", "plane"), "tissue")
    target = table(data, "target") if "target" in data else None
    if target is not None:
        refuse_unknown(target, ("point",), "target")
    mesh = reader.mesh(table(data, "mesh"))  # before the regions, which may be groups of it
    regions = {n: reader.region(t, n) for n, t in tables(data, "regions").items()}
    obstacles = tables(data, "obstacles")
    scene = Scene(
        title=text_of(data, "title", "") if "title" in data else "untitled",
        axes=axes,
        mesh=mesh,
        materials={n: reader.material(t, n) for n, t in tables(data, "materials").items()},
        default_material=text_of(tissue, "default_material", "tissue"),
        regions=regions,
        supports={n: reader.support(t, n) for n, t in tables(data, "supports").items()},
        obstacles={n: reader.obstacle(t, n, regions) for n, t in obstacles.items()},
        plane=text_of(tissue, "plane", "tissue") if "plane" in tissue else "strain",
        damping=reader.fill(Rayleigh, data.get("damping", {}), "damping"),
        discretization=reader.fill(
            Discretization, data.get("discretization", {}), "discretization"
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


# The case of a result that ``run --out`` or ``plan --out`` wrote.


@dataclasses.dataclass(frozen=True, eq=False)
class SavedCase:
    """A case that a result came from.

    Parameters
    ----------
    scene : Scene
        With the result's overrides.
    record : mapping
        What was written.
    """

    scene: Scene
    record: Mapping[str, Any]

    @property
    def planned(self) -> bool:
        """Whether the result is a plan's."""
        return "release_point" in self.record


def read_again(path: str | Path) -> SavedCase:
    """Read the case of a result.

    Parameters
    ----------
    path : str or Path
        A folder with ``run.json`` or ``plan.json``, or one of these files.

    Raises
    ------
    CaseError
        There is no result, or it does not say from which case it came.
    """
    from needlefem.io.saved_result import load_result  # noqa: PLC0415  (a case needs none of it)

    saved = load_result(path)
    if saved.kind not in ("run", "plan") or not saved.record.get("source"):
        remedy = "write it anew with run --out or plan --out"
        raise CaseError(str(path), "does not say from which case it came", remedy)
    assignments = [
        f"{key}={_toml(value, key, saved.path)}" for key, value in saved.record["overrides"].items()
    ]
    return SavedCase(load_case(_source(saved), assignments), saved.record)


def _source(saved: "SavedResult") -> Path:
    """Return the case's path; where it is not there any more, that of one beside the result."""
    source = Path(saved.record["source"])
    beside = saved.path.parent / source.name
    return beside if not source.exists() and beside.is_file() else source


def _toml(value: object, key: str, file: Path) -> str:
    """Return a value of JSON as TOML."""
    if isinstance(value, list):
        return f"[{', '.join(_toml(item, key, file) for item in value)}]"
    if isinstance(value, dict):
        inner = (f"{key_of(name)} = {_toml(item, key, file)}" for name, item in value.items())
        return f"{{{', '.join(inner)}}}"
    if value is None:
        problem = f"'overrides' in '{file}' has null for '{key}'"
        raise CaseError("result", problem, "write it anew with run --out or plan --out")
    return quoted(value) if isinstance(value, str) else json.dumps(value)
