"""Mesh files of other programs, read by meshio in a separate process.

A damaged file can cause any exception in a reader, or output, an endless loop, or a request for all
memory. The output of the reader is therefore captured, its memory and time are limited, and each
failure becomes one `UnreadableMeshError`.
"""

import contextlib
import io
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypedDict

import numpy as np

from needlefem._arrays import Floats, Ints
from needlefem.mesh.file import CellBlock, Contents, UnreadableMeshError, printable

if TYPE_CHECKING:
    import meshio

SECONDS = 30.0
SECONDS_PER_BYTE = 2e-5
"""Time limit of a reader: text is read more than ten times faster."""
MEMORY = 2**31
MEMORY_PER_BYTE = 100
"""Memory limit of a reader, bytes."""
REFERENCES = {
    "medit:ref": "references",
    "nastran:ref": "property numbers",
    "avsucd:material": "material numbers",
    "su2:tag": "markers",
    "ugrid:ref": "references",
    "netgen:index": "region numbers",
}
"""Cell data that contain the numbers of parts in the documentation of a format; 0 is no part."""
PACKAGES = {"netCDF4": "netCDF4", "h5py": "h5py", "lxml": "lxml"}
"""Modules that some readers of meshio need, and their packages."""
OWN_GROUPS = ("skfem:s:", "skfem:b:")
"""Beginnings of the names of cell data in which scikit-fem stores subdomains and boundaries."""
REMEDY = "give a complete mesh file, such as Gmsh's .msh of version 4.1"


class _Shape(NamedTuple):
    """A cell of meshio's."""

    dim: int
    corners: int
    order: int


SHAPES = {
    "vertex": _Shape(0, 1, 1),
    "line": _Shape(1, 2, 1), "line3": _Shape(1, 2, 2), "line4": _Shape(1, 2, 3),
    "triangle": _Shape(2, 3, 1), "triangle6": _Shape(2, 3, 2), "triangle7": _Shape(2, 3, 2),
    "triangle10": _Shape(2, 3, 3), "quad": _Shape(2, 4, 1), "quad8": _Shape(2, 4, 2),
    "quad9": _Shape(2, 4, 2), "quad16": _Shape(2, 4, 3),
}  # fmt: skip
VOLUMES = ("tetra", "hexahedron", "wedge", "pyramid", "polyhedron", "VTK_LAGRANGE_T")


class _Told(TypedDict, total=False):
    """Contents of a file without its arrays, or the reason why it can't be read.

    Attributes
    ----------
    problem, remedy : str
        Present only if the file can't be read.
    types : list of str
        Kind of the cells of each block.
    reference : str
        Name of the array with group numbers of cells; empty without such an array.
    own : list of str
        Names of the arrays in which scikit-fem stores groups.
    families : mapping
        Names of groups by family number, as Salome stores them.
    names : list of (str, int, int)
        Name, number and dimension of each named group.
    cell_sets, point_sets : list of str
        Names of sets of cells and of nodes.
    """

    problem: str
    remedy: str
    types: list[str]
    reference: str
    own: list[str]
    families: dict[str, list[str]]
    names: list[tuple[str, int, int]]
    cell_sets: list[str]
    point_sets: list[str]


def read_foreign(path: Path) -> Contents:
    """Read a mesh file in any format of meshio.

    Raises
    ------
    UnreadableMeshError
        The reader failed for any reason.
    """
    size = path.stat().st_size
    limit = SECONDS + SECONDS_PER_BYTE * size
    code = (
        "import json, sys; sys.path[:] = json.loads(sys.argv[1]);"
        "from needlefem.mesh.foreign_formats import serve; serve(sys.argv[2], int(sys.argv[3]))"
    )
    memory = str(MEMORY + MEMORY_PER_BYTE * size)
    command = [sys.executable, "-P", "-c", code, json.dumps(sys.path), str(path), memory]
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    try:
        ended = subprocess.run(
            command, capture_output=True, env=environment, timeout=limit, check=False
        )
    except subprocess.TimeoutExpired:
        problem = f"its reader has not ended after {limit:.0f} s"
        raise UnreadableMeshError(problem, REMEDY) from None
    try:
        with np.load(io.BytesIO(ended.stdout), allow_pickle=False) as loaded:
            arrays = dict(loaded)
    except (ValueError, OSError, EOFError):  # no or incomplete output: the reader crashed
        problem = f"its reader ended with status {ended.returncode}"
        raise UnreadableMeshError(problem, REMEDY) from None
    told: _Told = json.loads(str(arrays["told"]))
    if "problem" in told:
        raise UnreadableMeshError(told["problem"], told["remedy"])
    return _contents(told, arrays)


def serve(path: str, memory: int) -> None:
    """Read a file with meshio and write its contents, or the reason of a failure, as npz file."""
    out = os.fdopen(os.dup(1), "wb")
    silent = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silent, 1)  # C libraries print there as well
    try:
        import resource  # noqa: PLC0415  (not on Windows)

        resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    except (ImportError, OSError, ValueError):
        pass
    printed = io.StringIO()
    arrays: dict[str, np.ndarray] = {}
    told: _Told = {}
    try:
        with contextlib.redirect_stdout(printed):
            _read(path, told, arrays)
    except ImportError as error:
        package = PACKAGES.get(str(error.name).partition(".")[0], str(error.name))
        arrays = {}
        told = {
            "problem": f"files of this kind need the package '{package}'",
            "remedy": f"pip install {package}, or give Gmsh's .msh",
        }
    except MemoryError:
        arrays, told = {}, {"problem": "its counts exceed the size of the file"}
    except SystemExit:  # meshio exits if no reader accepts the file
        said = [line for line in printed.getvalue().splitlines() if line.strip()]
        arrays, told = {}, {"problem": _short(said[-1]) if said else "no reader accepts it"}
    except Exception as error:  # any failure is reported to the caller
        text = _short(f"its reader raised {type(error).__name__}: {error}".rstrip(": "))
        arrays, told = {}, {"problem": text}
    if "problem" in told:
        told.setdefault("remedy", REMEDY)
    content: dict[str, Any] = {"told": np.array(json.dumps(told)), **arrays}
    np.savez(out, **content)  # untyped: mypy would compare the arrays with `allow_pickle: bool`
    out.close()


def _short(text: str) -> str:
    text = " ".join(text.split())
    return text if len(text) <= 160 else text[:157] + "..."


def _read(path: str, told: _Told, arrays: dict[str, np.ndarray]) -> None:
    """Fill `told` and `arrays` with the contents of the file; see `_contents` for their keys."""
    import meshio  # noqa: PLC0415

    known = meshio.extension_to_filetypes
    name = Path(path).name.lower()
    if not any(name.endswith(ending) for ending in known):
        problem = f"'{Path(path).suffix}' is not the extension of a mesh file"
        told["problem"] = problem
        told["remedy"] = "give Gmsh's .msh, .vtu, .inp or another of meshio's"
        return
    found = meshio.read(path)
    arrays["points"] = np.asarray(found.points, dtype=float)
    told["types"] = [block.type for block in found.cells]
    references = [name for name in REFERENCES if name in found.cell_data]
    told["reference"] = references[0] if references else ""
    for number, block in enumerate(found.cells):
        if block.type in SHAPES:
            arrays[f"cells{number}"] = np.asarray(block.data, dtype=np.int64)
        for name in references[:1]:
            arrays[f"reference{number}"] = np.asarray(found.cell_data[name][number])
        if "cell_tags" in found.cell_data:
            arrays[f"family{number}"] = np.asarray(found.cell_data["cell_tags"][number])
    _read_scikit_fem(found, told, arrays)
    _read_sets(found, told, arrays)


def _read_scikit_fem(found: "meshio.Mesh", told: _Told, arrays: dict[str, np.ndarray]) -> None:
    own = [name for name in found.cell_data if name.startswith(OWN_GROUPS)]
    told["own"] = [printable(name) for name in own]
    for number, kind in enumerate(told["types"]):
        if kind in ("triangle", "quad"):
            for index, name in enumerate(own):
                arrays[f"own{index},{number}"] = np.asarray(found.cell_data[name][number])


def _read_sets(found: "meshio.Mesh", told: _Told, arrays: dict[str, np.ndarray]) -> None:
    families = getattr(found, "cell_tags", None) or {}
    told["families"] = {str(k): [printable(name) for name in v] for k, v in families.items()}
    told["names"] = [
        (printable(str(name)), int(row[0]), int(row[1]))
        for name, row in found.field_data.items()
        if np.shape(row) == (2,)
    ]
    told["cell_sets"] = [printable(name) for name in found.cell_sets]
    told["point_sets"] = [printable(name) for name in found.point_sets]
    for index, sets in enumerate(found.cell_sets.values()):
        for number, members in enumerate(sets):
            if members is not None:
                arrays[f"set{index},{number}"] = np.asarray(members, dtype=np.int64)
    for index, members in enumerate(found.point_sets.values()):
        arrays[f"nodes{index}"] = np.asarray(members, dtype=np.int64).ravel()


def _contents(told: _Told, arrays: dict[str, np.ndarray]) -> Contents:
    """Return the contents of a file from the result of `_read`."""
    points = _in_space(arrays["points"])
    names = {(tag, dim): name for name, tag, dim in told["names"]}
    blocks: list[CellBlock] = []
    for number, kind in enumerate(told["types"]):
        if kind not in SHAPES:
            dim = 3 if kind.startswith(VOLUMES) else 2
            blocks.append(CellBlock(dim, 0, 1, np.zeros((1, 0), dtype=np.int64)))
            continue
        shape, cells = SHAPES[kind], arrays[f"cells{number}"]
        if cells.size and (cells.min() < 0 or cells.max() >= len(points)):
            lost = int(cells.max()) + 1
            problem = f"a cell has node {lost} of {len(points)}"
            raise UnreadableMeshError(problem, REMEDY)
        if cells.ndim != 2 or cells.shape[1] < shape.corners:
            raise UnreadableMeshError(f"cells of kind '{kind}' have too few nodes", REMEDY)
        called = _names_of(number, shape.dim, len(cells), told, arrays, names=names)
        blocks += _blocks(shape, cells, called)
    point_sets = {}
    for index, name in enumerate(told["point_sets"]):
        members = arrays[f"nodes{index}"]
        if members.size and (members.min() < 0 or members.max() >= len(points)):
            raise UnreadableMeshError(f"node set '{name}' has nodes that do not exist", REMEDY)
        point_sets[name] = members
    notes = []
    facets = _facets_of_scikit_fem(told, arrays)
    if told["reference"] and any(block.groups for block in blocks):
        notes.append(f"Groups are the {REFERENCES[told['reference']]} of the file.")
    return Contents(
        points, np.arange(1, len(points) + 1), tuple(blocks), tuple(notes), point_sets, facets
    )


def _in_space(points: Floats) -> Floats:
    if points.ndim != 2 or points.shape[1] not in (2, 3):
        raise UnreadableMeshError("its nodes have neither two nor three coordinates", REMEDY)
    return np.column_stack([points, np.zeros((len(points), 3 - points.shape[1]))])


def _names_of(
    number: int,
    dim: int,
    count: int,
    told: _Told,
    arrays: dict[str, np.ndarray],
    *,
    names: dict[tuple[int, int], str],
) -> dict[str, Ints]:
    """Return the cells of each group in a block."""
    found: dict[str, list[Ints]] = {}
    tags = arrays.get(f"reference{number}", np.zeros(0))
    tags = tags if tags.shape == (count,) else np.zeros(count)
    for tag in np.unique(tags[np.isfinite(tags) & (tags != 0)]):
        name = names.get((int(tag), dim), f"{tag:g}")
        found.setdefault(name, []).append(np.flatnonzero(tags == tag))
    families = arrays.get(f"family{number}", np.zeros(count))
    called_so = [(int(k), name) for k, names in told["families"].items() for name in names]
    for family, name in called_so:
        found.setdefault(name, []).append(np.flatnonzero(families == family))
    for index, name in enumerate(told["own"]):
        inside = arrays.get(f"own{index},{number}", np.zeros(0))
        if name.startswith("skfem:s:") and inside.shape == (count,):
            called = name.removeprefix("skfem:s:")
            found.setdefault(called, []).append(np.flatnonzero(inside))
    for index, name in enumerate(told["cell_sets"]):
        members = arrays.get(f"set{index},{number}", np.zeros(0, dtype=np.int64))
        if members.size and (members.min() < 0 or members.max() >= count):
            raise UnreadableMeshError(f"set '{name}' has cells that do not exist", REMEDY)
        found.setdefault(name, []).append(members)
    return {name: np.unique(np.concatenate(parts)) for name, parts in found.items()}


def _facets_of_scikit_fem(told: _Told, arrays: dict[str, np.ndarray]) -> dict[str, Ints]:
    """Return groups of edges in the encoding of scikit-fem: one bit of a cell per edge."""
    found: dict[str, list[Ints]] = {}
    for index, name in enumerate(told["own"]):
        kind, _, called = name.removeprefix("skfem:").partition(":")
        for number, shape in enumerate(told["types"]):
            bits = arrays.get(f"own{index},{number}")
            cells = arrays.get(f"cells{number}")
            if kind != "b" or bits is None or cells is None or bits.shape != (len(cells),):
                continue
            corners = SHAPES[shape].corners
            edges = [(k, k + 1) for k in range(corners - 1)] + [(0, corners - 1)]
            for bit, (one, other) in enumerate(edges):
                held = bits.astype(np.int64) >> bit & 1 > 0
                found.setdefault(called, []).append(cells[held][:, [one, other]])
    return {name: np.vstack(parts) for name, parts in found.items()}


def _blocks(shape: _Shape, cells: Ints, called: dict[str, Ints]) -> list[CellBlock]:
    """Return the cells in blocks with the same groups."""
    member = np.zeros((len(cells), len(called)), dtype=bool)
    for column, rows in enumerate(called.values()):
        member[rows, column] = True
    if not called:
        return [CellBlock(shape.dim, shape.corners, shape.order, cells)]
    kinds, owner = np.unique(member, axis=0, return_inverse=True)
    found = []
    for part, kind in enumerate(kinds):
        rows = np.flatnonzero(owner.ravel() == part)
        groups = frozenset(name for name, inside in zip(called, kind, strict=True) if inside)
        found.append(CellBlock(shape.dim, shape.corners, shape.order, cells[rows], groups))
    return found
