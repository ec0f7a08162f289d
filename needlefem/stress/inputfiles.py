"""Files of random cases: TOML, contours, meshes by meshio, MSH 4.1 in the style of Gmsh."""

import contextlib
import dataclasses
import io
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from needlefem._arrays import Ints, Points
from needlefem.errors import SimulationError
from needlefem.stress.drawncase import (
    MESH_UNIT,
    CaseTables,
    DrawnCase,
    DrawnMesh,
    DrawnQuantity,
    draw_grid,
    grid_of_file,
    toml_lines,
)

SHAPES = {2: "line", 3: "triangle", 4: "quad"}
GMSH_TYPES = {2: 1, 3: 2, 4: 3}
"""Cell type numbers of Gmsh by number of vertices."""


def write_drawn_case(case: DrawnCase, folder: Path, comment: str = "") -> Path:
    """Write the case file, its contours and its mesh into a folder; return the case's path."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, points in case.contours.items():
        rows = [f"{x!r}, {y!r}" for x, y in points.tolist()]
        (folder / name).write_text("\n".join(["y [m], z [m]", *rows]) + "\n", encoding="utf-8")
    section = case.data.get("mesh")
    if case.mesh is not None and isinstance(section, Mapping):
        write_drawn_mesh(case.mesh, folder / str(section["file"]))
    path = folder / "case.toml"
    head = [f"# {comment}"] if comment else []
    path.write_text("\n".join([*head, *toml_lines(case.data)]) + "\n", encoding="utf-8")
    return path


def write_drawn_mesh(mesh: DrawnMesh, path: Path) -> None:
    """Write a mesh in its format, with physical groups if the format has them."""
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
    """Return dimension and number of each physical group; all numbers are different."""
    areas = ("tissue", *mesh.region_names)
    found = {name: (2, number) for number, name in enumerate(areas, start=1)}
    first = len(areas) + 1
    return found | {name: (1, number) for number, name in enumerate(mesh.faces, start=first)}


def _gmsh41(mesh: DrawnMesh, points: Points) -> Iterator[str]:
    """Yield the lines of an ASCII file with one curve or surface per physical group."""
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


# Small valid input files, which get defects afterwards; commands on them take little time.


MESH_FILES = {
    "mesh.msh": "gmsh22",
    "binary.msh": "gmsh22-binary",
    "mesh41.msh": "gmsh41",
    "mesh.vtk": "vtk42",
    "mesh.vtu": "vtu",
    "mesh.inp": "abaqus",
    "mesh.bdf": "nastran",
    "mesh.off": "off",
    "mesh.ply": "ply",
    "mesh.mesh": "medit",
}
"""Mesh files that can be written without further packages, with their formats."""
LABEL_MAPS = ("labels.nrrd", "labels.nii", "labels.nii.gz", "labels.mha", "labels.seg.nrrd")
KINDS = {"case": 0.4, "contour": 0.14, "mesh": 0.18, "label map": 0.12, "result": 0.16}
"""Kinds of input, with the share of each."""


@dataclasses.dataclass(frozen=True)
class Sound:
    """A valid input.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    damaged : str
        Name of the file in the folder that gets the defects.
    commands : tuple of tuple of str
        Arguments of the commands that read it; ``{out}`` stands for the output folder.
    """

    kind: str
    damaged: str
    commands: "Commands"


def length(value: float) -> DrawnQuantity:
    """Return a length, m."""
    return DrawnQuantity(value, "length")


def case_data() -> CaseTables:
    """Return the tree of a small case that uses most keys."""
    return {
        "schema_version": 2,
        "title": "small",
        "axes": ["y", "z"],
        "mesh": {"size": [length(0.04), length(0.04)], "divisions": [6, 6]},
        "tissue": {"default_material": "fat", "plane": "strain"},
        "materials": {
            "fat": {
                "youngs_modulus": DrawnQuantity(2e4, "pressure"),
                "poissons_ratio": 0.4,
                "density": DrawnQuantity(1e3, "density"),
            },
            "organ": {"law": "isotropic", "youngs_modulus": DrawnQuantity(4e4, "pressure"),
                      "poissons_ratio": 0.4},
        },
        "regions": {
            "organ": {"contour": "organ.csv", "material": "organ",
                      "cutting_force": DrawnQuantity(30.0, "force per length"),
                      "shaft_friction": DrawnQuantity(400.0, "pressure")},
        },
        "supports": {"walls": {"faces": ["y_min", "y_max", "z_max"]}},
        "obstacles": {"bone": {"contour": "bone.csv", "clearance": length(1e-3)}},
        "discretization": {"element": "P1", "path_spacing": length(5e-3), "integrator": "auto"},
        "needle": {"tip_radius": length(4e-3),
                   "cutting_force": DrawnQuantity(25.0, "force per length"),
                   "shaft_friction": DrawnQuantity(300.0, "pressure"),
                   "lateral_penalty": DrawnQuantity(1e8, "force per volume")},
        "motion": {"direction": [0.1, 1.0], "entry": [length(0.018), length(0.0)],
                   "max_depth": length(0.024), "speed": DrawnQuantity(5e-3, "speed"),
                   "stages": [{"depth": length(0.022)},
                              {"dwell": DrawnQuantity(1.0, "time"), "release": "seed"},
                              {"depth": length(0.01)}]},
        "target": {"point": [length(0.02), length(0.015)]},
        "planning": {"offset_range": [length(-3e-3), length(3e-3)], "tolerance": length(1e-6),
                     "max_insertions": 20, "directions": [[0.0, 1.0]]},
        "targets": {"region": "organ", "count": 3, "seed": 1},
        "outputs": {"folder": "out", "pictures": ["stages"]},
        "expect": [{"key": "run.seeds.0.placement_error", "value": "5 cm", "kind": "required"}],
    }  # fmt: skip


def _circle(centre: tuple[float, float], radius: float, count: int) -> Points:
    turn = 2.0 * np.pi * np.arange(count) / count
    return np.array(centre) + radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)


CONTOURS = {
    "organ.csv": _circle((0.02, 0.018), 0.009, 16),
    "bone.csv": _circle((0.034, 0.02), 0.003, 8),
}


def write_case(folder: Path, data: CaseTables | None = None) -> None:
    """Write the small case and its contours."""
    case = DrawnCase(
        data=data or case_data(), contours=CONTOURS, mesh=None, kinds={}, command="run"
    )
    write_drawn_case(case, folder)


def write_mesh_case(folder: Path, name: str) -> None:
    """Write the small case on a mesh from a file of a name of `MESH_FILES`."""
    random = np.random.default_rng(len(name))
    grid = dataclasses.replace(
        draw_grid(random, "file"), width=0.04, height=0.04, divisions=(6, 6), pattern="diagonal"
    )
    groups = {"organ": CONTOURS["organ.csv"]}
    mesh = grid_of_file(random, grid, groups, MESH_FILES[name], lambda points: points)
    grouped = MESH_FILES[name].startswith("gmsh")
    data = case_data()
    data["mesh"] = {"file": name, "unit": length(MESH_UNIT)}
    data["supports"] = {"walls": {"faces": ["left", "right", "far"]}}
    if grouped:
        data["regions"]["organ"] = {"group": "organ", "material": "organ"}
    else:
        data["supports"] = {"walls": {"regions": ["base"]}}
        data["regions"]["base"] = {"contour": "base.csv", "material": "organ"}
        (folder / "base.csv").write_text(
            "y [cm], z [cm]\n0, 3.3\n4, 3.3\n4, 4\n0, 4\n", encoding="utf-8"
        )
    write_case(folder, data)
    write_drawn_mesh(mesh, folder / name)


def write_label_map(folder: Path, name: str) -> None:
    """Write a label map of two structures."""
    from importlib import import_module  # noqa: PLC0415  (SimpleITK need not be there)

    sitk = import_module("SimpleITK")
    k, j, i = np.indices((8, 20, 16))
    labels = ((i - 8) ** 2 + (j - 10) ** 2 + (k - 4) ** 2 < 16).astype(np.uint8)
    labels[(i - 8) ** 2 + (j - 10) ** 2 < 2] = 2
    image = sitk.GetImageFromArray(labels)
    image.SetSpacing((1.5, 1.5, 3.0))
    image.SetOrigin((-10.0, 5.0, 2.0))
    if name.endswith(".seg.nrrd"):
        for number, title in enumerate(("organ", "lesion")):
            image.SetMetaData(f"Segment{number}_Name", title)
            image.SetMetaData(f"Segment{number}_LabelValue", str(number + 1))
            image.SetMetaData(f"Segment{number}_Layer", "0")
    sitk.WriteImage(image, str(folder / name), name.endswith("gz"))


def has_label_maps() -> bool:
    """Return whether label maps can be written and read in this environment."""
    return find_spec("SimpleITK") is not None


NEW_LINE = ("--target", "2, 1.5 cm", "--direction", "0, 1")
Commands = tuple[tuple[str, ...], ...]
CASE_COMMANDS: Commands = (
    ("run", "case.toml", "--no-pictures", "--out", "{out}"),
    ("run", "case.toml", "--json"),
    ("run", "case.toml", "--no-pictures", "--snapshots", "2", "--out", "{out}"),
    ("plan", "case.toml", "--no-pictures", "--out", "{out}"),
    ("plan", "case.toml", "--json"),
    ("modes", "case.toml", "--no-pictures", "--out", "{out}", "--count", "2"),
)
PICTURE_COMMANDS: Commands = (
    ("render", "case.toml", "--setup", "--size", "200x150", "--out", "{out}/setup.png"),
    ("render", "case.toml", "--size", "200x150", "--out", "{out}/picture.png"),
)


def sound_input(random: np.random.Generator, kind: str, folder: Path, results: Path) -> Sound:
    """Write a valid input of a given kind into a folder.

    Parameters
    ----------
    random : Generator
    kind : str
        One of `KINDS`.
    folder : Path
    results : Path
        Folder with the results ``run`` and ``plan`` of the small case, which are copied.
    """
    if kind == "mesh":
        name = str(random.choice(list(MESH_FILES)))
        write_mesh_case(folder, name)
        new: tuple[str, ...] = ("new", "{out}/new", "--mesh", name, "--unit", "1 mm", *NEW_LINE)
        return Sound(kind, name, (*CASE_COMMANDS, new, new))
    if kind == "label map":
        name = str(random.choice(LABEL_MAPS))
        write_label_map(folder, name)
        line = ("--target", "2, 20, 14 mm", "--direction", "0, 1, 0.1")
        return Sound(kind, name, (("new", "{out}/new", "--labelmap", name, *line),))
    write_case(folder)
    if kind == "contour":
        new = ("new", "{out}/new", "--contour", "organ.csv", "bone.csv", *NEW_LINE)
        damaged = str(random.choice(list(CONTOURS)))
        return Sound(kind, damaged, (*CASE_COMMANDS, new, new, new))
    if kind == "result":
        which = str(random.choice(["run", "plan"]))
        names = copy_result(results / which, folder / "result")
        reads = (("load_result", "result"),) * 3
        draws = (("render", "result", "--size", "200x150", "--out", "{out}/picture.png"),)
        return Sound(kind, f"result/{random.choice(names)}", (*reads, *draws))
    return Sound(kind, "case.toml", CASE_COMMANDS * 4 + PICTURE_COMMANDS)


def copy_result(source: Path, folder: Path) -> list[str]:
    """Copy a result's files; return their names."""
    folder.mkdir(parents=True)
    names = sorted(path.name for path in source.iterdir() if path.is_file())
    for name in names:
        (folder / name).write_bytes((source / name).read_bytes())
    return names


CommandLine = Callable[[Sequence[str]], int]
"""The command line as a function of its arguments."""


def make_results(folder: Path, command_line: CommandLine) -> None:
    """Simulate and plan the small case; write the folders ``run`` and ``plan``.

    What differs from time to time is taken out, so that a seed always damages the same bytes.
    """
    write_case(folder)
    case = str(folder / "case.toml")
    for name, more in (("run", ["--snapshots", "2"]), ("plan", [])):
        arguments = [name, case, "--no-pictures", "--out", str(folder / name), *more]
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            status = command_line(arguments)
        if status != 0:
            problem = f"the sound case ends with status {status} in '{' '.join(arguments)}'"
            raise SimulationError(problem)
        file = folder / name / f"{name}.json"
        record = json.loads(file.read_text(encoding="utf-8"))
        record |= {"source": "case.toml", "timings": dict.fromkeys(record["timings"], 0.0)}
        file.write_text(json.dumps(record, indent=2) + "\n", encoding="utf-8")
