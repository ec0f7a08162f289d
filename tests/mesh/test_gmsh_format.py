"""Files that Gmsh itself wrote (tests/fem/gmsh/make.py): groups, places, refusals."""

from pathlib import Path

import numpy as np
import pytest

from needlefem.errors import CaseError
from needlefem.mesh import PlaneMesh, cell_measures, read_mesh, read_plane_mesh

HERE = Path(__file__).parent / "gmsh"
VERSIONS = [
    "text22", "text40", "text40all", "text41", "text41all", "binary22", "binary41", "binary41all",
]  # fmt: skip
SAME = ["lifted", "partitioned", "partitioned22", "xz-plane", "yz-plane", "mixed", "mixed22"]


def read(name: str) -> PlaneMesh:
    return read_plane_mesh(HERE / f"{name}.msh", 1e-3)


def area(found: PlaneMesh, group: str) -> float:
    """Return the area of a group, mm^2."""
    return 1e6 * float(cell_measures(found.mesh)[found.mesh.subdomains[group]].sum())


def length(found: PlaneMesh, face: str) -> float:
    """Return the length of a face, mm."""
    ends = found.mesh.p[:, found.mesh.facets[:, found.mesh.boundaries[face]]]
    return 1e3 * float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=0).sum())


@pytest.mark.parametrize("name", [*VERSIONS, *SAME])
def test_every_way_of_saving_gives_the_same_tissue(name: str) -> None:
    found = read(name)
    assert set(found.mesh.subdomains) == {"organ", "fat"}
    assert set(found.mesh.boundaries) == {"floor", "sides"}
    assert area(found, "organ") == pytest.approx(area(read("text22"), "organ"), rel=1e-9)
    assert area(found, "organ") + area(found, "fat") == pytest.approx(3600.0)
    assert (length(found, "floor"), length(found, "sides")) == pytest.approx((60.0, 120.0))


@pytest.mark.parametrize("name", ["curved-triangles", "curved-quads", "cubic-triangles", "quads"])
def test_cells_of_other_kinds(name: str) -> None:
    """With curved edges read as straight, which is said, with the deviation of the arc."""
    found = read(name)
    corners = 4 if "quads" in name else 3
    assert len(found.mesh.t) == corners
    assert area(found, "organ") + area(found, "fat") == pytest.approx(3600.0)
    assert length(found, "floor") == pytest.approx(60.0)
    if name == "quads":
        assert not found.repairs
        return
    (said,) = found.repairs
    assert "read as straight" in said
    deviation = float(said.split("up to ")[1].split()[0])
    outline = found.mesh.f2t[:, found.mesh.f2t[1] >= 0]
    inside = np.zeros(found.mesh.nelements, dtype=bool)
    inside[found.mesh.subdomains["organ"]] = True
    between = np.flatnonzero(found.mesh.f2t[1] >= 0)[inside[outline[0]] != inside[outline[1]]]
    ends = 1e3 * found.mesh.p[:, found.mesh.facets[:, between]]
    chord = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=0).max()
    sagitta = 12.0 - np.sqrt(144.0 - 0.25 * chord**2)
    assert deviation == pytest.approx(sagitta, rel=0.15)
    with pytest.warns(UserWarning, match="read as straight"):
        read_mesh(HERE / f"{name}.msh", 1e-3)


@pytest.mark.parametrize("version", ["22", "40", "41"])
def test_groups_may_share_cells_and_edges(version: str) -> None:
    found = read(f"overlapping{version}")
    assert area(found, "body") == pytest.approx(3600.0)
    assert area(found, "organ") == pytest.approx(area(read("text22"), "organ"), rel=1e-9)
    assert (length(found, "floor"), length(found, "held")) == pytest.approx((60.0, 120.0))
    assert not found.repairs


@pytest.mark.parametrize("version", ["22", "40", "41"])
def test_groups_without_a_name_are_called_by_their_numbers(version: str) -> None:
    found = read(f"unnamed{version}")
    assert set(found.mesh.subdomains) == {"7", "fat"}
    assert set(found.mesh.boundaries) == {"9"}
    said = " ".join(found.notes)
    assert "cells without a name are called by their numbers: 7." in said
    assert "edges without a name are called by their numbers: 9." in said
    assert "Groups of points are not used: pin." in said


def test_a_file_without_groups_has_none() -> None:
    found = read("no-groups")
    assert not found.mesh.subdomains
    assert not found.mesh.boundaries


def test_the_plane_is_told() -> None:
    assert read("xz-plane").axes == ("x", "z")
    assert read("yz-plane").axes == ("y", "z")


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("lines", "it holds 40 lines and no cells; mesh the surface"),
        ("sphere", "its cells are not in one plane of x, y and z"),
        ("tilted", "its cells are not in one plane .*60 x 51.96 x 30 units"),
        ("volume", "it contains only cells of a volume"),
        (
            "part_1",
            "it has no cells for . of the . surfaces of a partitioned mesh; save the whole mesh",
        ),
    ],
)
def test_what_is_no_plane_tissue_is_refused(name: str, says: str) -> None:
    with pytest.raises(CaseError, match=f"mesh.file: can't use .*{name}.msh': {says}"):
        read(name)


def changed(tmp_path: Path, *changes: tuple[str, str], name: str = "text41") -> Path:
    text = (HERE / f"{name}.msh").read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    (tmp_path / "m.msh").write_text(text)
    return tmp_path / "m.msh"


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("4.1 0 8", "3.0 0 8", "version '3.0 0 8' of Gmsh's format is not read"),
        ("4.1 0 8", "4.1 1 8", "the mark of its byte order is damaged"),
        ("$Nodes\n", "$Nodes\n999999999999 ", "section .Nodes"),
        ("$Elements\n", "$Elements\n9e300 ", "section .Elements"),
        ("$EndElements", "", "section .Elements does not end: the file is cut"),
        ("$Elements", "$Elfments", "section .Elfments does not end"),
    ],
)
def test_damage_is_told(tmp_path: Path, old: str, new: str, says: str) -> None:
    with pytest.raises(CaseError, match=says):
        read_mesh(changed(tmp_path, (old, new)), 1.0)


@pytest.mark.parametrize("name", ["text22", "text40", "text41", "binary22", "binary41"])
def test_a_file_that_is_cut_anywhere_is_refused(tmp_path: Path, name: str) -> None:
    data = (HERE / f"{name}.msh").read_bytes()
    end = data.index(b"$EndElements") + len(b"$EndElements")
    for share in np.linspace(0.0, 1.0, 23)[:-1]:
        (tmp_path / "cut.msh").write_bytes(data[: int(share * end)])
        with pytest.raises(CaseError, match=r"mesh.file: can't use '.*cut.msh': .*; "):
            read_mesh(tmp_path / "cut.msh", 1.0)


def test_names_of_any_text(tmp_path: Path) -> None:
    path = changed(tmp_path, ('"organ"', '"Tumor \\"a\\" (größer) #1"'))
    assert 'Tumor \\"a\\" (größer) #1' in read_mesh(path, 1.0).subdomains
