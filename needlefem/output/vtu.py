"""Fields on a tissue's mesh as VTU files, and a PVD file that puts them in order of time."""

import os
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from needlefem.arrays import Floats, Ints
from needlefem.fem.space import Space
from needlefem.output.files import whole_file

CORNERS = {
    "triangle": ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0)),
    "quadrilateral": ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)),
}
"""Reference corners by shape of the cell, in VTK's order."""
NAMES = {
    ("triangle", 3): "triangle", ("triangle", 6): "triangle6",
    ("quadrilateral", 4): "quad", ("quadrilateral", 9): "quad9",
}  # fmt: skip
"""meshio's names by shape and number of nodes."""


def write_vtu(path: Path, space: Space, fields: Mapping[str, Floats]) -> None:
    """Write nodal fields, shape (nnodes,) or (nnodes, dim), on the undeformed mesh.

    Cells have curved edges where the element's nodes are those of a VTK cell. Vectors get a
    third component, as ParaView and PyVista need.
    """
    import meshio  # noqa: PLC0415  (only a file needs it)

    kind, cells = _cells(space)
    used, numbers = np.unique(cells, return_inverse=True)
    data = {name: _in_space(values[used]) for name, values in fields.items()}
    mesh = meshio.Mesh(_in_space(space.nodes[used]), [(kind, numbers.reshape(cells.shape))], data)
    with whole_file(path) as part:
        meshio.write(part, mesh, file_format="vtu")


def _cells(space: Space) -> tuple[str, Ints]:
    """Return the kind of VTK cell and its nodes, shape (ncells, n)."""
    shape = space.element.cell
    corners = np.array(CORNERS[shape])
    middles = 0.5 * (corners + np.roll(corners, -1, axis=0))
    centre = corners.mean(axis=0, keepdims=True)
    wanted = [corners, np.vstack([corners, middles])]
    if shape == "quadrilateral":
        wanted[1] = np.vstack([wanted[1], centre])
    own = np.asarray(space.element.nodes)
    places = wanted[1] if len(own) == len(wanted[1]) else wanted[0]
    apart = np.abs(places[:, None] - own[None]).max(axis=2)
    return NAMES[shape, len(places)], space.cell_nodes[:, np.argmin(apart, axis=1)]


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
