"""Random cases: constants of laws, meshes, motions, and the tree of the case file."""

import dataclasses
import json
from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple, TypedDict

import numpy as np

from needlefem._arrays import Floats, Ints, Points
from needlefem.errors import CaseError
from needlefem.geometry.contour import Contour
from needlefem.materials import law_class

LEAST_EIGENVALUE = 0.02
"""Smallest eigenvalue of the compliance relative to the largest; far from the stability limit."""


Section = dict[str, object]
"""A table of a case; its values are those of TOML, and `DrawnQuantity`."""
_Constant = float | tuple[float, float]


class CaseTables(TypedDict, total=False):
    """The tables of a case file."""

    schema_version: int
    title: str
    axes: list[str]
    mesh: Section
    tissue: Section
    materials: dict[str, Section]
    regions: dict[str, Section]
    supports: dict[str, Section]
    obstacles: dict[str, Section]
    damping: Section
    discretization: Section
    needle: Section
    motion: Section
    target: Section
    planning: Section
    targets: Section
    outputs: Section
    expect: list[Section]


def draw_law(
    random: np.random.Generator, law: str, modulus: float, limit: float, duration: float
) -> Section:
    """Return the table of a random material.

    Parameters
    ----------
    random : Generator
    law : str
        Name of the law in a case.
    modulus : float, Pa
        Approximate Young's modulus.
    limit : float
        Largest Poisson's ratio for which the element does not lock.
    duration : float, s
        Duration of the insertion; relaxation times are between a tenth and ten times of it.
    """
    if law in ("transversely-isotropic", "orthotropic"):
        while True:
            drawn = _transverse(random) if law.startswith("transversely") else _orthotropic(random)
            plain = {
                key: modulus * x if isinstance(x, float) and key in _PRESSURES else x
                for key, x in drawn.items()
            }
            try:
                values = np.linalg.eigvalsh(law_class(law, "materials")(**plain).compliance())
            except CaseError:  # the constants violate the stability of the law
                continue
            if values[0] > LEAST_EIGENVALUE * values[-1]:
                break
        return {
            "law": law,
            **{key: _written(key, value) for key, value in plain.items()},
            "density": DrawnQuantity(1000.0, "density"),
        }
    found: Section = {
        "law": law,
        "youngs_modulus": DrawnQuantity(modulus, "pressure"),
        "poissons_ratio": _ratio(random, limit),
        "density": DrawnQuantity(float(random.uniform(900.0, 1100.0)), "density"),
    }
    if law == "viscoelastic":
        count = int(random.integers(1, 4))
        shares = random.uniform(0.1, 0.8) * random.dirichlet(np.ones(count))
        found["shares"] = [float(share) for share in shares]
        times = duration * 10.0 ** random.uniform(-1.0, 1.0, count)
        found["times"] = [DrawnQuantity(float(time), "time") for time in times]
    return found


def _ratio(random: np.random.Generator, limit: float) -> float:
    if limit >= 0.4999 and random.random() < 0.35:
        return float(min(limit, random.choice([0.49, 0.495, 0.499, 0.4999])))
    return float(random.uniform(0.25, min(limit, 0.49)))


_PRESSURES = (
    "modulus_along", "modulus_across", "shear_along", "modulus_1", "modulus_2", "modulus_3",
    "shear_23", "shear_13", "shear_12",
)  # fmt: skip


def _transverse(random: np.random.Generator) -> dict[str, _Constant]:
    return {
        "modulus_along": random.uniform(1.2, 5.0),
        "modulus_across": 1.0,
        "shear_along": random.uniform(0.25, 0.8),
        "ratio_along": float(random.uniform(0.2, 0.45)),
        "ratio_across": float(random.uniform(0.1, 0.6)),
        "fibre": _direction(random.uniform(0.0, 2.0 * np.pi)),
    }


def _orthotropic(random: np.random.Generator) -> dict[str, _Constant]:
    angle = random.uniform(0.0, 2.0 * np.pi)
    found: dict[str, _Constant] = {f"modulus_{i}": random.uniform(0.6, 3.0) for i in (1, 2, 3)}
    found |= {f"ratio_{ij}": float(random.uniform(0.1, 0.4)) for ij in ("12", "13", "23")}
    found |= {f"shear_{ij}": random.uniform(0.25, 0.8) for ij in ("23", "13", "12")}
    return found | {"axis_1": _direction(angle), "axis_2": _direction(angle + 0.5 * np.pi)}


def _direction(angle: float) -> tuple[float, float]:
    return float(np.cos(angle)), float(np.sin(angle))


def _written(key: str, value: _Constant) -> object:
    """Return a constant as it stands in a case."""
    if isinstance(value, tuple):
        return list(value)
    return DrawnQuantity(float(value), "pressure") if key in _PRESSURES else value


# Random meshes: boxes with divisions, and graded grids that are written as files.


@dataclasses.dataclass(frozen=True, kw_only=True)
class Grid:
    """Size and divisions of the tissue in the scene's own frame.

    Parameters
    ----------
    from_file : bool
    width, height : float, m
        Size along the skin, and size in the direction of the needle.
    divisions : tuple of int
    pattern : str
        ``diagonal``, ``crossed`` or ``quadrilateral``.
    refined : bool
        Whether a box is refined along the needle.
    coarse_size, needle_size : float, m
        Element size elsewhere and along the needle.
    """

    from_file: bool
    width: float
    height: float
    divisions: tuple[int, int]
    pattern: str
    refined: bool
    coarse_size: float
    needle_size: float


def draw_grid(random: np.random.Generator, kind: str) -> Grid:
    """Return a random grid for a ``box`` or a ``file``."""
    from_file = kind == "file"
    width = float(random.uniform(0.03, 0.1))
    height = width * float(random.uniform(0.75, 1.3))
    patterns = ["diagonal", "quadrilateral"] if from_file else ["diagonal", "crossed"]
    pattern = str(random.choice([*patterns, "quadrilateral"]))
    refined = not from_file and random.random() < 0.3
    across = int(random.integers(6, 9) if refined else random.integers(9, 15))
    along = max(5, round(across * height / width * float(random.uniform(0.85, 1.2))))
    coarse = max(width / across, height / along)
    return Grid(
        from_file=from_file,
        width=width,
        height=height,
        divisions=(across, along),
        pattern=pattern,
        refined=refined,
        coarse_size=coarse,
        needle_size=coarse * (float(random.uniform(0.5, 0.7)) if refined else 1.0),
    )


def grid_of_file(
    random: np.random.Generator,
    grid: Grid,
    groups: Mapping[str, Points],
    file_format: str,
    out: Callable[[Floats], Floats],
) -> "DrawnMesh":
    """Return a graded grid with groups of cells by centroids, mapped to space by `out`."""
    ticks = [
        size * _graded(random, count)
        for size, count in zip((grid.width, grid.height), grid.divisions, strict=True)
    ]
    nx, ny = (len(t) for t in ticks)
    points = np.array(np.meshgrid(*ticks, indexing="ij")).reshape(2, -1).T
    points = points + _bulge(random, points, grid)
    number = np.arange(nx * ny).reshape(nx, ny)
    corners = [number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]]
    squares = np.stack([corner.ravel() for corner in corners], axis=1)
    cells = squares
    if grid.pattern != "quadrilateral":
        flip = random.random(len(squares)) < 0.5
        first = np.where(flip[:, None], squares[:, [0, 1, 2]], squares[:, [0, 1, 3]])
        second = np.where(flip[:, None], squares[:, [0, 2, 3]], squares[:, [1, 2, 3]])
        cells = np.concatenate([first, second])
    centroids = points[cells].mean(axis=1)
    regions = np.zeros(len(cells), dtype=int)
    for group, outline in enumerate(groups.values(), start=1):
        regions[Contour(outline).contains(centroids)] = group
    edges = {
        "near": number[:, 0],
        "far": number[:, -1],
        "left": number[0, :],
        "right": number[-1, :],
    }
    return DrawnMesh(
        points=out(points),
        cells=cells,
        regions=regions,
        region_names=tuple(groups),
        faces={face: np.stack([line[:-1], line[1:]], axis=1) for face, line in edges.items()},
        file_format=file_format,
    )


def _graded(random: np.random.Generator, count: int) -> Floats:
    """Return rising numbers from 0 to 1 with constant or variable growth of their distances."""
    ratio = float(random.uniform(0.94, 1.06)) if random.random() < 0.6 else 1.0
    steps = ratio ** np.arange(count)
    return np.concatenate([[0.0], np.cumsum(steps) / steps.sum()])


def _bulge(random: np.random.Generator, points: Points, grid: Grid) -> Points:
    """Return displacements of interior grid points; the outline does not change."""
    x, y = points[:, 0] / grid.width, points[:, 1] / grid.height
    hump = np.sin(np.pi * x) * np.sin(np.pi * y)
    found: Points = 0.25 * grid.coarse_size * hump[:, None] * random.uniform(-1.0, 1.0, 2)
    return found


# Random motions of the needle, and random parameters of time integration.


def draw_motion(random: np.random.Generator, kind: str, depth: float, speed: float) -> Section:
    """Return the keys of [motion] for a kind of motion; a single insertion needs none.

    Parameters
    ----------
    random : Generator
    kind : str
        ``push``, ``release``, ``out and in``, ``to and fro``, ``train`` or ``table``.
    depth : float, m
        Largest depth.
    speed : float, m/s
    """
    if kind == "push":
        return {}
    duration = depth / speed
    if kind == "table":
        return _table(random, depth, duration)
    stages: list[Section] = [{"depth": _length(depth)}]
    if random.random() < 0.5:
        stages[0]["speed"] = DrawnQuantity(speed * float(random.uniform(0.5, 1.0)), "speed")
    if kind == "release":
        rest = duration * float(random.uniform(0.02, 1.0))
        stages.append({"dwell": DrawnQuantity(rest, "time"), "release": "seed"})
        stages.append(
            {"depth": _length(random.choice([-0.05, 0.0, random.uniform(0, 0.8)]) * depth)}
        )
    elif kind == "out and in":
        stages.append({"depth": _length(-random.uniform(0.02, 0.2) * depth)})
        stages.append({"depth": _length(random.uniform(0.4, 1.0) * depth)})
    elif kind == "to and fro":
        for _ in range(int(random.integers(1, 4))):
            stages.append({"depth": _length(random.uniform(0.2, 0.9) * depth)})
            stages.append({"depth": _length(random.uniform(0.5, 1.0) * depth)})
    elif kind == "train":
        count = int(random.integers(2, 5))
        pitch = depth * float(random.uniform(0.05, 0.7 / count))
        end = depth - count * pitch if random.random() < 0.5 else -0.05 * depth
        stages.append({"depth": _length(end), "seed_count": count, "seed_spacing": _length(pitch)})
    return {"stages": stages}


def _table(random: np.random.Generator, depth: float, duration: float) -> Section:
    count = int(random.integers(2, 6))
    depths = random.uniform(-0.05, 0.95, count) * depth
    depths[0] = random.uniform(0.4, 1.0) * depth
    steps = np.abs(np.diff(depths, prepend=0.0)) / depth * duration
    times = np.cumsum(np.maximum(steps, 0.02 * duration) * random.uniform(0.8, 1.5, count))
    return {
        "times": [DrawnQuantity(float(time), "time") for time in (0.0, *times)],
        "depths": [_length(float(x)) for x in (0.0, *depths)],
    }


def _length(value: float) -> "DrawnQuantity":
    return DrawnQuantity(float(value), "length")


def draw_time(
    random: np.random.Generator, data: CaseTables, integrator: str, duration: float
) -> None:
    """Set parameters of an integrator with inertia, and damping."""
    found = data["discretization"]
    if integrator == "newmark":
        found["newmark_gamma"] = float(random.uniform(0.5, 0.8))
    else:
        found["rho_inf"] = float(random.uniform(0.2, 1.0))
    kind = random.choice(["none", "rayleigh", "ratios"])
    if kind == "rayleigh":
        data["damping"] = {
            "mass_rate": DrawnQuantity(float(random.uniform(0.0, 0.5)) / duration, "rate"),
            "stiffness_time": DrawnQuantity(float(random.uniform(0.0, 0.02)) * duration, "time"),
        }
    elif kind == "ratios":
        frequencies = np.array([1.0, random.uniform(3.0, 10.0)]) / duration
        data["damping"] = {
            "frequencies": [DrawnQuantity(float(f), "rate") for f in frequencies],
            "ratios": [float(x) for x in random.uniform(0.005, 0.1, 2)],
        }


# A random case: the tree of its TOML file with typed quantities, contours and mesh.


EXPONENTS = {
    "length": ("m", 1, 0, 0),
    "pressure": ("Pa", -2, 1, 0),
    "force per length": ("N/m", -1, 1, 0),
    "force per volume": ("N/m^3", -3, 1, 0),
    "density": ("kg/m^3", -4, 1, 2),
    "speed": ("m/s", 1, 0, -1),
    "time": ("s", 0, 0, 1),
    "rate": ("1/s", 0, 0, -1),
}
"""By dimension: the written unit, and the exponents of length, force and time."""


class DrawnQuantity(NamedTuple):
    """A number in SI units with its dimension."""

    value: float
    dimension: str

    def __str__(self) -> str:
        return f"{float(self.value)!r} {EXPONENTS[self.dimension][0]}"


class Units(NamedTuple):
    """Factors by which a scene's lengths, forces and times are multiplied."""

    length: float = 1.0
    force: float = 1.0
    time: float = 1.0

    def of(self, quantity: DrawnQuantity) -> DrawnQuantity:
        """Return the quantity in the other units."""
        _, length, force, time = EXPONENTS[quantity.dimension]
        factor = self.length**length * self.force**force * self.time**time
        return DrawnQuantity(quantity.value * factor, quantity.dimension)


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class DrawnMesh:
    """A mesh to be written as a file.

    Parameters
    ----------
    points : array, shape (n, 2), m
    cells : array, shape (m, 3) or (m, 4)
    regions : array, shape (m,)
        Group number of each cell; 0 is the background.
    region_names : tuple of str
        Names of the groups from 1 on.
    faces : mapping
        Boundary edges by the name of their group, shape (k, 2).
    file_format : str
        Name of the format in meshio.
    """

    points: Points
    cells: Ints
    regions: Ints
    region_names: tuple[str, ...]
    faces: Mapping[str, Ints]
    file_format: str


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class DrawnCase:
    """A random case.

    Parameters
    ----------
    data : mapping
        Tree of the TOML file; its leaves are TOML values and `DrawnQuantity`.
    contours : mapping
        Vertices of the contours by file name, shape (n, 2), m.
    mesh : DrawnMesh, optional
        Mesh file in the folder of the case.
    kinds : mapping
        Random choices by aspect, for the table of the report.
    command : str
        ``run`` or ``plan``.
    check : str
        Symmetry that is checked; empty for none.
    """

    data: Mapping[str, object]
    contours: Mapping[str, Points]
    mesh: DrawnMesh | None
    kinds: Mapping[str, str]
    command: str
    check: str = ""


MESH_UNIT = 1e-3
"""Length of one unit of the coordinates in a mesh file, m."""


def in_units(case: DrawnCase, units: Units) -> DrawnCase:
    """Return the case with scaled lengths, forces and times."""
    contours = {name: units.length * points for name, points in case.contours.items()}
    # including the unit of the mesh file
    scaled = {key: _walked(value, units.of) for key, value in case.data.items()}
    return dataclasses.replace(case, data=scaled, contours=contours)


def _walked(node: object, of: Callable[[DrawnQuantity], DrawnQuantity]) -> object:
    if isinstance(node, DrawnQuantity):
        return of(node)
    if isinstance(node, Mapping):
        return {key: _walked(value, of) for key, value in node.items()}
    if isinstance(node, list):
        return [_walked(item, of) for item in node]
    return node


def toml_lines(table: Mapping[str, object], prefix: str = "") -> Iterator[str]:
    """Yield the lines of a TOML file for a tree with `DrawnQuantity` leaves."""
    deeper: list[tuple[str, Mapping[str, object] | list[Mapping[str, object]]]] = []
    for key, value in table.items():
        bare = key.isascii() and key.replace("-", "").replace("_", "").isalnum()
        name = key if bare else json.dumps(key, ensure_ascii=False)
        if isinstance(value, Mapping) or (
            isinstance(value, list) and value and all(isinstance(item, Mapping) for item in value)
        ):
            deeper.append((prefix + name, value))
        else:
            yield f"{name} = {_toml(value)}"
    for name, inner in deeper:
        if isinstance(inner, Mapping):
            yield ""
            yield f"[{name}]"
            yield from toml_lines(inner, f"{name}.")
        else:
            for item in inner:
                yield ""
                yield f"[[{name}]]"
                yield from toml_lines(item, f"{name}.")


def _toml(value: object) -> str:
    if isinstance(value, DrawnQuantity):
        return json.dumps(str(value))
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, list):
        return "[" + ", ".join(_toml(item) for item in value) + "]"
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{json.dumps(k)} = {_toml(v)}" for k, v in value.items()) + "}"
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(value)
