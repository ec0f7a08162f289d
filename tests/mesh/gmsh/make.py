"""Write the mesh files of this folder with Gmsh (``pip install gmsh``); made with 4.15.2.

A square of 60 mm with a round organ, on coarse meshes; what each file is about is its name.
"""

from pathlib import Path

import gmsh

HERE = Path(__file__).parent
VERSIONS = {"22": 2.2, "40": 4.0, "41": 4.1}


def square(size: float = 12.0) -> tuple[int, int]:
    """Return the surfaces of organ and surroundings; the outer curves are numbered as Gmsh does."""
    gmsh.clear()
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    kernel = gmsh.model.occ
    outer = kernel.addRectangle(0, 0, 0, 60, 60)
    disc = kernel.addDisk(33, 30, 0, 12, 12)
    kernel.fragment([(2, outer)], [(2, disc)])
    kernel.synchronize()
    areas = {tag: kernel.getMass(2, tag) for _, tag in gmsh.model.getEntities(2)}
    organ, rest = sorted(areas, key=lambda tag: areas[tag])
    return organ, rest


def edges(side: str) -> list[int]:
    """Return the curves on a side of the square."""
    boxes = {"floor": (-1, 59, 61, 61), "left": (-1, -1, 1, 61), "right": (59, -1, 61, 61)}
    x0, y0, x1, y1 = boxes[side]
    return [tag for _, tag in gmsh.model.getEntitiesInBoundingBox(x0, y0, -1, x1, y1, 1, 1)]


def name(organ: int, rest: int) -> None:
    """Name cells and edges."""
    gmsh.model.addPhysicalGroup(2, [organ], name="organ")
    gmsh.model.addPhysicalGroup(2, [rest], name="fat")
    gmsh.model.addPhysicalGroup(1, edges("floor"), name="floor")
    gmsh.model.addPhysicalGroup(1, edges("left") + edges("right"), name="sides")


def write(
    file: str, version: str = "41", *, binary: bool = False, everything: bool = False
) -> None:
    """Write the mesh in a version of Gmsh's format."""
    gmsh.option.setNumber("Mesh.MshFileVersion", VERSIONS[version])
    gmsh.option.setNumber("Mesh.Binary", binary)
    gmsh.option.setNumber("Mesh.SaveAll", everything)
    gmsh.write(str(HERE / file))


def versions() -> None:
    """Every version, text and binary, saved whole and by groups."""
    name(*square())
    gmsh.model.mesh.generate(2)
    for version in VERSIONS:
        for kind, binary in (("text", False), ("binary", True)):
            if binary and version == "40":  # Gmsh does not write it
                continue
            write(f"{kind}{version}.msh", version, binary=binary)
            if version != "22":
                write(f"{kind}{version}all.msh", version, binary=binary, everything=True)


def cells() -> None:
    """Quadrilaterals, a mixture, curved cells."""
    for file, order, recombine in (
        ("quads", 1, True), ("curved-triangles", 2, False), ("curved-quads", 2, True),
        ("cubic-triangles", 3, False),
    ):  # fmt: skip
        organ, rest = square()
        name(organ, rest)
        if recombine:
            gmsh.option.setNumber("Mesh.RecombinationAlgorithm", 2)  # quadrilaterals alone
            for surface in (organ, rest):
                gmsh.model.mesh.setRecombine(2, surface)
        gmsh.model.mesh.generate(2)
        gmsh.model.mesh.setOrder(order)
        write(f"{file}.msh")
    organ, rest = square()
    name(organ, rest)
    gmsh.model.mesh.setRecombine(2, organ)
    gmsh.option.setNumber("Mesh.RecombinationAlgorithm", 0)
    gmsh.model.mesh.generate(2)
    write("mixed.msh")
    write("mixed22.msh", "22", binary=True)


def groups() -> None:
    """Groups that overlap, without names, of points, and no group at all."""
    for version in VERSIONS:
        organ, rest = square()
        gmsh.model.addPhysicalGroup(2, [organ, rest], name="body")
        gmsh.model.addPhysicalGroup(2, [organ], name="organ")
        gmsh.model.addPhysicalGroup(1, edges("floor"), name="floor")
        gmsh.model.addPhysicalGroup(1, edges("floor") + edges("left"), name="held")
        gmsh.model.mesh.generate(2)
        write(f"overlapping{version}.msh", version)
        organ, rest = square()
        gmsh.model.addPhysicalGroup(2, [organ], 7)
        gmsh.model.addPhysicalGroup(2, [rest], name="fat")
        gmsh.model.addPhysicalGroup(1, edges("floor"), 9)
        gmsh.model.addPhysicalGroup(0, [1], name="pin")
        gmsh.model.mesh.generate(2)
        write(f"unnamed{version}.msh", version)
    square()
    gmsh.model.mesh.generate(2)
    write("no-groups.msh")


def places() -> None:
    """A partitioned mesh, whole and in parts; other planes; no plane; volumes."""
    name(*square())
    gmsh.model.mesh.generate(2)
    gmsh.model.mesh.partition(3)
    write("partitioned.msh")
    write("partitioned22.msh", "22")
    gmsh.option.setNumber("Mesh.PartitionSplitMeshFiles", 1)
    write("part.msh")
    gmsh.option.setNumber("Mesh.PartitionSplitMeshFiles", 0)
    for number in (0, 2, 3):
        (HERE / f"part_{number}.msh").unlink(missing_ok=True)
    (HERE / "part.msh").unlink(missing_ok=True)
    for file, angle, axis, lift in (
        ("xz-plane", 90, (1, 0, 0), 0), ("yz-plane", 90, (0, 1, 0), 0), ("lifted", 0, (1, 0, 0), 5),
        ("tilted", 30, (1, 0, 0), 0),
    ):  # fmt: skip
        name(*square())
        gmsh.model.mesh.generate(2)
        if angle:
            gmsh.model.mesh.affineTransform(_turn(angle, axis))
        else:
            gmsh.model.mesh.affineTransform([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, lift])
        write(f"{file}.msh")
    gmsh.clear()
    gmsh.option.setNumber("Mesh.MeshSizeMax", 6)
    gmsh.model.occ.addSphere(0, 0, 0, 6)
    gmsh.model.occ.synchronize()
    gmsh.model.mesh.generate(2)
    write("sphere.msh")
    gmsh.model.mesh.generate(3)
    gmsh.model.addPhysicalGroup(3, [1], name="ball")
    write("volume.msh")
    gmsh.clear()
    gmsh.model.occ.addRectangle(0, 0, 0, 60, 60)
    gmsh.model.occ.synchronize()
    gmsh.model.mesh.generate(1)
    write("lines.msh")


def _turn(angle: int, axis: tuple[int, int, int]) -> list[float]:
    c, s = {90: (0.0, 1.0), 30: (3**0.5 / 2, 0.5)}[angle]
    if axis == (1, 0, 0):
        return [1, 0, 0, 0, 0, c, -s, 0, 0, s, c, 0]
    return [c, 0, s, 0, 0, 1, 0, 0, -s, 0, c, 0]


if __name__ == "__main__":
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    versions()
    cells()
    groups()
    places()
    gmsh.finalize()
