"""Random meshes: boxes by their divisions, and graded grids that are written as files."""

import dataclasses
from collections.abc import Callable, Mapping

import numpy as np

from needlefem._arrays import Floats, Points
from needlefem.geometry.contour import Contour
from needlefem.stress.drawncase import DrawnMesh


@dataclasses.dataclass(frozen=True, kw_only=True)
class Grid:
    """Size and divisions of the tissue in the scene's own frame.

    Parameters
    ----------
    from_file : bool
    width, height : float, m
        Along the skin, and into the tissue.
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
) -> DrawnMesh:
    """Return a graded grid with groups of cells by their centroids, moved into space by `out`."""
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
    """Return rising numbers from 0 to 1 whose distances grow evenly, or not."""
    ratio = float(random.uniform(0.94, 1.06)) if random.random() < 0.6 else 1.0
    steps = ratio ** np.arange(count)
    return np.concatenate([[0.0], np.cumsum(steps) / steps.sum()])


def _bulge(random: np.random.Generator, points: Points, grid: Grid) -> Points:
    """Return displacements that bend the grid's lines inside and leave its outline."""
    x, y = points[:, 0] / grid.width, points[:, 1] / grid.height
    hump = np.sin(np.pi * x) * np.sin(np.pi * y)
    found: Points = 0.25 * grid.coarse_size * hump[:, None] * random.uniform(-1.0, 1.0, 2)
    return found
