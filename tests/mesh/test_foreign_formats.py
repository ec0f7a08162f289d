"""Formats of other programs: their groups, and one sentence whatever their readers do."""

from pathlib import Path

import meshio
import numpy as np
import pytest

from needlefem.errors import CaseError
from needlefem.mesh import box, read_plane_mesh
from needlefem.mesh import foreign_formats as foreignmesh

MESH = box((0.0, 0.0), (4.0, 4.0), (4, 4))
ORGAN = np.flatnonzero(MESH.p[:, MESH.t].mean(axis=1)[0] < 2.0)
OUTER = MESH.facets[:, MESH.boundary_facets()].T
FLOOR = OUTER[np.all(MESH.p[1, OUTER] == 4.0, axis=1)]


def write(path: Path, kind: str, reference: str = "", **sets: object) -> Path:
    """Write a square with an organ and a floor as a format can say it."""
    tags = [np.where(np.isin(np.arange(MESH.nelements), ORGAN), 2, 1), np.full(len(FLOOR), 3)]
    meshio.write(
        path,
        meshio.Mesh(
            np.column_stack([MESH.p.T, np.zeros(MESH.nvertices)]),
            [("triangle", MESH.t.T), ("line", FLOOR)],
            cell_data={reference: tags} if reference else None,
            **sets,
        ),
        file_format=kind,
    )
    return path


@pytest.mark.parametrize(
    ("name", "kind", "reference", "says"),
    [
        ("a.mesh", "medit", "medit:ref", "references"),
        ("a.bdf", "nastran", "nastran:ref", "property numbers"),
        ("a.avs", "avsucd", "avsucd:material", "material numbers"),
    ],
)
def test_numbers_of_parts_are_groups(
    tmp_path: Path, name: str, kind: str, reference: str, says: str
) -> None:
    found = read_plane_mesh(write(tmp_path / name, kind, reference), 1.0)
    assert {k: len(v) for k, v in found.mesh.subdomains.items()} == {"1": 16, "2": 16}
    assert len(found.mesh.boundaries["3"]) == 4
    assert found.notes == (f"Groups are the {says} of the file.",)


def test_element_sets_and_node_sets_of_abaqus(tmp_path: Path) -> None:
    nodes, none = np.unique(FLOOR), np.zeros(0, dtype=int)
    sets = {"point_sets": {"floor": nodes}, "cell_sets": {"organ": [ORGAN, none]}}
    found = read_plane_mesh(write(tmp_path / "a.inp", "abaqus", **sets), 1.0)
    assert len(found.mesh.subdomains["organ"]) == len(ORGAN)
    assert len(found.mesh.boundaries["floor"]) == 4


def test_families_of_med() -> None:
    """What the reader of MED gives, without the package that it needs."""
    told = {
        "types": ["triangle", "line"], "reference": "", "own": [], "names": [], "cell_sets": [],
        "point_sets": [], "families": {"-1": ["organ", "body"], "-2": ["body"], "-3": ["floor"]},
    }  # fmt: skip
    family = np.where(np.isin(np.arange(MESH.nelements), ORGAN), -1, -2)
    arrays = {
        "points": MESH.p.T, "cells0": MESH.t.T, "cells1": FLOOR, "family0": family,
        "family1": np.full(len(FLOOR), -3),
    }  # fmt: skip
    contents = foreignmesh._contents(told, arrays)
    groups = {name for block in contents.cells for name in block.groups}
    assert groups == {"organ", "body", "floor"}
    assert sum(len(b.nodes) for b in contents.cells if "body" in b.groups) == MESH.nelements
    assert sum(len(b.nodes) for b in contents.cells if "organ" in b.groups) == len(ORGAN)


@pytest.mark.parametrize(("name", "kind"), [("a.vtu", "vtu"), ("a.vtk", "vtk")])
def test_formats_without_groups_have_none(tmp_path: Path, name: str, kind: str) -> None:
    """Numbers of cells are data there, not parts, whatever they are called."""
    found = read_plane_mesh(write(tmp_path / name, kind, "gmsh:physical"), 1.0)
    assert not found.mesh.subdomains
    assert not found.mesh.boundaries


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("a.bdf", "x", "its reader raised RuntimeError: .*BEGIN BULK"),
        ("a.vtk", "# vtk DataFile Version 3.0\n", "; give a complete mesh file"),
        ("a.vtu", "<VTKFile", "its reader raised|no reader|;"),
        ("a.xyz", "x", "'.xyz' is not the extension of a mesh file"),
        ("a.med", "x", "files of this kind need the package 'h5py'; pip install h5py"),
        ("a.cgns", "x", "files of this kind need the package 'h5py'"),
        ("a.e", "x", "files of this kind need the package 'netCDF4'; pip install netCDF4"),
        ("a.off", "OFF\n999999999999 1 0\n0 0 0\n", "can't use"),
        ("a.msh", "", "it is empty; save it"),
    ],
)
def test_one_sentence_whatever_the_reader_does(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], name: str, text: str, says: str
) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(CaseError, match=says) as refused:
        read_plane_mesh(tmp_path / name, 1.0)
    assert "\n" not in str(refused.value)
    assert capfd.readouterr() == ("", "")


def test_a_reader_that_never_ends_is_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The time runs from the start of its process, so that a limit of nothing stops any."""
    write(tmp_path / "a.vtu", "vtu")
    monkeypatch.setattr(foreignmesh, "SECONDS", 0.01)
    with pytest.raises(CaseError, match="its reader has not ended after 0 s"):
        read_plane_mesh(tmp_path / "a.vtu", 1.0)


def test_memory_is_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A header that asks for a hundred gigabytes gets none of them."""
    text = "# vtk DataFile Version 3.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\n"
    (tmp_path / "a.vtk").write_text(text + "POINTS 9999999999 double\n0 0 0\n")
    with pytest.raises(CaseError, match="counts exceed the size of the file|a.vtk'"):
        read_plane_mesh(tmp_path / "a.vtk", 1.0)


def test_a_file_is_read_once_until_it_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write(tmp_path / "a.vtu", "vtu")
    first = read_plane_mesh(path, 1.0).mesh
    monkeypatch.setattr(foreignmesh, "read_foreign", None)
    assert read_plane_mesh(path, 1e-3).mesh.p == pytest.approx(1e-3 * first.p)
