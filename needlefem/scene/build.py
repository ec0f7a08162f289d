"""Mesh and tissue model of a scene."""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

# the modules of this folder that fit and read meshes are imported when they are first used
from needlefem import mesh as meshes
from needlefem._arrays import Floats, Points, SkfemMesh
from needlefem._progress import doing
from needlefem.elements import element_row
from needlefem.errors import CaseError
from needlefem.fem.tissue_model import TissueModel
from needlefem.geometry.contour import Contour
from needlefem.mesh import generation
from needlefem.mesh.cell_map import cell_measures
from needlefem.scene.discretization import BoxMesh, FileMesh
from needlefem.scene.limits import SPLIT, check_cells, check_mesh
from needlefem.scene.resolve import resolve
from needlefem.scene.schema import Scene

AREA_LOST = 0.25
"""Largest relative difference of area between a region and its fitted cells; that of a circle with
seven chords is less."""
TRIALS = 8
MOST_EDGES = 4000
"""Largest number of edges along contours on the meshes where a remedy is searched."""
QUADRILATERAL = "quadrilateral"
THREE_OF_A_TRIANGLE = 6.0**0.5
"""Size of a triangle over that of the three quadrilaterals made of it."""


def build_mesh(scene: Scene) -> SkfemMesh:
    """Return the mesh of a scene: box, refined, fitted, with named regions and faces."""
    doing("building the mesh")
    wanted = scene.mesh
    check_mesh(scene)
    if isinstance(wanted, FileMesh):
        return _mesh_of_file(scene, wanted)
    for name, region in scene.regions.items():
        if region.group is not None:
            remedy = "give a contour; groups belong to meshes from files"
            raise CaseError(f"regions.{name}.group", "a box has no groups", remedy)
    origin = wanted.origin or (0.0,) * scene.dim
    contours = _contours(scene)
    _check_contours(contours, np.array(origin), np.array(wanted.size))
    try:
        mesh = _box_cells(scene, wanted, origin, contours)
    except CaseError as error:
        if error.key != "mesh.interfaces" or "contour_size" not in error.remedy:
            raise
        raise CaseError(error.key, error.problem, _fitting_size(scene, wanted, contours)) from None
    return generation.name_faces(generation.name_regions(mesh, contours), scene.axes)


def _contours(scene: Scene) -> dict[str, Contour]:
    return {n: r.contour for n, r in scene.regions.items() if r.group is None}


def _box_cells(
    scene: Scene, wanted: BoxMesh, origin: Sequence[float], contours: Mapping[str, Contour]
) -> SkfemMesh:
    fields = _size_fields(scene, wanted, contours)
    fitted = wanted.interfaces == "fitted" and bool(contours)
    split = wanted.pattern == QUADRILATERAL and (fitted or bool(fields))
    pattern = "diagonal" if split else wanted.pattern
    mesh = generation.box(origin, wanted.size, wanted.divisions, pattern)
    larger = THREE_OF_A_TRIANGLE if split else 1.0
    if fields:

        def wanted_size(points: Points) -> Floats:  # of corners, fewer than cells, and of centroids
            cells = len(points) * (SPLIT if split else 1)
            check_cells(scene, cells, "mesh.refine", "larger element sizes")
            least: Floats = larger * np.min([field(points) for field in fields], axis=0)
            return least

        for contour, size in _contour_sizes(scene, wanted, contours):
            mesh = generation.find_contour(mesh, contour, larger * size)
        mesh = generation.refine(mesh, wanted_size)
    if fitted:
        mesh = meshes.fit_to_contours(mesh, contours)
        for name, contour in contours.items():
            _check_area(mesh, name, contour)
    return generation.into_quadrilaterals(mesh) if split else mesh


def _check_area(mesh: SkfemMesh, name: str, contour: Contour) -> None:
    """Raise a `CaseError` if the fitted cells of a contour differ from it in area.

    This happens where parts of the contour are thinner than the cells.
    """
    inside = contour.contains(mesh.p[:, mesh.t].mean(axis=1).T)
    area = float(np.sum(cell_measures(mesh)[inside]))
    if abs(area - contour.area) > AREA_LOST * contour.area:
        problem = f"cells hold {1e6 * area:.3g} mm^2 of the {1e6 * contour.area:.3g} mm^2 that "
        problem += f"the contour of '{name}' encloses"
        raise CaseError("mesh.interfaces", problem, "set mesh.refine.contour_size smaller")


def _fitting_size(scene: Scene, wanted: BoxMesh, contours: Mapping[str, Contour]) -> str:
    """Return the remedy for contours that could not be fitted: a size at which fitting succeeds.

    The size is tested on meshes of at most `MOST_EDGES` edges along the contours.
    """
    origin = wanted.origin or (0.0,) * scene.dim
    squares = np.array(wanted.size) / np.array(wanted.divisions)
    size = wanted.refine.contour_size or float(np.max(squares))
    length = sum(contour.length for contour in contours.values())
    for _ in range(TRIALS):
        size = float(f"{size / 2.0**0.5:.2g}")
        if length > MOST_EDGES * size:
            break
        refine = dataclasses.replace(wanted.refine, contour_size=size)
        try:
            _box_cells(scene, dataclasses.replace(wanted, refine=refine), origin, contours)
        except CaseError:
            continue
        text = f"set mesh.refine.contour_size to '{1e3 * size:.2g} mm'"
        return f"{text}, or mesh.interfaces to 'by_centroid'"
    return "set mesh.interfaces to 'by_centroid', or draw the contours apart"


def _mesh_of_file(scene: Scene, wanted: FileMesh) -> SkfemMesh:
    mesh = meshes.read_mesh(wanted.path, wanted.unit)
    check_cells(scene, mesh.nelements, "mesh.file", "a coarser mesh")
    _check_contours_in(mesh, _contours(scene))
    groups = {}
    for name, region in scene.regions.items():
        if region.group is not None:
            groups[name] = generation.group_cells(mesh, region.group, f"regions.{name}.group")
    return generation.name_regions(mesh, _contours(scene), groups)


def _check_contours(contours: Mapping[str, Contour], low: Floats, size: Floats) -> None:
    for name, contour in contours.items():
        key = f"regions.{name}.contour"
        contour.check(key)
        outside = np.any((contour.points < low) | (contour.points > low + size), axis=1)
        if np.any(outside):
            worst = 100.0 * contour.points[np.flatnonzero(outside)[0]]
            point = f"({worst[0]:.4g}, {worst[1]:.4g}) cm"
            raise CaseError(key, f"the contour leaves the mesh at {point}", "move or enlarge one")


def _check_contours_in(mesh: SkfemMesh, contours: Mapping[str, Contour]) -> None:
    """Raise a `CaseError` if a corner of a contour is outside a mesh by more than a cell size."""
    if not contours:
        return
    around = generation.outline(mesh, np.arange(mesh.nelements))
    largest = float(np.max(generation.cell_sizes(mesh)))
    for name, contour in contours.items():
        key = f"regions.{name}.contour"
        contour.check(key)
        outside = contour.points[~around.contains(contour.points)]
        away = around.distance(outside)
        if np.max(away, initial=0.0) > largest:
            worst = outside[np.argmax(away)]
            point = f"({100.0 * worst[0]:.4g}, {100.0 * worst[1]:.4g}) cm"
            remedy = "move or enlarge one, and check the units of both"
            raise CaseError(key, f"the contour leaves the mesh at {point}", remedy)


def _size_fields(
    scene: Scene, wanted: BoxMesh, contours: Mapping[str, Contour]
) -> list[generation.SizeField]:
    refine = wanted.refine
    fields: list[generation.SizeField] = []
    if refine.corridor_size > 0.0:
        begin, end = _corridor(scene, wanted)
        fields.append(
            generation.near_segment(begin, end, 0.5 * refine.corridor_width, refine.corridor_size)
        )
    sizes = _contour_sizes(scene, wanted, contours)
    return fields + [generation.near_contour(contour, size) for contour, size in sizes]


def _contour_sizes(
    scene: Scene, wanted: BoxMesh, contours: Mapping[str, Contour]
) -> list[tuple[Contour, float]]:
    """Return the contours along which an element size (m) is wanted, and that size."""
    sizes = {n: scene.regions[n].contour_size or wanted.refine.contour_size for n in contours}
    return [(contour, sizes[name]) for name, contour in contours.items() if sizes[name] > 0.0]


def _corridor(scene: Scene, wanted: BoxMesh) -> tuple[Points, Points]:
    """Return the ends of the needle axis from the boundary of the box to the corridor depth."""
    direction = np.array(scene.motion.direction)
    point = scene.motion.entry or scene.target
    if point is None:
        remedy = "give motion.entry or target.point, or leave the corridor out"
        raise CaseError("mesh.refine.corridor_size", "there is no needle line to refine", remedy)
    through = np.array(point)
    low = np.array(wanted.origin or (0.0,) * scene.dim)
    high = low + np.array(wanted.size)
    with np.errstate(divide="ignore", invalid="ignore"):
        travel = np.where(direction > 0, (low - through) / direction, (high - through) / direction)
    travel = travel[direction != 0]
    begin = through + np.max(travel) * direction
    depth = wanted.refine.corridor_depth or scene.motion.max_depth
    return begin, begin + depth * direction


def build_model(
    scene: Scene, mesh: SkfemMesh | None = None, *, floating: bool = False
) -> TissueModel:
    """Discretise the tissue; parameters and errors are those of `needlefem.build_model`."""
    if scene.discretization.element == "auto":
        scene = resolve(scene).scene
    mesh = build_mesh(scene) if mesh is None else mesh
    used = {generation.BACKGROUND: scene.default_material}
    used |= {name: region.material for name, region in scene.regions.items()}
    materials = {name: scene.materials[material] for name, material in used.items()}
    row = element_row(scene.discretization.element)
    supports = {} if floating else scene.supports
    return TissueModel(
        mesh, row, materials, supports, scene.axes, plane=scene.plane, floating=floating
    )
