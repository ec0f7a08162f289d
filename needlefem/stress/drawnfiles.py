"""Drawn cases as files: TOML, contours, meshes through meshio, MSH 4.1 as Gmsh writes it."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from needlefem._arrays import Ints, Points
from needlefem.stress.drawncase import MESH_UNIT, DrawnCase, DrawnMesh, toml_lines

SHAPES = {2: "line", 3: "triangle", 4: "quad"}
GMSH_TYPES = {2: 1, 3: 2, 4: 3}
"""Gmsh's numbers of cells by their corners."""


def write_drawn_case(case: DrawnCase, folder: Path, comment: str = "") -> Path:
    """Write the case file, its contours and its mesh into a folder; return the case's path."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, points in case.contours.items():
        rows = [f"{x!r}, {y!r}" for x, y in points.tolist()]
        (folder / name).write_text("\n".join(["y [m], z [m]", *rows]) + "\n", encoding="utf-8")
    if case.mesh is not None:
        write_drawn_mesh(case.mesh, folder / str(case.data["mesh"]["file"]))
    path = folder / "case.toml"
    head = [f"# {comment}"] if comment else []
    path.write_text("\n".join([*head, *toml_lines(case.data)]) + "\n", encoding="utf-8")
    return path


def write_drawn_mesh(mesh: DrawnMesh, path: Path) -> None:
    """Write a mesh in its format, with physical groups where the format has them."""
    points = np.column_stack([mesh.points / MESH_UNIT, np.zeros(len(mesh.points))])
    if mesh.file_format == "gmsh41":
        path.write_text("\n".join(_gmsh41(mesh, points)) + "\n", encoding="utf-8")
        return
    import meshio  # noqa: PLC0415  (only meshes from files need it)

    blocks: list[tuple[str, Ints]] = [(SHAPES[mesh.cells.shape[1]], mesh.cells.astype(np.int32))]
    kind, _, binary = mesh.file_format.partition("-")
    if kind != "gmsh22":
        meshio.write(path, meshio.Mesh(points, blocks), file_format=kind)
        return
    groups = _groups(mesh)
    physical = [mesh.regions + 1]
    for name, edges in mesh.faces.items():
        blocks.append(("line", edges))
        physical.append(np.full(len(edges), groups[name][1]))
    written = meshio.Mesh(
        points,
        blocks,
        cell_data={"gmsh:physical": physical, "gmsh:geometrical": physical},
        field_data={name: np.array([number, dim]) for name, (dim, number) in groups.items()},
    )
    meshio.write(path, written, file_format=kind, binary=binary == "binary")


def _groups(mesh: DrawnMesh) -> dict[str, tuple[int, int]]:
    """Return dimension and number of every physical group; all numbers differ."""
    areas = ("tissue", *mesh.region_names)
    found = {name: (2, number) for number, name in enumerate(areas, start=1)}
    first = len(areas) + 1
    return found | {name: (1, number) for number, name in enumerate(mesh.faces, start=first)}


def _gmsh41(mesh: DrawnMesh, points: Points) -> Iterator[str]:
    """Yield the lines of an ASCII file: one curve or surface for every physical group."""
    groups = _groups(mesh)
    yield from ("$MeshFormat", "4.1 0 8", "$EndMeshFormat", "$PhysicalNames", str(len(groups)))
    yield from (f'{dim} {number} "{name}"' for name, (dim, number) in groups.items())
    yield from ("$EndPhysicalNames", "$Entities")
    curves, areas = len(mesh.faces), 1 + len(mesh.region_names)
    yield f"0 {curves} {areas} 0"
    low, high = points.min(axis=0).tolist(), points.max(axis=0).tolist()
    box = " ".join(repr(x) for x in (*low, *high))
    for dim in (1, 2):
        for own, number in groups.values():
            if own == dim:
                yield f"{number} {box} 1 {number} 0"
    yield from ("$EndEntities", "$Nodes", f"1 {len(points)} 1 {len(points)}")
    yield f"2 1 0 {len(points)}"
    yield from (str(number) for number in range(1, len(points) + 1))
    yield from (" ".join(repr(x) for x in point) for point in points.tolist())
    yield "$EndNodes"
    blocks = [(groups[name], edges) for name, edges in mesh.faces.items()]
    blocks += [((2, number + 1), mesh.cells[mesh.regions == number]) for number in range(areas)]
    yield from _gmsh41_elements([block for block in blocks if len(block[1])])


def _gmsh41_elements(blocks: list[tuple[tuple[int, int], Ints]]) -> Iterator[str]:
    total = sum(len(cells) for _, cells in blocks)
    yield from ("$Elements", f"{len(blocks)} {total} 1 {total}")
    number = 0
    for (dim, entity), cells in blocks:
        yield f"{dim} {entity} {GMSH_TYPES[cells.shape[1]]} {len(cells)}"
        for corners in (cells + 1).tolist():
            number += 1
            yield " ".join(str(n) for n in (number, *corners))
    yield "$EndElements"
