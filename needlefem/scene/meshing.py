"""Where the mesh of a scene comes from."""

import dataclasses
from pathlib import Path

from needlefem._parameter import parameter
from needlefem.errors import CaseError
from needlefem.validation import Validated

Coordinates = tuple[float, ...]
FLATTEST = 1000.0
"""Largest ratio of the edges of a box's squares: flatter ones are inaccurate."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Refinement(Validated):
    """Local refinement of the mesh; a size of 0 leaves it as it is."""

    TABLE = "mesh.refine"

    corridor_size: float = parameter(
        "Element size along the needle", "length", default=0.0, low=0.0, closed=True
    )
    corridor_width: float = parameter(
        "Full width of the refined corridor around the needle's line",
        "length",
        default=0.0,
        low=0.0,
        closed=True,
    )
    corridor_depth: float = parameter(
        "Depth below the skin to which the corridor reaches",
        "length",
        default=0.0,
        low=0.0,
        closed=True,
    )
    contour_size: float = parameter(
        "Element size along the contours of regions that have none of their own",
        "length",
        default=0.0,
        low=0.0,
        closed=True,
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class BoxMesh(Validated):
    """A box of triangles or quadrilaterals from a regular grid.

    Quadrilaterals refined or fitted somewhere are made from triangles, three of each.
    """

    TABLE = "mesh"

    size: Coordinates = parameter("Edge lengths of the box", "length", low=0.0)
    origin: Coordinates = parameter("Corner with the smallest coordinates", "length", default=())
    divisions: tuple[int, ...] = parameter("Squares along every axis", low=1.0, closed=True)
    pattern: str = parameter(
        "How a square is cut: into two triangles, into four, or left whole",
        default="diagonal",
        choices=("diagonal", "crossed", "quadrilateral"),
    )
    interfaces: str = parameter(
        "How cells meet a contour: assigned by their centroid, or moved onto it",
        default="centroid",
        choices=("centroid", "fitted"),
    )
    refine: Refinement = Refinement()

    def check(self) -> None:
        """See `Validated`."""
        counts = len(self.size), len(self.divisions), len(self.origin or self.size)
        if len(set(counts)) > 1:
            problem = f"{counts[0]} edge lengths, {counts[1]} divisions, {counts[2]} coordinates"
            fewest = ("size", "divisions", "origin")[counts.index(min(counts))]
            raise CaseError(f"mesh.{fewest}", f"{problem} of the origin", "give one for each axis")
        edges = [length / n for length, n in zip(self.size, self.divisions, strict=True)]
        if max(edges) > FLATTEST * min(edges):
            problem = f"squares of {' x '.join(f'{edge:.3g}' for edge in edges)} m"
            remedy = "give sizes and mesh.divisions that make squares about as long as wide"
            raise CaseError("mesh.size", f"{problem} are flatter than 1 : {FLATTEST:g}", remedy)


@dataclasses.dataclass(frozen=True, kw_only=True)
class FileMesh(Validated):
    """A mesh from a file that meshio reads, with named groups of cells and faces."""

    TABLE = "mesh"

    path: Path
    unit: float = parameter("Length of one unit of the file's coordinates", "length", low=0.0)
    cell: str = parameter(
        "Shape of its cells", default="triangle", choices=("triangle", "quadrilateral")
    )
