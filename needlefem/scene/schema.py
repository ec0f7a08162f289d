"""The scene and its parts as frozen dataclasses; their fields are the keys of a case file."""

import dataclasses
from collections.abc import Iterable, Mapping
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from needlefem.errors import CaseError, nearest, short
from needlefem.fem.tissue_model import Support
from needlefem.geometry.contour import Contour
from needlefem.geometry.image_frame import ImageFrame
from needlefem.materials import Material
from needlefem.scene.discretization import (
    BoxMesh,
    Coordinates,
    Discretization,
    FileMesh,
    Limits,
    Rayleigh,
)
from needlefem.validation import (
    ParameterInfo,
    Validated,
    converted,
    made,
    parameter,
    unit,
    validate,
)

KEYS = {
    "default_material": "tissue.default_material",
    "plane": "tissue.plane",
    "target": "target.point",
}
"""Keys of a case file for fields of a scene that have another name."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Region(Validated):
    """A part of the tissue: inside a closed contour, or a group of the mesh file.

    The contour of a group is its outline, for pictures and for targets drawn in it.
    """

    TABLE = "regions.NAME"

    contour: Contour
    group: str | None = parameter(
        "Group of cells of the mesh file, instead of a contour", default=None
    )
    material: str = parameter("Name of its material")
    contour_size: float = parameter(
        "Element size along its contour; 0: mesh.refine.contour_size",
        "length",
        default=0.0,
        low=0.0,
        closed=True,
    )
    cutting_force: float | None = parameter(
        "Cutting force in the region, if it differs from the needle's",
        "cutting force",
        default=None,
        low=0.0,
    )
    shaft_friction: float | None = parameter(
        "Shaft friction in the region, if it differs from the needle's",
        "shaft friction",
        default=None,
        low=0.0,
        closed=True,
    )

    def __post_init__(self) -> None:
        """Convert and check; corners as an array or a list become a contour."""
        object.__setattr__(self, "contour", _contour(self.contour, f"{self.TABLE}.contour"))
        super().__post_init__()


@dataclasses.dataclass(frozen=True, kw_only=True)
class Obstacle(Validated):
    """A region that the needle must not touch: the inside of a contour, fixed in space."""

    TABLE = "obstacles.NAME"

    contour: Contour
    region: str | None = parameter("Region of the tissue, instead of a contour", default=None)
    clearance: float = parameter(
        "Smallest distance of the needle axis, from tip to hub", "length", low=0.0, closed=True
    )

    def __post_init__(self) -> None:
        """Convert and check; corners as an array or a list become a contour."""
        object.__setattr__(self, "contour", _contour(self.contour, f"{self.TABLE}.contour"))
        super().__post_init__()


@dataclasses.dataclass(frozen=True, kw_only=True)
class Needle(Validated):
    """A rigid, thin, straight needle with a symmetric tip."""

    TABLE = "needle"

    tip_radius: float = parameter(
        "Radius of the disc (ball) over which the tip force is distributed",
        "length",
        default=1.27e-3,
        low=0.0,
    )
    tip: str = parameter(
        "Tip force on a disc of the radius, or on a point, which does not converge",
        default="disc",
        choices=("disc", "point"),
    )
    cutting_force: float = parameter("Axial force at which the tip cuts", "cutting force", low=0.0)
    shaft_friction: float = parameter(
        "Friction limit per unit length of the cut path", "shaft friction", low=0.0, closed=True
    )
    lateral_penalty: float = parameter(
        "Stiffness that keeps the cut path on the axis, per length of the path",
        "lateral stiffness",
        default=1e9,
        low=0.0,
    )
    static_friction_ratio: float = parameter(
        "Static over kinetic friction limit", default=1.0, low=1.0, closed=True
    )
    slip_weakening_distance: float = parameter(
        "Slip over which friction decreases from static to kinetic",
        "length",
        default=0.0,
        low=0.0,
        closed=True,
    )
    tangential_penalty: float = parameter(
        "Stiffness of sticking segments along the needle, per length of the path; 0: rigid, or "
        "chosen where the mesh does not resolve rigid sticking",
        "lateral stiffness",
        default=0.0,
        low=0.0,
        closed=True,
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class Stage(Validated):
    """A part of the needle's motion: to a depth, or at rest for a time."""

    TABLE = "motion.stages"

    depth: float | None = parameter("Depth at its end", "length", default=None)
    speed: float | None = parameter(
        "Speed, if it differs from the motion's", "speed", default=None, low=0.0
    )
    dwell: float | None = parameter("How long the needle rests", "time", default=None, low=0.0)
    release: str | None = parameter(
        "Name of the seed that is released at the end of the stage", default=None
    )
    seed_count: int | None = parameter(
        "Number of seeds released during the retraction, the first at its start",
        default=None,
        low=1.0,
        closed=True,
    )
    seed_spacing: float | None = parameter(
        "Distance of seeds in a train", "length", default=None, low=0.0
    )

    def check(self) -> None:
        """See `Validated`."""
        key = self.TABLE
        if (self.depth is None) == (self.dwell is None):
            raise CaseError(key, "needs either 'depth' or 'dwell'", "give a depth or a duration")
        for name in ("speed", "seed_count", "seed_spacing") if self.dwell is not None else ():
            if getattr(self, name) is not None:
                raise CaseError(f"{key}.{name}", "the needle rests in this stage", "leave it out")
        if self.seed_spacing is not None and self.seed_count is None:
            raise CaseError(
                f"{key}.seed_spacing", "is not used without 'seed_count'", "give both or none"
            )


@dataclasses.dataclass(frozen=True, kw_only=True)
class Motion(Validated):
    """A straight insertion at constant speed, or a motion given by stages or a table."""

    TABLE = "motion"

    direction: Coordinates = parameter("Direction of insertion")
    entry: Coordinates = parameter(
        "Point of the skin; where the line through the target meets it when left out",
        "length",
        default=(),
    )
    max_depth: float = parameter("Largest feasible depth of the tip", "length", low=0.0)
    speed: float = parameter("Speed of insertion", "speed", default=5e-3, low=0.0)
    stages: tuple[Stage, ...] = parameter(
        "Insertion, dwell, retraction: one table for each; one insertion if omitted", default=()
    )
    times: Coordinates = parameter("Times of a table, instead of stages", "time", default=())
    depths: Coordinates = parameter("Depths at these times", "length", default=())

    def check(self) -> None:
        """See `Validated`; the direction is made a unit vector."""
        object.__setattr__(self, "direction", unit(self.direction, "motion.direction"))


@dataclasses.dataclass(frozen=True, kw_only=True)
class Planning(Validated):
    """How release points are searched."""

    TABLE = "planning"

    offset_range: tuple[float, float] = parameter(
        "Feasible lateral offsets relative to the target", "length", default=(-2e-3, 2e-3)
    )
    directions: tuple[Coordinates, ...] = parameter(
        "Directions to try in turn if obstacles block that of the motion", default=()
    )
    search: str = parameter(
        "Root of the lateral error, golden section as in the paper, or a grid",
        default="root",
        choices=("root", "golden", "grid"),
    )
    tolerance: float = parameter(
        "Lateral error at which the root is accepted", "length", default=1e-8, low=0.0
    )
    interval_tolerance: float = parameter(
        "Width of the interval of offsets at which golden section and grid end",
        "length",
        default=1e-4,
        low=0.0,
    )
    max_insertions: int = parameter(
        "Largest number of insertions of a search", default=40, low=1.0, closed=True
    )
    estimate: bool = parameter(
        "Whether to estimate the placement error due to the elements", default=True
    )
    accuracy: float = parameter(
        "Placement error for which element, sizes and path spacing are chosen; 0: as in the case",
        "length",
        default=0.0,
        low=0.0,
        closed=True,
    )
    max_unknowns: int = parameter(
        "Largest number of unknowns for an accuracy", default=100_000, low=1.0, closed=True
    )

    def check(self) -> None:
        """See `Validated`."""
        low, high = self.offset_range
        if low >= high:
            problem = f"{low:g} to {high:g} m is empty"
            raise CaseError("planning.offset_range", problem, "swap the ends")
        for direction in self.directions:
            unit(direction, "planning.directions")


@dataclasses.dataclass(frozen=True, kw_only=True)
class TargetDraw(Validated):
    """Targets drawn uniformly inside a region, for statistics of the planner."""

    TABLE = "targets"

    region: str = parameter("Region to draw in")
    count: int = parameter("How many targets", default=12, low=1.0, closed=True)
    seed: int = parameter("Seed of the random numbers", default=2003, low=0.0, closed=True)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Outputs(Validated):
    """Pictures and files that are written."""

    TABLE = "outputs"

    folder: str = parameter(
        "Folder of the results, relative to the working directory", default="out"
    )
    pictures: tuple[str, ...] = parameter(
        "Pictures to draw: stages, depth, height", default=("stages", "depth", "height")
    )
    strain_limit: float = parameter(
        "Largest strain away from the tip for which small strain is accepted; the first line of a "
        "result states whether it is exceeded",
        default=0.3,
        low=0.0,
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class Expectation(Validated):
    """The expected value of a result, and its source.

    `value` is a number or a point (then `tolerance` bounds the distance). Without a tolerance the
    value is an upper bound.
    """

    TABLE = "expect"

    key: str
    value: float | Coordinates
    tolerance: float | None = parameter(
        "Largest difference; an upper bound when left out", default=None, low=0.0, closed=True
    )
    unit: str = ""
    kind: str = ""
    source: str = ""

    def check(self) -> None:
        """See `Validated`."""
        if isinstance(self.value, tuple) and self.tolerance is None:
            raise CaseError("expect.tolerance", "missing", "a point needs one: give a distance")


@dataclasses.dataclass(frozen=True, kw_only=True)
class Scene(Validated):
    """All inputs of a case. Points are in metres, in the order of `axes`."""

    TABLE = ""

    title: str
    axes: tuple[str, ...]
    mesh: BoxMesh | FileMesh
    materials: Mapping[str, Material]
    default_material: str
    regions: Mapping[str, Region]
    supports: Mapping[str, Support]
    plane: str = parameter("Plane strain or stress", default="strain", choices=("strain", "stress"))
    obstacles: Mapping[str, Obstacle] = dataclasses.field(default_factory=dict)
    damping: Rayleigh = dataclasses.field(default_factory=Rayleigh)
    discretization: Discretization = dataclasses.field(default_factory=Discretization)
    needle: Needle
    motion: Motion
    target: Coordinates | None = parameter("Point for the seed", "length", default=None)
    planning: Planning = Planning()
    targets: TargetDraw | None = None
    outputs: Outputs = Outputs()
    limits: Limits = dataclasses.field(default_factory=Limits)
    expect: tuple[Expectation, ...] = ()
    frame: ImageFrame | None = None
    source: Path | None = None
    overrides: Mapping[str, object] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        """Convert and check; messages name the keys of a case file."""
        try:
            super().__post_init__()
        except CaseError as error:
            key = KEYS.get(error.key, error.key)
            raise CaseError(key, error.problem, error.remedy) from None

    @property
    def dim(self) -> int:
        """Number of space dimensions."""
        return len(self.axes)

    @property
    def contours(self) -> dict[str, Contour]:
        """Contours of the regions that are not groups of a mesh file, in the order of the case."""
        return {n: region.contour for n, region in self.regions.items() if region.group is None}

    def check(self) -> None:
        """See `Validated`: names that must exist, and one number for each axis."""
        if self.dim not in (2, 3) or len(set(self.axes)) != self.dim or not all(self.axes):
            remedy = 'name two different axes, such as ["y", "z"]'
            raise CaseError("axes", f"{list(self.axes)}", remedy)
        for name, law in self.materials.items():
            made(partial(validate, law, "material"), "material", f"materials.{name}")
        self._check_names()
        self._check_dimensions()

    def _check_names(self) -> None:
        used = {"tissue.default_material": self.default_material}
        used |= {f"regions.{n}.material": region.material for n, region in self.regions.items()}
        for key, name in used.items():
            _known(key, "material", name, self.materials)
        if self.targets is not None:
            _known("targets.region", "region", self.targets.region, self.regions)
        for n, obstacle in self.obstacles.items():
            if obstacle.region is not None:
                _known(f"obstacles.{n}.region", "region", obstacle.region, self.regions)
        for n, support in self.supports.items():
            for name in support.regions:
                _known(f"supports.{n}.regions", "region", name, self.regions)
            for axis in support.fixed:
                _known(f"supports.{n}.fixed", "axis", axis, self.axes)

    def _check_dimensions(self) -> None:
        counts = {
            "target.point": self.target,
            "motion.direction": self.motion.direction,
            "motion.entry": self.motion.entry or None,
        }
        if isinstance(self.mesh, BoxMesh):
            counts["mesh.size"] = self.mesh.size
        counts |= {
            f"supports.{n}.direction": support.direction or None
            for n, support in self.supports.items()
        }
        for direction in self.planning.directions:
            counts["planning.directions"] = direction
            if len(direction) != self.dim:
                break
        for key, values in counts.items():
            if values is not None and len(values) != self.dim:
                remedy = f"give {self.dim}, one for each axis"
                raise CaseError(key, f"{len(values)} numbers", remedy)


def point_of(raw: object, dim: int, key: str) -> Coordinates:
    """Return a point of a scene, m, from an array, a list or a tuple.

    Raises
    ------
    CaseError
        Not `dim` finite numbers.
    """
    found: Coordinates = converted(Coordinates, raw, _POINT, key)
    if len(found) != dim:
        raise CaseError(key, f"{len(found)} numbers", f"give {dim}, one for each axis")
    return found


_POINT = ParameterInfo("A point", "length")


def _known(key: str, what: str, name: str, known: Iterable[str]) -> None:
    if name not in known:
        raise CaseError(key, f"no {what} {short(name)}", nearest(name, known))


def _contour(raw: Contour | ArrayLike, key: str) -> Contour:
    """Return corners as a contour; a contour is returned unchanged.

    Raises
    ------
    CaseError
        The corners are not pairs of finite numbers.
    """
    try:
        found = raw if isinstance(raw, Contour) else Contour(np.array(raw, dtype=float))
        shape = found.points.shape
        fits = len(shape) == 2 and shape[1] == 2 and bool(np.isfinite(found.points).all())
    except (TypeError, ValueError):
        fits = False
    if not fits:
        raise CaseError(key, f"{short(raw)} is not a contour", "give corners, shape (n, 2), m")
    return found
