"""From a scene to its discretised tissue."""

from collections.abc import Mapping

import numpy as np

from needlefem.arrays import Floats, Points, SkfemMesh
from needlefem.contour import Contour
from needlefem.elements import element_row
from needlefem.errors import CaseError
from needlefem.fem import mesh as meshes
from needlefem.fem.fit import fit_to_contour
from needlefem.fem.model import Model
from needlefem.scene import Scene


def build_mesh(scene: Scene) -> SkfemMesh:
    """Return the scene's mesh: box, refined, fitted, with named regions and faces."""
    wanted = scene.mesh
    origin = wanted.origin or (0.0,) * scene.dim
    contours = {name: region.contour for name, region in scene.regions.items()}
    _check_contours(contours, np.array(origin), np.array(wanted.size))
    mesh = meshes.box(origin, wanted.size, wanted.divisions, wanted.pattern)
    fields = _size_fields(scene, contours)
    if fields:
        mesh = meshes.refine(mesh, lambda x: np.min([field(x) for field in fields], axis=0))
    if wanted.interfaces == "fitted":
        for contour in contours.values():
            mesh = fit_to_contour(mesh, contour)
    return meshes.name_faces(meshes.name_regions(mesh, contours), scene.axes)


def _check_contours(contours: Mapping[str, Contour], low: Floats, size: Floats) -> None:
    for name, contour in contours.items():
        key = f"regions.{name}.contour"
        contour.check(key)
        outside = np.any((contour.points < low) | (contour.points > low + size), axis=1)
        if np.any(outside):
            worst = 100.0 * contour.points[np.flatnonzero(outside)[0]]
            point = f"({worst[0]:.4g}, {worst[1]:.4g}) cm"
            raise CaseError(key, f"the contour leaves the mesh at {point}", "move or enlarge one")


def _size_fields(scene: Scene, contours: Mapping[str, Contour]) -> list[meshes.SizeField]:
    refine = scene.mesh.refine
    fields: list[meshes.SizeField] = []
    if refine.corridor_size > 0.0:
        begin, end = _corridor(scene)
        fields.append(
            meshes.near_segment(begin, end, 0.5 * refine.corridor_width, refine.corridor_size)
        )
    if refine.contour_size > 0.0:
        fields += [meshes.near_contour(c, refine.contour_size) for c in contours.values()]
    return fields


def _corridor(scene: Scene) -> tuple[Points, Points]:
    """Return the ends of the needle's line from the box's boundary to the corridor's depth."""
    direction = np.array(scene.motion.direction)
    point = scene.motion.entry or scene.target
    if point is None:
        remedy = "give motion.entry or target.point, or leave the corridor out"
        raise CaseError("mesh.refine.corridor_size", "there is no needle line to refine", remedy)
    through = np.array(point)
    low = np.array(scene.mesh.origin or (0.0,) * scene.dim)
    high = low + np.array(scene.mesh.size)
    with np.errstate(divide="ignore", invalid="ignore"):
        travel = np.where(direction > 0, (low - through) / direction, (high - through) / direction)
    travel = travel[direction != 0]
    begin = through + np.max(travel) * direction
    depth = scene.mesh.refine.corridor_depth or scene.motion.max_depth
    return begin, begin + depth * direction


def build_model(scene: Scene, mesh: SkfemMesh | None = None) -> Model:
    """Return the scene's discretised tissue; `mesh` spares building it again."""
    mesh = build_mesh(scene) if mesh is None else mesh
    used = {meshes.BACKGROUND: scene.background}
    used |= {name: region.material for name, region in scene.regions.items()}
    materials = {name: scene.materials[material] for name, material in used.items()}
    row = element_row(scene.discretisation.element)
    return Model(mesh, row, materials, scene.supports, scene.axes)
