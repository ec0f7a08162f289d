"""Meshes from files, through meshio."""

from pathlib import Path

import numpy as np

from needlefem.arrays import SkfemMesh
from needlefem.errors import CaseError
from needlefem.fem.cellmap import refuse_bad_cells
from needlefem.inputfile import require_file

KEY = "mesh.file"
CELLS = {"triangle": "triangle", "quad": "quadrilateral"}
"""meshio's names of the cells that can be used, and ours."""


def read_mesh(path: Path, unit: float) -> SkfemMesh:
    """Read a plane mesh of triangles or quadrilaterals with its named groups.

    Parameters
    ----------
    path : Path
        Any format of meshio's; named groups come with Gmsh's physical groups.
    unit : float, m
        Length of one unit of the file's coordinates.

    Raises
    ------
    CaseError
        The file can't be read, holds other cells, or cells that are flat, concave or crossed.
    """
    require_file(path, KEY, remedy="give a mesh file, such as Gmsh's .msh")
    import meshio  # noqa: PLC0415  (only a mesh from a file needs it)
    from skfem.io.meshio import from_meshio  # noqa: PLC0415

    try:
        found = meshio.read(path)
    except (OSError, meshio.ReadError) as error:
        problem = f"can't read '{path}' ({str(error) or type(error).__name__})"
        raise CaseError(KEY, problem, "give a mesh file, such as Gmsh's .msh") from None
    except SystemExit:  # meshio leaves the process when no reader takes the file
        raise CaseError(KEY, f"'{path}' is in no known format", "give a Gmsh .msh") from None
    kinds = {block.type for block in found.cells}
    areas = sorted(kinds - {"vertex", "line"})
    if len(areas) != 1 or areas[0] not in CELLS:
        has = ", ".join(sorted(kinds)) or "nothing"
        remedy = "save straight-edged triangles or quadrilaterals alone"
        raise CaseError(KEY, f"'{path.name}' holds {has}", remedy)
    found.points = np.ascontiguousarray(found.points[:, :2], dtype=float) * unit
    mesh = from_meshio(found, ignore_interior_facets=True)
    mesh = _without_loose_points(mesh)
    refuse_bad_cells(mesh, KEY)
    return mesh


def _without_loose_points(mesh: SkfemMesh) -> SkfemMesh:
    """Drop points that no cell uses (centres of arcs), which would be dofs without stiffness."""
    used = np.unique(mesh.t)
    if len(used) == mesh.nvertices:
        return mesh
    number = np.full(mesh.nvertices, -1)
    number[used] = np.arange(len(used))
    return type(mesh)(
        np.ascontiguousarray(mesh.p[:, used]),
        number[mesh.t],
        _boundaries=mesh.boundaries,
        _subdomains=mesh.subdomains,
    )
