"""Fill dataclasses from tables by what their fields declare."""

import dataclasses
import types
import typing
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from needlefem.arrays import SkfemMesh
from needlefem.casefile.contourfile import read_contour
from needlefem.casefile.tables import Table, dotted, refuse_unknown, required
from needlefem.contour import Contour
from needlefem.errors import CaseError, nearest
from needlefem.fem.mesh import group_cells, outline
from needlefem.fem.meshfile import read_mesh
from needlefem.knobs import Knob, check_ranges, knob_of
from needlefem.materials import Material, law_class, split
from needlefem.materials.tissues import tissue_table
from needlefem.scene import BoxMesh, FileMesh, Motion, Obstacle, Region, Support
from needlefem.units import parse_quantity

DIMENSIONS = {
    2: {
        "cutting force": "force per length",
        "shaft friction": "pressure",
        "lateral stiffness": "force per volume",
    }
}
"""What the needle's quantities are measured in: in 2D all forces are per metre of thickness."""


CONTOUR_KEYS = ("contour", "offset", "unit")
"""Where an outline is; the rest of a table is what it means."""


class Reader:
    """Fills dataclasses from tables by what their fields declare."""

    def __init__(self, dim: int, folder: Path, axes: Sequence[str] | None = None) -> None:
        self.dim, self.folder, self.axes = dim, folder, axes
        self._mesh: SkfemMesh | None = None

    def fill(self, cls: type, table: Any, prefix: str, **given: Any) -> Any:
        """Return an instance of `cls`; `given` fields are not looked for in the table."""
        if not isinstance(table, dict):
            raise CaseError(prefix, f"{table!r} is not a table", f"write [{prefix}]")
        hints = typing.get_type_hints(cls)
        fields = {f.name: f for f in dataclasses.fields(cls) if f.name not in given}
        refuse_unknown(table, list(fields), prefix)
        values = dict(given)
        for name, field in fields.items():
            if name in table:
                key = dotted(prefix, name)
                values[name] = self._value(hints[name], table[name], knob_of(field), key)
            elif field.default is dataclasses.MISSING:
                declared = knob_of(field)
                remedy = declared.sentence.lower() if declared else "add it"
                raise CaseError(dotted(prefix, name), "missing", f"add it: {remedy}")
        found = cls(**values)
        check_ranges(found, f"{prefix}.")
        return found

    def _value(self, hint: Any, raw: Any, declared: Knob | None, key: str) -> Any:
        if dataclasses.is_dataclass(hint):
            return self.fill(typing.cast(type, hint), raw, key)
        options = typing.get_args(hint)
        if isinstance(hint, types.UnionType):
            return self._value(next(o for o in options if o is not type(None)), raw, declared, key)
        if typing.get_origin(hint) is tuple:
            if not isinstance(raw, list):
                raise CaseError(key, f"{raw!r} is not a list", "write [a, b]")
            return tuple(self._value(options[0], item, declared, key) for item in raw)
        if declared is not None and declared.dimension is not None:
            dimension = DIMENSIONS[self.dim].get(declared.dimension, declared.dimension)
            return parse_quantity(raw, dimension, key)
        return _plain(hint, raw, key)

    def point(self, table: Table, name: str, prefix: str) -> tuple[float, ...]:
        """Return a point: as many lengths as there are axes."""
        raw, key = required(table, name, prefix), dotted(prefix, name)
        if not isinstance(raw, list) or len(raw) != self.dim:
            remedy = f"write {self.dim} lengths, one for each axis"
            raise CaseError(key, f"{raw!r} is not a point", remedy)
        return tuple(parse_quantity(item, "length", key) for item in raw)

    def mesh(self, table: Table) -> BoxMesh | FileMesh:
        """Read [mesh]: a file, or a box."""
        if "file" in table:
            rest = {key: value for key, value in table.items() if key != "file"}
            path = self.folder / str(table["file"])
            from_file: FileMesh = self.fill(FileMesh, rest, "mesh", path=path)
            self._mesh = read_mesh(path, from_file.unit)
            return from_file
        found: BoxMesh = self.fill(BoxMesh, table, "mesh")
        for name in ("size", "divisions", *(("origin",) if found.origin else ())):
            if len(getattr(found, name)) != self.dim:
                problem = f"{len(getattr(found, name))} numbers"
                raise CaseError(f"mesh.{name}", problem, f"give {self.dim}, one for each axis")
        return found

    def material(self, table: Table, name: str) -> Material:
        """Read [materials.NAME]; the law's own fields decide which keys there are."""
        prefix = f"materials.{name}"
        if "tissue" in table:
            known = tissue_table(str(table["tissue"]), f"{prefix}.tissue")
            table = {**known, **{key: value for key, value in table.items() if key != "tissue"}}
        law = str(table.get("law", "isotropic"))
        fields = {key: value for key, value in table.items() if key != "law"}
        try:
            found: Material = self.fill(law_class(law, f"{prefix}.law"), fields, prefix)
            split(found)
        except CaseError as error:
            own = prefix if error.key == "material" else error.key  # a law does not know its name
            raise CaseError(own, error.problem, error.remedy) from None
        return found

    def region(self, table: Table, name: str) -> Region:
        """Read [regions.NAME]: a group of the mesh file, or a contour's file and offset."""
        prefix = f"regions.{name}"
        rest = {key: value for key, value in table.items() if key not in CONTOUR_KEYS}
        if "group" in table and self._mesh is not None:
            group = str(table["group"])
            around = outline(self._mesh, group_cells(self._mesh, group, f"{prefix}.group"))
            of_group: Region = self.fill(Region, rest, prefix, contour=around)
            return of_group
        inside: Region = self.fill(Region, rest, prefix, contour=self._contour(table, prefix))
        return inside

    def _contour(self, table: Table, prefix: str) -> Contour:
        """Read a contour's file in its unit, and move it by an offset if there is one."""
        file = self.folder / str(required(table, "contour", prefix))
        unit = None
        if "unit" in table:
            unit = parse_quantity(table["unit"], "length", f"{prefix}.unit")
            if not 0.0 < unit < np.inf:
                raise CaseError(f"{prefix}.unit", f"{table['unit']!r}", "give a positive length")
        contour = read_contour(file, f"{prefix}.contour", self.axes, unit)
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
            region = str(table["region"])
            if region not in regions:
                remedy = nearest(region, regions)
                raise CaseError(f"{prefix}.region", f"no region '{region}'", remedy)
            contour, rest = regions[region].contour, table
        else:
            contour = self._contour(table, prefix)
            rest = {key: value for key, value in table.items() if key not in CONTOUR_KEYS}
        found: Obstacle = self.fill(Obstacle, rest, prefix, contour=contour)
        return found

    def motion(self, table: Table) -> Motion:
        """Read [motion]; the direction is made a unit vector."""
        found: Motion = self.fill(Motion, table, "motion")
        length = float(np.linalg.norm(found.direction))
        if len(found.direction) != self.dim or not length > 0.0:
            remedy = f"give {self.dim} numbers, not all zero"
            raise CaseError("motion.direction", f"{list(found.direction)}", remedy)
        if found.entry and len(found.entry) != self.dim:
            raise CaseError("motion.entry", f"{len(found.entry)} numbers", f"give {self.dim}")
        unit = tuple(x / length for x in found.direction)
        return dataclasses.replace(found, direction=unit)


def _plain(hint: Any, raw: Any, key: str) -> Any:
    wanted = {str: "a text", int: "a whole number", float: "a number", bool: "true or false"}
    fits = isinstance(raw, hint) and (hint is bool or not isinstance(raw, bool))
    if hint is float and isinstance(raw, int) and not isinstance(raw, bool):
        return float(raw)
    if not fits:
        raise CaseError(key, f"{raw!r} is not {wanted[hint]}", f"write {wanted[hint]}")
    return raw
