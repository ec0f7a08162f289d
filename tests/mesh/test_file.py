"""Meshes from files: the same answers as from a box, and every mistake said."""

from pathlib import Path

import meshio
import numpy as np
import pytest

from needlefem import load_case, simulate
from needlefem.errors import CaseError
from needlefem.insertion import Simulation
from needlefem.mesh import box, read_mesh
from needlefem.scene import BoxMesh, FileMesh, build_mesh, vary

CASE = """
schema_version = 2
[mesh]
file = "{file}"
unit = "1 mm"
cell = "{cell}"
[tissue]
default_material = "gel"
[materials.gel]
youngs_modulus = "30 kPa"
poissons_ratio = 0.45
[materials.stiff]
youngs_modulus = "90 kPa"
poissons_ratio = 0.45
[regions.organ]
group = "{group}"
material = "stiff"
[supports.walls]
faces = ["{face}"]
[needle]
tip_radius = "2 mm"
cutting_force = "50 N/m"
shaft_friction = "10 kPa"
[motion]
direction = [0, 1]
entry = ["2.87 cm", "0 cm"]
max_depth = "3 cm"
"""


def square(pattern: str = "diagonal") -> object:
    """Return a box of 60 mm in mm, with an organ in a corner."""
    return box((0.0, 0.0), (60.0, 60.0), (20, 20), pattern)


def write(path: Path, pattern: str = "diagonal") -> Path:
    """Write the square as Gmsh would, its walls and an organ as physical groups."""
    mesh = square(pattern)
    middles = mesh.p[:, mesh.t].mean(axis=1)
    organ = (middles[0] > 36.0) & (middles[1] > 15.0) & (middles[1] < 45.0)
    outer = mesh.boundary_facets()
    places = mesh.p[:, mesh.facets[:, outer]].mean(axis=1)
    walls = outer[places[1] > 1e-6]
    cell = "triangle" if len(mesh.t) == 3 else "quad"
    tags = [np.where(organ, 2, 1), np.full(len(walls), 3)]
    meshio.write(
        path,
        meshio.Mesh(
            np.column_stack([mesh.p.T, np.zeros(mesh.nvertices)]),
            [(cell, mesh.t.T), ("line", mesh.facets[:, walls].T)],
            cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags},
            field_data={"rest": [1, 2], "organ": [2, 2], "walls": [3, 1]},
        ),
        file_format="gmsh22",
        binary=True,
    )
    return path


def case(folder: Path, **changes: str) -> Path:
    values = {"file": "square.msh", "cell": "triangle", "group": "organ", "face": "walls"}
    path = folder / "case.toml"
    path.write_text(CASE.format(**(values | changes)))
    return path


@pytest.mark.parametrize("pattern", ["diagonal", "quadrilateral"])
def test_a_file_gives_the_answers_of_the_box(tmp_path: Path, pattern: str) -> None:
    write(tmp_path / "square.msh", pattern)
    cell = "triangle" if pattern == "diagonal" else "quadrilateral"
    scene = load_case(case(tmp_path, cell=cell))
    assert isinstance(scene.mesh, FileMesh)
    around = scene.regions["organ"].contour.points
    assert around.min(axis=0) == pytest.approx([0.036, 0.015], abs=1e-12)
    assert around.max(axis=0) == pytest.approx([0.060, 0.045], abs=1e-12)
    mesh = build_mesh(scene)
    assert mesh.p.max() == pytest.approx(0.06)
    assert len(mesh.subdomains["organ"]) == 8 * 10 * (2 if pattern == "diagonal" else 1)
    path = simulate(scene).tips
    boxed = vary(
        scene,
        {
            "mesh": BoxMesh(size=(0.06, 0.06), divisions=(20, 20), pattern=pattern),
            "regions.organ.group": None,
            "supports.walls.faces": ("y_min", "y_max", "z_max"),
            "discretization.tip_quadrature_points": 400,
        },
    )
    assert path == pytest.approx(simulate(boxed).tips, abs=1e-12)


def test_regions_by_contour_in_a_file_without_groups(tmp_path: Path) -> None:
    mesh = square()
    meshio.write(
        tmp_path / "square.vtu",
        meshio.Mesh(
            np.column_stack([mesh.p.T, np.zeros(mesh.nvertices)]), [("triangle", mesh.t.T)]
        ),
    )
    found = read_mesh(tmp_path / "square.vtu", 1e-3)
    assert found.nelements == mesh.nelements
    assert found.p.max() == pytest.approx(0.06)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        (
            {"group": "gland"},
            "regions.organ.group: no group 'gland' in the mesh; those present are",
        ),
        ({"file": "none.msh"}, "mesh.file: can't read"),
        ({"cell": "hexagon"}, "mesh.cell: 'hexagon' is not known"),
    ],
)
def test_missing_names_are_answered(tmp_path: Path, changes: dict[str, str], says: str) -> None:
    write(tmp_path / "square.msh")
    with pytest.raises(CaseError, match=says):
        load_case(case(tmp_path, **changes))


def test_missing_faces_are_answered(tmp_path: Path) -> None:
    write(tmp_path / "square.msh")
    with pytest.raises(CaseError, match="no face 'floor'; known here: walls"):
        Simulation(load_case(case(tmp_path, face="floor")))


@pytest.mark.parametrize(
    ("points", "cells", "says"),
    [
        ([[0, 0], [1, 0], [0.2, 0.2], [0, 1]], ("quad", [[0, 1, 2, 3]]), "1 cells are flat"),
        ([[0, 0], [1, 1], [1, 0], [0, 1]], ("quad", [[0, 1, 2, 3]]), "crossed .cell 0."),
        ([[0, 0], [1, 0], [2, 0]], ("triangle", [[0, 1, 2]]), "1 cells are flat"),
        ([[0, 0], [1, 0], [0, 0.5]], ("line", [[0, 1], [1, 2]]), "2 lines and no cells"),
    ],
)  # fmt: skip
def test_cells_that_can_not_be_used_are_refused(
    tmp_path: Path, points: list[list[float]], cells: tuple[str, list[list[int]]], says: str
) -> None:
    flat = np.column_stack([np.array(points, dtype=float), np.zeros(len(points))])
    meshio.write(tmp_path / "bad.vtu", meshio.Mesh(flat, [(cells[0], np.array(cells[1]))]))
    with pytest.raises(CaseError, match=says):
        read_mesh(tmp_path / "bad.vtu", 1.0)


def test_a_file_that_is_no_mesh(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("not a mesh")
    with pytest.raises(CaseError, match=r"mesh.file: .*notes.txt"):
        read_mesh(tmp_path / "notes.txt", 1.0)


def test_loose_points_are_dropped(tmp_path: Path) -> None:
    points = np.array([[5.0, 5, 0], [0, 0, 0], [1, 0, 0], [0, 1, 0]])
    meshio.write(tmp_path / "loose.vtu", meshio.Mesh(points, [("triangle", np.array([[1, 2, 3]]))]))
    assert read_mesh(tmp_path / "loose.vtu", 1.0).nvertices == 3


def test_a_box_has_no_groups(tmp_path: Path) -> None:
    write(tmp_path / "square.msh")
    scene = vary(
        load_case(case(tmp_path)), {"mesh": BoxMesh(size=(0.06, 0.06), divisions=(20, 20))}
    )
    with pytest.raises(CaseError, match="regions.organ.group: a box has no groups"):
        build_mesh(scene)


@pytest.mark.parametrize("unit", ["1 m", "1 cm", "1 um"])
def test_a_wrong_unit_is_named_with_the_right_one(tmp_path: Path, unit: str) -> None:
    write(tmp_path / "square.msh")
    load_case(case(tmp_path))
    with pytest.raises(CaseError, match="mesh.unit: the mesh is .* mm in this unit") as caught:
        load_case(case(tmp_path), [f"mesh.unit={unit}"])
    assert 'unit = "1 mm"' in caught.value.remedy


def test_a_unit_is_not_doubted_where_no_other_fits_better(tmp_path: Path) -> None:
    write(tmp_path / "square.msh")
    scene = load_case(case(tmp_path), ['motion.entry=["9 m", "0 m"]', 'needle.tip_radius="1 um"'])
    assert scene.mesh.unit == 1e-3
