"""A mesh is one body whose cells cover it once, or the fault is named with its place."""

import numpy as np
import pytest
from skfem import MeshQuad, MeshTet, MeshTri

from needlefem.checks import preflight
from needlefem.elements import element_row
from needlefem.errors import CaseError
from needlefem.fem import TissueModel
from needlefem.materials import Isotropic
from needlefem.mesh import BACKGROUND, box, name_faces, name_regions, refuse_unsound
from needlefem.scene import Support


def joined(*parts: MeshTri) -> MeshTri:
    """Return meshes side by side, without one node in common."""
    offsets = np.cumsum([0, *(part.nvertices for part in parts)])
    cells = [part.t + offset for part, offset in zip(parts, offsets, strict=False)]
    return type(parts[0])(np.hstack([part.p for part in parts]), np.hstack(cells))


def square(x: float = 0.0, y: float = 0.0, n: int = 4, size: float = 0.04) -> MeshTri:
    return box((x, y), (size, size), (n, n))


def without(mesh: MeshTri, cells: list[int] | np.ndarray) -> MeshTri:
    return mesh.remove_elements(np.asarray(cells))


@pytest.mark.parametrize("pattern", ["diagonal", "crossed", "quadrilateral"])
def test_boxes_are_sound(pattern: str) -> None:
    refuse_unsound(box((0, 0), (0.1, 0.05), (7, 5), pattern), "mesh")


def test_holes_notches_and_many_cells_are_sound() -> None:
    mesh = square(n=12)
    refuse_unsound(without(mesh, [100, 101, 140]), "mesh")
    x, y = mesh.p[:, mesh.t].mean(axis=1)
    refuse_unsound(without(mesh, np.flatnonzero((x < 0.02) & (y > 0.02))), "mesh")
    refuse_unsound(MeshTet.init_tensor(*[np.linspace(0.0, 0.1, 4)] * 3), "mesh")


SPIRAL = np.linspace(0.0, 2.4 * np.pi, 60)


def spiral() -> MeshQuad:
    """Return a strip wound by more than a turn, on which its end lies on its beginning."""
    edge = [r * np.stack([np.cos(SPIRAL), np.sin(SPIRAL)]) for r in (0.03, 0.05)]
    k = np.arange(59)
    return MeshQuad(np.hstack(edge), np.stack([k, k + 60, k + 61, k + 1]))


@pytest.mark.parametrize(
    ("mesh", "says"),
    [
        (joined(square(), square(0.1)), r"2 parts that are not joined \(32, 32 cells\); join"),
        (
            joined(square(), square(0.04)),
            r"2 parts that are not joined \(32, 32 cells\): 5 nodes coincide with another, "
            r"the first at \(4, 0\) cm; merge nodes",
        ),
        (joined(square(), square(0.04, n=5)), "2 parts .*: 2 nodes coincide with another"),
        (joined(square(), square(0.04, 0.005)), r"8 nodes lie on another cell's edge"),
        (joined(square(), square(0.01, 0.013)), "2 parts that are not joined"),
        (joined(square(), square()), "25 nodes coincide with another|16 nodes coincide"),
        (spiral(), "cells overlap: edges of the boundary cross near"),
    ],
    ids=["apart", "beside", "other size", "shifted", "on top", "twice", "spiral"],
)  # fmt: skip
def test_what_is_not_one_body_is_refused(mesh: MeshTri, says: str) -> None:
    with pytest.raises(CaseError, match=says):
        refuse_unsound(mesh, "mesh")


def test_a_slit_whose_nodes_coincide() -> None:
    """The parts hang together around the ends of the slit, but not at its nodes."""
    mesh = square(n=6)
    points, cells = mesh.p, mesh.t.copy()
    line = np.flatnonzero((points[1] == points[1, 3]) & (points[0] > 0.01) & (points[0] < 0.03))
    above = mesh.p[1, mesh.t].mean(axis=0) > points[1, 3]
    for new, node in enumerate(line, start=mesh.nvertices):
        cells[:, above] = np.where(cells[:, above] == node, new, cells[:, above])
    slit = MeshTri(np.hstack([points, points[:, line]]), cells)
    with pytest.raises(CaseError, match=f"{len(line)} nodes coincide with another without being"):
        refuse_unsound(slit, "mesh")


def test_a_hanging_node() -> None:
    points = np.array([[0, 0], [2, 0], [2, 1], [0, 1], [1, 1], [1, 2], [0, 2], [2, 2.0]]).T
    cells = np.array([[0, 1, 2, 3], [3, 4, 5, 6], [4, 2, 7, 5]]).T
    with pytest.raises(CaseError, match=r"1 nodes lie on another cell's edge, the first at \(100"):
        refuse_unsound(MeshQuad(points, cells), "mesh")


def test_parts_joined_at_a_point_only() -> None:
    two = joined(square(), square(0.04, 0.04))
    points, index = np.unique(two.p.round(9), axis=1, return_inverse=True)
    with pytest.raises(CaseError, match="2 parts that are not joined"):
        refuse_unsound(MeshTri(points, index.ravel()[two.t]), "mesh")


def test_folded_and_shared_cells() -> None:
    folded = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.7, 0.2]], dtype=float).T
    cells = np.array([[0, 1, 2], [0, 2, 4], [0, 2, 3]]).T
    with pytest.raises(CaseError, match="3 cells share the edge"):
        refuse_unsound(MeshTri(folded, cells), "mesh")
    with pytest.raises(CaseError, match="cells lie on their neighbours at 1 edges"):
        refuse_unsound(MeshTri(folded[:, [0, 1, 2, 4]], np.array([[0, 1, 2], [0, 2, 3]]).T), "mesh")


def test_bad_cells_and_nodes() -> None:
    mesh = square()
    moved = mesh.p.copy()
    moved[:, 7] = np.nan
    with pytest.raises(CaseError, match=r"node 7 is at \(nan, nan\)"):
        refuse_unsound(MeshTri(moved, mesh.t), "mesh")
    with pytest.raises(CaseError, match="1 nodes are in no cell, such as 0"):
        refuse_unsound(MeshTri(np.hstack([[[1.0], [1.0]], mesh.p]), mesh.t + 1), "mesh")
    thin = MeshTri(np.array([[0, 0], [1, 0], [0.5, 5e-5]]).T, np.array([[0, 1, 2]]).T)
    with pytest.raises(CaseError, match="1 cells are flatter than 1 : 10,000"):
        refuse_unsound(thin, "mesh")


def test_meshes_given_in_python_pass_the_same_check() -> None:
    mesh = name_faces(name_regions(joined(square(), square(0.04)), {}), ("y", "z"))
    law = {BACKGROUND: Isotropic(youngs_modulus=1e4, poissons_ratio=0.4)}
    supports = {"walls": Support(faces=("z_max",))}
    model = TissueModel(mesh, element_row("P1"), law, supports, ("y", "z"))
    with pytest.raises(CaseError, match="mesh: the mesh has 2 parts that are not joined"):
        preflight(model)
