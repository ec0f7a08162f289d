"""The parts of a scene."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from needlefem.contour import Contour
from needlefem.frame import Frame
from needlefem.knobs import knob
from needlefem.materials import Material
from needlefem.scene.meshing import BoxMesh, Coordinates, FileMesh
from needlefem.scene.method import Discretisation, Rayleigh


@dataclasses.dataclass(frozen=True, kw_only=True)
class Region:
    """A part of the tissue: inside a closed contour, or a group of the mesh file.

    The contour of a group is its outline, for pictures and for targets drawn in it.
    """

    contour: Contour
    group: str | None = knob("Group of cells of the mesh file, instead of a contour", default=None)
    material: str = knob("Name of its material")
    cutting_force: float | None = knob(
        "Cutting force here, where it differs from the needle's",
        "cutting force",
        default=None,
        low=0.0,
    )
    shaft_friction: float | None = knob(
        "Shaft friction here, where it differs from the needle's",
        "shaft friction",
        default=None,
        low=0.0,
        closed=True,
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class Support:
    """Faces on which displacement components are held at zero."""

    faces: tuple[str, ...] = knob("Named faces of the mesh")
    fixed: tuple[str, ...] = knob("Axes whose displacement is held; all when left out", default=())


@dataclasses.dataclass(frozen=True, kw_only=True)
class Needle:
    """A rigid, thin, straight needle with a symmetric tip."""

    tip_radius: float = knob(
        "Radius of the disc (ball) over which the tip's force is spread",
        "length",
        default=1.27e-3,
        low=0.0,
    )
    tip: str = knob(
        "As thick as its radius, or a needle without thickness, which never converges",
        default="disc",
        choices=("disc", "point"),
    )
    cutting_force: float = knob("Axial force at which the tip cuts", "cutting force", low=0.0)
    shaft_friction: float = knob(
        "Friction limit per unit length of the cut path", "shaft friction", low=0.0, closed=True
    )
    lateral_stiffness: float = knob(
        "Stiffness that holds the cut path on the axis, per unit of its length",
        "lateral stiffness",
        default=1e9,
        low=0.0,
    )
    static_friction: float = knob(
        "Friction limit of what sticks, over that of what slips", default=1.0, low=1.0, closed=True
    )
    weakening_length: float = knob(
        "Slip over which friction falls from static to kinetic",
        "length",
        default=0.0,
        low=0.0,
        closed=True,
    )
    stick_stiffness: float = knob(
        "Stiffness of sticking along the needle, per unit of its length; 0: rigid",
        "lateral stiffness",
        default=0.0,
        low=0.0,
        closed=True,
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class Stage:
    """A part of the needle's motion: to a depth, or at rest for a time."""

    to: float | None = knob("Depth at its end", "length", default=None)
    speed: float | None = knob(
        "Speed, where it differs from the motion's", "speed", default=None, low=0.0
    )
    hold: float | None = knob("How long the needle rests", "time", default=None, low=0.0)
    release: str | None = knob("What the tip lets go of at its end, by a name", default=None)
    train: int | None = knob(
        "How many seeds are laid while retracting, the first where it starts",
        default=None,
        low=1.0,
        closed=True,
    )
    pitch: float | None = knob("Distance of seeds in a train", "length", default=None, low=0.0)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Motion:
    """A straight insertion at constant speed, or what stages or a table say."""

    direction: Coordinates = knob("Direction of insertion")
    entry: Coordinates = knob(
        "Point of the skin; where the line through the target meets it when left out",
        "length",
        default=(),
    )
    max_depth: float = knob("Largest feasible depth of the tip", "length", low=0.0)
    speed: float = knob("Speed of insertion", "speed", default=5e-3, low=0.0)
    stages: tuple[Stage, ...] = knob(
        "Insert, hold, retract: one table for each; one insertion when left out", default=()
    )
    times: Coordinates = knob("Times of a table, instead of stages", "time", default=())
    depths: Coordinates = knob("Depths at these times", "length", default=())


@dataclasses.dataclass(frozen=True, kw_only=True)
class Planning:
    """How release points are searched."""

    height_range: tuple[float, float] = knob(
        "Feasible insertion heights, relative to the target's", "length", default=(-2e-3, 2e-3)
    )
    search: str = knob(
        "Root of the signed miss, golden section as in the paper, or a grid",
        default="root",
        choices=("root", "golden", "grid"),
    )
    tolerance: float = knob(
        "Signed miss at which the root is accepted", "length", default=1e-8, low=0.0
    )
    golden_tolerance: float = knob(
        "Width of the height interval at which golden section and grid end",
        "length",
        default=1e-4,
        low=0.0,
    )
    max_insertions: int = knob("Most insertions of one search", default=40, low=1.0, closed=True)
    estimate: bool = knob("Whether to estimate what the elements do to the placement", default=True)
    accuracy: float = knob(
        "Error of the placement that element, sizes and path spacing are chosen for; 0: the case's",
        "length",
        default=0.0,
        low=0.0,
        closed=True,
    )
    max_unknowns: int = knob(
        "Most unknowns that are spent on an accuracy", default=100_000, low=1.0, closed=True
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class TargetDraw:
    """Targets drawn uniformly inside a region, for statistics of the planner."""

    region: str = knob("Region to draw in")
    count: int = knob("How many targets", default=12, low=1.0, closed=True)
    seed: int = knob("Seed of the random numbers", default=2003)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Outputs:
    """What is written."""

    folder: str = knob("Folder of the results, relative to the working directory", default="out")
    pictures: tuple[str, ...] = knob(
        "Pictures to draw: stages, depth, height", default=("stages", "depth", "height")
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class Expectation:
    """A value that a result must have, and where it comes from.

    `value` is a number or a point (then `tolerance` bounds the distance); without a tolerance
    it is an upper bound.
    """

    key: str
    value: float | Coordinates
    tolerance: float | None
    unit: str
    kind: str
    source: str


@dataclasses.dataclass(frozen=True, kw_only=True)
class Scene:
    """All that a case says. Points are in metres, in the order of `axes`."""

    title: str
    axes: tuple[str, ...]
    mesh: BoxMesh | FileMesh
    materials: Mapping[str, Material]
    background: str
    regions: Mapping[str, Region]
    supports: Mapping[str, Support]
    plane: str = "strain"
    damping: Rayleigh = dataclasses.field(default_factory=Rayleigh)
    discretisation: Discretisation = dataclasses.field(default_factory=Discretisation)
    needle: Needle
    motion: Motion
    target: Coordinates | None = None
    planning: Planning = Planning()
    targets: TargetDraw | None = None
    outputs: Outputs = Outputs()
    expect: tuple[Expectation, ...] = ()
    frame: Frame | None = None
    source: Path | None = None
    overrides: Mapping[str, Any] = dataclasses.field(default_factory=dict)

    @property
    def dim(self) -> int:
        """Number of space dimensions."""
        return len(self.axes)
