"""Mesh, discretisation, damping and limits of a scene."""

import dataclasses
import math
from pathlib import Path

from needlefem.errors import CaseError
from needlefem.validation import Validated, parameter

Coordinates = tuple[float, ...]
FLATTEST = 1000.0
"""Largest aspect ratio of the squares of a box; flatter ones are inaccurate."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Refinement(Validated):
    """Local refinement of the mesh; a size of 0 means no refinement."""

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

    If quadrilaterals are refined or fitted, they are made of triangles, three of each.
    """

    TABLE = "mesh"

    size: Coordinates = parameter("Edge lengths of the box", "length", low=0.0)
    origin: Coordinates = parameter("Corner with the smallest coordinates", "length", default=())
    divisions: tuple[int, ...] = parameter("Squares along every axis", low=1.0, closed=True)
    pattern: str = parameter(
        "Division of a square: two triangles, four triangles, or one quadrilateral",
        default="diagonal",
        choices=("diagonal", "crossed", "quadrilateral"),
    )
    interfaces: str = parameter(
        "How cells meet a contour: assigned by their centroid, or moved onto it",
        default="by_centroid",
        choices=("by_centroid", "fitted"),
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
    """A mesh from a file, with named groups of cells and faces."""

    TABLE = "mesh"

    path: Path
    unit: float = parameter("Length of one unit of the file's coordinates", "length", low=0.0)
    cell: str = parameter(
        "Shape of its cells", default="triangle", choices=("triangle", "quadrilateral")
    )


# Parameters of the method, and damping.


DYNAMIC = ("newmark", "hht", "generalized_alpha")
"""Integrators with inertia."""
TISSUE_ALONE = {"central_difference": "is explicit and integrates tissue without a needle only"}
"""Integrators that no case can choose, and why."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Discretization(Validated):
    """Numerical parameters."""

    TABLE = "discretization"

    element: str = parameter("Element of the catalogue, or 'auto'", default="auto")
    path_spacing: float = parameter(
        "Length of the contact segments of the cut path",
        "length",
        default=0.8e-3,
        low=0.0,
    )
    tip_quadrature_points: int = parameter(
        "Quadrature points of the tip kernel; 0: chosen by the distance of nodes",
        default=0,
        low=0.0,
        closed=True,
    )
    integrator: str = parameter(
        "Path following, time stepping without or with inertia, or what the scene needs",
        default="auto",
        choices=("auto", "path_following", "quasi_static", *DYNAMIC),
        refused=TISSUE_ALONE,
    )
    time_step: float = parameter(
        "Longest time step; 0: half a contact segment at the motion's speed",
        "time",
        default=0.0,
        low=0.0,
        closed=True,
    )
    rho_inf: float = parameter(
        "Generalized-alpha: factor per step for frequencies that the step does not resolve",
        default=0.8,
        low=0.0,
        high=1.0,
        closed=True,
    )
    newmark_gamma: float = parameter(
        "Newmark: 0.5 is the average acceleration, larger values damp; beta follows from it",
        default=0.6,
        low=0.5,
        high=1.0,
        closed=True,
    )
    hht_alpha: float = parameter(
        "HHT: -1/3 damps most, 0 is the average acceleration",
        default=-0.1,
        low=-1.0 / 3.0,
        high=0.0,
        closed=True,
    )
    mass_matrix: str = parameter(
        "Mass matrix with inertia: consistent, or a lumping scheme of the element",
        default="consistent",
        choices=("consistent", "row-sum", "hrz"),
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class Rayleigh(Validated):
    """Viscous damping ``mass_rate M + stiffness_time K``, or two ratios at two frequencies."""

    TABLE = "damping"

    mass_rate: float = parameter("Damping of velocities", "rate", default=0.0, low=0.0, closed=True)
    stiffness_time: float = parameter(
        "Damping of strain rates", "time", default=0.0, low=0.0, closed=True
    )
    frequencies: Coordinates = parameter(
        "Two frequencies with known damping, instead of the rates", "rate", default=(), low=0.0
    )
    ratios: Coordinates = parameter(
        "Damping ratios at these frequencies", default=(), low=0.0, closed=True
    )

    def check(self) -> None:
        """See `Validated`."""
        if not self.frequencies and not self.ratios:
            return
        key = "damping.frequencies"
        if self.mass_rate or self.stiffness_time:
            raise CaseError(key, "mass_rate or stiffness_time as well", "keep one")
        counts = len(self.frequencies), len(self.ratios)
        if counts != (2, 2):
            problem = f"{counts[0]} frequencies and {counts[1]} ratios"
            raise CaseError(key, problem, "give two of both")
        first, second = (2.0 * math.pi * frequency for frequency in self.frequencies)
        if first == second:
            raise CaseError(key, f"{list(self.frequencies)}", "give two different ones")
        low, high = self.ratios
        # the coefficients of mass and stiffness, over factors that have the same sign
        if min((high * first - low * second) / (first - second),
               (low * first - high * second) / (first - second)) < 0.0:  # fmt: skip
            problem = f"{list(self.ratios)} make one of mass_rate and stiffness_time negative"
            raise CaseError("damping.ratios", problem, "bring the ratios closer together")


@dataclasses.dataclass(frozen=True, kw_only=True)
class Limits(Validated):
    """Largest work of a scene; a scene with a larger estimate is refused before the computation."""

    TABLE = "limits"

    memory: float = parameter(
        "Largest memory of mesh, stiffness and contact",
        "memory",
        default=8e9,
        low=1e6,
        closed=True,
    )
    steps: int = parameter(
        "Largest number of contact segments, or time steps, of one motion",
        default=1_000_000,
        low=1.0,
        closed=True,
    )
    count: int = parameter(
        "Largest number of targets, seeds, kernel points, snapshots, panels or frames",
        default=10_000,
        low=1.0,
        closed=True,
    )
