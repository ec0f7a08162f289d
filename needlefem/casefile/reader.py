"""Tables of a case file: required keys, placeholders, and dataclasses filled from tables."""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np

# the modules of these folders that read files are imported when they are first used
from needlefem import casefile
from needlefem import mesh as meshes
from needlefem._arrays import Floats, SkfemMesh
from needlefem._toml import dotted_key
from needlefem.errors import CaseError, nearest, short
from needlefem.geometry.contour import Contour
from needlefem.materials import LAWS, Material, law_class, volumetric_split
from needlefem.materials.catalogue import library, tissue_table
from needlefem.mesh.generation import cell_sizes, group_cells, outline, parts
from needlefem.scene import BoxMesh, FileMesh, Motion, Needle, Obstacle, Region, Scene, Support
from needlefem.units import UNITS, dimension_of, parse_quantity
from needlefem.validation import dotted, filled, made, parameter_info, path_of

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Table = Mapping[str, object]
D = TypeVar("D", bound="DataclassInstance")


def table(data: Table, key: str) -> Table:
    """Return a sub-table, or raise a `CaseError` if it is missing or none."""
    found = required(data, key, "")
    if not isinstance(found, dict):
        raise CaseError(key, f"{short(found)} is not a table", f"write [{key}]")
    return found


def tables(data: Table, key: str) -> dict[str, Table]:
    """Return a group of named sub-tables; empty when there is none."""
    group = data.get(key, {})
    if not isinstance(group, dict) or not all(isinstance(t, dict) for t in group.values()):
        raise CaseError(key, "must hold one table for every name", f"write [{key}.name]")
    return group


def required(table: Table, key: str, prefix: str) -> object:
    """Return the value of a key, or raise a `CaseError` if it is missing."""
    if key not in table:
        where = f"[{prefix}]" if prefix else "the case"
        raise CaseError(dotted(prefix, key), "missing", f"add it to {where}")
    return table[key]


# Placeholders: ``"?"`` stands for a value that ``needlefem new`` could not derive.


OPEN = "?"
_CLASSES: dict[str, tuple[type, ...]] = {
    "mesh": (FileMesh, BoxMesh),
    "regions": (Region,),
    "supports": (Support,),
    "needle": (Needle,),
    "motion": (Motion,),
}
_SENTENCES = {
    "target.point": 'the point to hit, such as ["1.5 cm", "3 cm"]',
    "tissue.default_material": "the material outside all regions",
}


def refuse_open(data: Table, file: str = "") -> None:
    """Raise a `CaseError` for the first value that is ``"?"``; it names the file and the others."""
    keys = [path for path in _open_keys(data, ()) if not _is_name(data, path)]
    if not keys:
        return
    rest = f"; so are {', '.join(map(dotted_key, keys[1:]))}" if len(keys) > 1 else ""
    key = dotted_key(keys[0])
    where = f" in {file}" if file else ""
    raise CaseError(key, f"'{OPEN}' is still open{where}{rest}", f"write {_what(keys[0])}")


def _is_name(data: Table, path: tuple[str, ...]) -> bool:
    """Say whether a key's value is somebody's name for a thing, of which ``"?"`` may be one."""
    if path == ("title",) or path[-1] in ("group", "file"):
        return True
    materials = data.get("materials")
    return path[-1] in ("material", "default_material") and isinstance(materials, dict) and (
        OPEN in materials
    )  # fmt: skip


def _open_keys(node: object, path: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
    if node == OPEN:
        yield path
    elif isinstance(node, dict):
        for key, value in node.items():
            yield from _open_keys(value, (*path, str(key)))
    elif isinstance(node, list) and OPEN in node:
        yield path


def _what(path: tuple[str, ...]) -> str:
    """Return what belongs to a key, from its field's own declaration."""
    name, dotted = path[-1], ".".join(path)
    if name == "tissue" and path[0] == "materials":
        return f"a tissue of the library ({', '.join(library())}) or its constants instead"
    for cls in tuple(LAWS.values()) if path[0] == "materials" else _CLASSES.get(path[0], ()):
        for field in dataclasses.fields(cls):
            declared = parameter_info(field)
            if field.name == name and declared is not None:
                sentence = declared.sentence[0].lower() + declared.sentence[1:]
                return sentence + _example(declared.dimension)
    return _SENTENCES.get(dotted, "its value")


def _example(dimension: str | None) -> str:
    if dimension is None:
        return ""
    unit = next(iter(UNITS[dimension_of(dimension)]))
    return f', such as "1 {unit}"'


# Dataclasses filled from tables, by the declarations of their fields.


CONTOUR_KEYS = ("contour", "offset", "unit")
"""Where an outline is; the rest of a table is what it means."""


class CaseReader:
    """Fills dataclasses from tables by what their fields declare."""

    def __init__(self, dim: int, folder: Path, axes: Sequence[str] | None = None) -> None:
        self.dim, self.folder, self.axes = dim, folder, axes
        self.file_mesh: SkfemMesh | None = None

    def fill(self, cls: type[D], table: object, prefix: str, **given: object) -> D:
        """Return an instance of `cls`; `given` fields are not looked for in the table."""
        return filled(cls, table, prefix, strict=True, **given)

    def point(self, table: Table, name: str, prefix: str) -> tuple[float, ...]:
        """Return a point: as many lengths as there are axes."""
        raw, key = required(table, name, prefix), dotted(prefix, name)
        if not isinstance(raw, list) or len(raw) != self.dim:
            remedy = f"write {self.dim} lengths, one for each axis"
            raise CaseError(key, f"{short(raw)} is not a point", remedy)
        return tuple(parse_quantity(item, "length", key) for item in raw)

    def mesh(self, table: Table) -> BoxMesh | FileMesh:
        """Read [mesh]: a file, or a box."""
        if "file" in table:
            rest = {key: value for key, value in table.items() if key != "file"}
            path = self.folder / path_of(table["file"], "mesh.file")
            from_file: FileMesh = self.fill(FileMesh, rest, "mesh", path=path)
            self.file_mesh = meshes.read_mesh(path, from_file.unit)
            return from_file
        box: BoxMesh = self.fill(BoxMesh, table, "mesh")
        return box

    def material(self, table: Table, name: str) -> Material:
        """Read [materials.NAME]; the law's own fields decide which keys there are."""
        prefix = f"materials.{name}"
        if "tissue" in table:
            known = tissue_table(text_of(table, "tissue", prefix), f"{prefix}.tissue")
            table = {**known, **{key: value for key, value in table.items() if key != "tissue"}}
        law = text_of(table, "law", prefix) if "law" in table else "isotropic"
        fields = {key: value for key, value in table.items() if key != "law"}

        def of_law() -> Material:  # a law does not know its name
            found: Material = self.fill(law_class(law, f"{prefix}.law"), fields, prefix)
            volumetric_split(found)
            return found

        material: Material = made(of_law, "material", prefix)
        return material

    def region(self, table: Table, name: str) -> Region:
        """Read [regions.NAME]: a group of the mesh file, or a contour's file and offset."""
        prefix = f"regions.{name}"
        rest = {key: value for key, value in table.items() if key not in CONTOUR_KEYS}
        if "group" in table and self.file_mesh is not None:
            group = text_of(table, "group", prefix)
            around = outline(self.file_mesh, group_cells(self.file_mesh, group, f"{prefix}.group"))
            of_group: Region = self.fill(Region, rest, prefix, contour=around)
            return of_group
        inside: Region = self.fill(Region, rest, prefix, contour=self._contour(table, prefix))
        return inside

    def _contour(self, table: Table, prefix: str) -> Contour:
        """Read a contour's file in its unit, and move it by an offset if there is one."""
        key = f"{prefix}.contour"
        file = self.folder / path_of(required(table, "contour", prefix), key)
        unit = None
        if "unit" in table:
            unit = parse_quantity(table["unit"], "length", f"{prefix}.unit")
            if not 0.0 < unit < np.inf:
                problem = short(table["unit"])
                raise CaseError(f"{prefix}.unit", problem, "give a positive length")
        contour = casefile.read_contour(file, key, self.axes, unit)
        if "offset" in table:
            contour = contour.moved(np.array(self.point(table, "offset", prefix)))
        return contour

    def support(self, table: Table, name: str) -> Support:
        """Read [supports.NAME]: faces, regions or both."""
        if "faces" not in table and "regions" not in table:
            raise CaseError(f"supports.{name}.faces", "missing", "name faces or regions to hold")
        found: Support = self.fill(Support, table, f"supports.{name}")
        return found

    def obstacle(self, table: Table, name: str, regions: Mapping[str, Region]) -> Obstacle:
        """Read [obstacles.NAME]: a region of the tissue, or a contour's file and offset."""
        prefix = f"obstacles.{name}"
        if "region" in table:
            region = text_of(table, "region", prefix)
            if region not in regions:
                remedy = nearest(region, regions)
                raise CaseError(f"{prefix}.region", f"no region {short(region)}", remedy)
            self._refuse_parts(regions[region], region, f"{prefix}.region")
            contour, rest = regions[region].contour, table
        else:
            contour = self._contour(table, prefix)
            rest = {key: value for key, value in table.items() if key not in CONTOUR_KEYS}
        found: Obstacle = self.fill(Obstacle, rest, prefix, contour=contour)
        return found

    def _refuse_parts(self, region: Region, name: str, key: str) -> None:
        """Refuse a group of several parts: an obstacle has one outline."""
        if region.group is None or self.file_mesh is None:
            return
        count = parts(self.file_mesh, group_cells(self.file_mesh, region.group, key))
        if count > 1:
            problem = f"the group of region {short(name)} has {count} parts that are not joined"
            remedy = "make each part a group, a region and an obstacle of its own"
            raise CaseError(key, problem, remedy)


def text_of(table: Table, name: str, prefix: str) -> str:
    """Return the value of a key that must be a text, or raise a `CaseError`."""
    raw = required(table, name, prefix)
    if not isinstance(raw, str):
        raise CaseError(dotted(prefix, name), f"{short(raw)} is not a text", "write a text")
    return raw


# Detection of a wrong unit of a mesh file, by the other lengths of the case.


MESH_UNITS = {"1 um": 1e-6, "1 mm": 1e-3, "1 cm": 1e-2, "1 m": 1.0}
"""Units in which meshes are written."""
MARGIN = 0.1
"""Share of the mesh's extent by which a point may lie outside of the box around it."""
COARSEST = 4.0
"""Element size over the tip radius above which no needle is simulated; see `needle_resolution`."""


def refuse_wrong_unit(scene: Scene, mesh: SkfemMesh, unit: float) -> None:
    """Refuse a unit that nothing fits where another one lets everything fit.

    What must fit: target and entry lie in the mesh, the tip is narrower than the tissue, and the
    smallest elements can resolve the tip.

    Parameters
    ----------
    scene : Scene
    mesh : skfem.Mesh
        As read, in metres.
    unit : float, m
        With which it was read.

    Raises
    ------
    CaseError
        The scene does not fit the mesh; it does in a unit of `MESH_UNITS`, which the message names.
    """
    low, high = mesh.p.min(axis=1), mesh.p.max(axis=1)
    least = float(cell_sizes(mesh).min())
    points = [np.array(p) for p in (scene.target, scene.motion.entry or None) if p is not None]
    misfit = _misfit(scene, low, high, least, points)
    if misfit is None:
        return
    for text, other in MESH_UNITS.items():
        factor = other / unit
        if _misfit(scene, factor * low, factor * high, factor * least, points) is None:
            wide = " x ".join(f"{length:.3g}" for length in 1e3 * (high - low))
            problem = f"the mesh is {wide} mm in this unit, and {misfit}"
            raise CaseError("mesh.unit", problem, f'write unit = "{text}"')


def _misfit(
    scene: Scene, low: Floats, high: Floats, least: float, points: list[Floats]
) -> str | None:
    """Return what does not fit a mesh between two corners with elements of a least size."""
    radius, extent = scene.needle.tip_radius, high - low
    if 2.0 * radius > extent.min():
        return f"the tip is {2e3 * radius:.3g} mm wide"
    if least > COARSEST * radius:
        return f"its smallest element has {1e3 * least:.3g} mm, the tip's radius is " + (
            f"{1e3 * radius:.3g} mm"
        )
    for point in points:
        if np.any((point < low - MARGIN * extent) | (point > high + MARGIN * extent)):
            return f"({', '.join(f'{100.0 * x:.3g}' for x in point)}) cm lies outside"
    return None
