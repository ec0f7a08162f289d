"""Meshes from files: Gmsh's by `mshfile`, all others through meshio by `foreignmesh`."""

import dataclasses
import warnings
from functools import lru_cache
from pathlib import Path

from needlefem._arrays import SkfemMesh
from needlefem._inputfile import require_file
from needlefem.errors import CaseError
from needlefem.mesh.file_contents import PlaneMesh, UnreadableMeshError, plane_mesh
from needlefem.mesh.soundness import refuse_unsound

KEY = "mesh.file"


def read_mesh(path: Path, unit: float) -> SkfemMesh:
    """Read a plane mesh of triangles or quadrilaterals with its named groups.

    Parameters
    ----------
    path : Path
        Gmsh's .msh, or any format of meshio's; docs/how-to/own-mesh.md says what their groups are.
    unit : float, m
        Length of one unit of the file's coordinates.

    Returns
    -------
    skfem.Mesh
        Subdomains and boundaries are the file's groups; cells in no group are in no subdomain.

    Raises
    ------
    CaseError
        The file can't be read, or it is not one plane body of cells that can be used.

    Warns
    -----
    UserWarning
        What was changed, such as curved edges that are read as straight.
    """
    found = read_plane_mesh(path, unit)
    if found.repairs:
        warnings.warn(f"{path.name}: {' '.join(found.repairs)}", stacklevel=1)
    return found.mesh


def read_plane_mesh(path: Path, unit: float, key: str = KEY) -> PlaneMesh:
    """Read a mesh file, and say how it was read; see `read_mesh`.

    The last file is kept: a case reads its mesh for the outlines of regions and for the model.
    """
    require_file(path, key, remedy="give a mesh file, such as Gmsh's .msh")
    try:
        status = path.stat()
        found = _read(path, status.st_mtime_ns, status.st_size)
        mesh = found.mesh
        mesh = dataclasses.replace(mesh, doflocs=unit * mesh.doflocs)
    except OSError as error:
        problem = f"can't read '{path}' ({error.strerror or error})"
        raise CaseError(key, problem, "give a mesh file, such as Gmsh's .msh") from None
    except UnreadableMeshError as error:
        raise CaseError(key, f"can't use '{path}': {error.problem}", error.remedy) from None
    refuse_unsound(mesh, key)
    return dataclasses.replace(found, mesh=mesh)


@lru_cache(maxsize=1)
def _read(path: Path, _changed: int, _size: int) -> PlaneMesh:
    """Return the mesh in units of the file; the last arguments tell one version from another."""
    # readers of formats are imported where a mesh is read, which scenes of a box never are
    from needlefem.mesh.gmsh_format import is_msh, read_msh  # noqa: PLC0415

    with path.open("rb") as file:
        start = file.read(4096)
        if is_msh(start):
            return plane_mesh(read_msh(start + file.read()), 1.0)
    if path.suffix.lower() == ".msh" and not start.lstrip().startswith(b"("):  # as Fluent's do
        problem = "it is empty" if not start.strip() else "it does not begin as Gmsh's files do"
        raise UnreadableMeshError(problem, "save it as Gmsh's version 4.1 or 2.2")
    from needlefem.mesh.foreign_formats import read_foreign  # noqa: PLC0415

    return plane_mesh(read_foreign(path), 1.0)
