"""Plain tissues for checks and reference problems."""

from collections.abc import Mapping

from needlefem.elements import ElementRow
from needlefem.fem.mesh import BACKGROUND, box, name_faces, name_regions
from needlefem.fem.model import Model
from needlefem.materials import Material
from needlefem.scene import Support

ONE_SIDE: Mapping[str, Support] = {"one side": Support(faces=("y_min",))}


def rectangle(
    element: ElementRow,
    material: Material,
    divisions: int,
    size: tuple[float, float] = (1.0, 1.0),
    supports: Mapping[str, Support] = ONE_SIDE,
) -> Model:
    """Return a uniform rectangle of triangles, `divisions` along every side."""
    mesh = box((0.0, 0.0), size, (divisions, divisions))
    named = name_faces(name_regions(mesh, {}), ("y", "z"))
    return Model(named, element, {BACKGROUND: material}, supports, ("y", "z"))
