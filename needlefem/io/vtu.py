"""Fields on a tissue's mesh as VTU files, and a PVD file that puts them in order of time."""

import os
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from needlefem._arrays import Floats, Ints
from needlefem.elements import ElementType
from needlefem.fem.function_space import FunctionSpace
from needlefem.io.files import whole_file

EDGES = {
    "triangle": ((0, 1), (1, 2), (2, 0)),
    "quadrilateral": ((0, 1), (1, 2), (2, 3), (3, 0)),
    "tetrahedron": ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)),
}
"""Corners of the edges of a cell, in VTK's order."""
ORDER = {
    "triangle": (0, 1, 2),
    "quadrilateral": (0, 1, 2, 3),
    "tetrahedron": (0, 1, 2, 3),
    "hexahedron": (7, 4, 1, 5, 6, 2, 0, 3),
}
"""scikit-fem's corners in VTK's order."""
TURNED = {
    "triangle": (0, 2, 1),
    "quadrilateral": (0, 3, 2, 1),
    "tetrahedron": (0, 2, 1, 3),
    "hexahedron": (4, 5, 6, 7, 0, 1, 2, 3),
}
"""VTK's corners of a cell that scikit-fem has the other way round."""
BESIDE = {
    "triangle": (1, 2), "quadrilateral": (1, 3), "tetrahedron": (1, 2, 3), "hexahedron": (1, 3, 4),
}  # fmt: skip
"""VTK's corners next to the first, right-handed."""
NAMES = {
    ("triangle", 3): "triangle", ("triangle", 6): "triangle6",
    ("quadrilateral", 4): "quad", ("quadrilateral", 9): "quad9",
    ("tetrahedron", 4): "tetra", ("tetrahedron", 10): "tetra10",
    ("hexahedron", 8): "hexahedron",
}  # fmt: skip
"""meshio's names by shape and number of nodes."""
NONE: Mapping[str, Any] = {}


def write_vtu(
    path: Path, space: FunctionSpace, fields: Mapping[str, Floats], cells: Mapping[str, Any] = NONE
) -> None:
    """Write fields on the undeformed mesh: of nodes, shape (nnodes,) or (nnodes, dim), of cells.

    Cells have curved edges where the element's nodes are those of a VTK cell. Vectors get a
    third component, as ParaView and PyVista need. Values are in SI units.
    """
    import meshio  # noqa: PLC0415  (only a file needs it)

    kind, nodes = _cells(space)
    used, numbers = np.unique(nodes, return_inverse=True)
    data = {name: _in_space(values[used]) for name, values in fields.items()}
    of_cells = {name: [_in_space(values)] for name, values in cells.items()}
    blocks = [(kind, numbers.reshape(nodes.shape))]
    mesh = meshio.Mesh(_in_space(space.nodes[used]), blocks, data, of_cells)
    with whole_file(path) as part:
        meshio.write(part, mesh, file_format="vtu")


def _cells(space: FunctionSpace) -> tuple[str, Ints]:
    """Return the kind of VTK cell and its nodes, shape (ncells, n), turned as VTK wants."""
    shape, mesh = space.element.cell, space.mesh
    order = ORDER[shape]
    name, local = _local(space.element, order)
    cells = space.cell_nodes[:, local]
    corners = np.moveaxis(mesh.p[:, mesh.t[list(order)]], 0, 2).swapaxes(0, 1)
    across = corners[:, list(BESIDE[shape])] - corners[:, :1]
    turned = np.linalg.det(across) < 0.0
    other = _local(space.element, [order[k] for k in TURNED[shape]])[1]
    cells[turned] = space.cell_nodes[turned][:, other]
    return name, cells


def _local(element: ElementType, order: Sequence[int]) -> tuple[str, Ints]:
    """Return the kind of VTK cell, and the element's nodes that it has, for corners in an order."""
    own, shape = np.asarray(element.nodes), element.cell
    corners = np.asarray(element.make().refdom.p, dtype=float).T[list(order)]
    middles = [corners[list(edge)].mean(axis=0) for edge in EDGES.get(shape, ())]
    if shape == "quadrilateral":
        middles.append(corners.mean(axis=0))
    curved = np.array([*corners, *middles])
    places = curved if len(own) == len(curved) else corners
    apart = np.abs(places[:, None] - own[None]).max(axis=2)
    return NAMES[shape, len(places)], np.argmin(apart, axis=1)


def _in_space(values: Floats) -> Floats:
    """Return vectors of the plane with a third component of zero; scalars as they are."""
    if values.ndim == 2 and values.shape[1] == 2:
        return np.column_stack([values, np.zeros(len(values))])
    return values


def write_pvd(path: Path, snapshots: Sequence[tuple[float, Path]]) -> None:
    """Write the collection of VTU files by time, s; their names are relative to it."""
    root = ET.Element("VTKFile", type="Collection", version="0.1", byte_order="LittleEndian")
    collection = ET.SubElement(root, "Collection")
    for time, file in snapshots:
        name = Path(os.path.relpath(file, path.parent)).as_posix()
        ET.SubElement(collection, "DataSet", timestep=f"{time:.9g}", part="0", file=name)
    with whole_file(path) as part:
        ET.ElementTree(root).write(part, encoding="utf-8", xml_declaration=True)
