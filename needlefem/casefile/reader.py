"""Fill dataclasses from tables by what their fields declare."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from needlefem._arrays import SkfemMesh
from needlefem.casefile.contourfile import read_contour
from needlefem.casefile.tables import Table, required
from needlefem.errors import CaseError, nearest, short
from needlefem.geometry.contour import Contour
from needlefem.materials import Material, law_class, volumetric_split
from needlefem.materials.catalogue import tissue_table
from needlefem.mesh.file import read_mesh
from needlefem.mesh.generation import group_cells, outline, parts
from needlefem.scene import BoxMesh, FileMesh, Obstacle, Region, Support
from needlefem.units import parse_quantity
from needlefem.validation import dotted, filled, made, path_of

CONTOUR_KEYS = ("contour", "offset", "unit")
"""Where an outline is; the rest of a table is what it means."""


class CaseReader:
    """Fills dataclasses from tables by what their fields declare."""

    def __init__(self, dim: int, folder: Path, axes: Sequence[str] | None = None) -> None:
        self.dim, self.folder, self.axes = dim, folder, axes
        self.file_mesh: SkfemMesh | None = None

    def fill(self, cls: type, table: Any, prefix: str, **given: Any) -> Any:
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
            self.file_mesh = read_mesh(path, from_file.unit)
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
        contour = read_contour(file, key, self.axes, unit)
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
