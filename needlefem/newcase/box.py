"""Boxes of tissue around contours, with meshes that suit quadratic elements."""

import dataclasses
from collections.abc import Mapping
from itertools import combinations

import numpy as np

from needlefem._arrays import Floats, Vector
from needlefem._toml import comment, quoted
from needlefem.errors import CaseError
from needlefem.geometry.contour import Contour
from needlefem.materials import Isotropic
from needlefem.newcase.draft import listed, millimetres, point_text, region_names
from needlefem.scene import BoxMesh, Motion, Needle, Refinement, Region, Scene
from needlefem.scene.build import build_mesh

TIP_RADIUS = 1.27e-3
CORRIDOR_SIZE = TIP_RADIUS
"""Element size along the needle: a tip radius, because quadratic elements have midside nodes."""
HALVINGS = 2
"""Number of bisections from the squares of the box to the elements of the corridor."""
MOST_SQUARES = 32
"""Largest number of squares along the longer side of the box; a larger box has larger squares."""
ACROSS = 8.0
"""Quadratic elements along the side of a square with the area of a region."""
LARGEST = 3e-3
"""Largest element size along a contour, m."""
REACH = 0.5
"""Allowed depth behind the target relative to the depth of the target. The tip pushes tissue ahead
of it before it cuts, so that the release point lies behind the target."""
SIDEWAYS, LEAST_SIDEWAYS = 0.1, 3e-3
"""Range of lateral offsets of the search: relative to the target's depth, and at least, m."""
WHOLE = 1e-3
"""The coordinates of a box are multiples of this length, m."""
CELLS_PER_EDGE, CELLS_PER_CORRIDOR = 20.0, 2.5
"""Measured numbers of cells: per edge along a contour, and per squared size in the corridor."""
MOST_CELLS = 50_000
"""Largest estimated number of cells in the mesh of a draft."""


@dataclasses.dataclass(frozen=True, eq=False)
class Box:
    """A box of tissue: smallest and largest coordinates, shape (2,), m."""

    low: Floats
    high: Floats

    def depth_of(self, point: Vector, direction: Vector) -> float:
        """Return the distance of a point from the face where a line through it enters, m."""
        with np.errstate(divide="ignore"):
            back = np.where(direction > 0, point - self.low, point - self.high) / direction
        return float(np.min(back[direction != 0]))

    def gap(self, contour: Contour) -> float:
        """Return the smallest distance of a contour to the faces, m; negative if it is outside."""
        points = contour.points
        return float(min((points - self.low).min(), (self.high - points).min()))


@dataclasses.dataclass(frozen=True, eq=False)
class TargetLine:
    """The needle's line: target and direction, shape (2,), and the depth of the target, m."""

    target: Vector
    direction: Vector
    depth: float

    @property
    def max_depth(self) -> float:
        """Return the largest allowed depth, m, in whole millimetres."""
        return float(WHOLE * np.ceil((1.0 + REACH) * self.depth / WHOLE))

    @property
    def sideways(self) -> float:
        """Return the largest lateral offset from the target in the search, m."""
        wanted = max(LEAST_SIDEWAYS, SIDEWAYS * self.depth)
        return float(WHOLE * np.ceil(wanted / WHOLE))

    @property
    def end(self) -> Vector:
        """Return the end of the box along the line, behind the largest depth, shape (2,), m."""
        beyond = self.max_depth - self.depth + 4.0 * TIP_RADIUS
        end: Vector = self.target + beyond * self.direction
        return end


def box_around(contours: Mapping[str, Contour], margin: float, *points: Vector) -> Box:
    """Return the box around contours and points, with a margin, in whole millimetres."""
    rows = np.vstack([*(c.points for c in contours.values()), *(np.atleast_2d(p) for p in points)])
    low = WHOLE * np.floor((rows.min(axis=0) - margin) / WHOLE)
    high = WHOLE * np.ceil((rows.max(axis=0) + margin) / WHOLE)
    return Box(low, high)


def with_room(box: Box, line: TargetLine) -> Box:
    """Return the box, enlarged if the end of the needle's line is outside of it.

    The face through which the needle enters does not change.
    """
    low = WHOLE * np.floor(line.end / WHOLE)
    high = WHOLE * np.ceil(line.end / WHOLE)
    return Box(np.minimum(box.low, low), np.maximum(box.high, high))


@dataclasses.dataclass(frozen=True, eq=False)
class BoxDraft:
    """A box, the element sizes along its contours (m, by name), and the kind of interfaces.

    Parameters
    ----------
    box : Box
    sizes : mapping
    interfaces : str
        ``fitted`` or ``centroid``.
    why : str
        Reason for the kind of interfaces, for a comment in the case.
    line : TargetLine or None
    """

    box: Box
    sizes: Mapping[str, float]
    interfaces: str
    why: str
    line: TargetLine | None

    def text(self) -> str:
        """Return the [mesh] tables."""
        lines = [
            "[mesh]",
            f"origin = {point_text(self.box.low)}",
            f"size = {point_text(self.box.high - self.box.low)}",
            f"divisions = {listed(str(n) for n in divisions(self.box))}",
            _commented(f"interfaces = {quoted(self.interfaces)}", comment(self.why)),
            "",
            _commented("[mesh.refine]", "for quadratic elements (the default)"),
            _commented(
                f"contour_size = {millimetres(max(self.sizes.values()), 3)}",
                "for regions without a size of their own",
            ),
            _commented(
                f"corridor_size = {millimetres(CORRIDOR_SIZE, 3)}",
                "along the needle: the radius of the tip",
            ),
            f"corridor_width = {millimetres(_width(self.line), 3)}",
        ]
        return "\n".join(lines)

    def own_size(self, name: str) -> str:
        """Return the line with a region's own contour size; empty if it is not needed."""
        if self.sizes[name] == max(self.sizes.values()):
            return ""
        return f"\ncontour_size = {millimetres(self.sizes[name], 3)}"


def _commented(line: str, remark: str) -> str:
    return f"{line:30s} # {remark}"


def box_draft(
    box: Box,
    contours: Mapping[str, Contour],
    finest: float,
    line: TargetLine | None,
    *,
    key: str,
    remedy: str,
) -> BoxDraft:
    """Return a box whose cells end at the contours, if such a mesh is possible.

    Parameters
    ----------
    box : Box
    contours : mapping of names to Contour
    finest : float, m
        Smallest useful size along a contour, such as that of a voxel.
    line : TargetLine or None
        Line of the needle, if it is known.
    key, remedy : str
        Option that contains the contours, and remedy for too many cells, in messages.

    Raises
    ------
    CaseError
        The mesh would have more than `MOST_CELLS` cells.
    """
    sizes = contour_sizes(contours, finest)
    cells = _cells(box, contours, sizes, line)
    if cells > MOST_CELLS:
        size = " x ".join(f"{length:.3g}" for length in box.high - box.low)
        problem = (
            f"a mesh for the box of {size} m would have about {float(f'{cells:.2g}'):,.0f} cells, "
            f"more than {MOST_CELLS:,}"
        )
        raise CaseError(key, problem, remedy)
    gap, names = _nearest(box, contours, sizes)
    if gap is not None:
        why = f"{names} have a distance of {1e3 * gap:.2g} mm: cells are assigned by centroid"
        return BoxDraft(box, sizes, "by_centroid", why, line)
    draft = BoxDraft(box, sizes, "fitted", "cells end at the contours", line)
    try:
        build_mesh(_trial(draft, contours))
    except CaseError as error:
        why = f"{error.problem}: cells are assigned by centroid"
        return BoxDraft(box, sizes, "by_centroid", why, line)
    return draft


def divisions(box: Box) -> tuple[int, ...]:
    """Return the number of squares along each axis."""
    size = box.high - box.low
    square = CORRIDOR_SIZE * 2.0**HALVINGS
    while size.max() > MOST_SQUARES * square:
        square *= 2.0
    return tuple(int(n) for n in np.maximum(2, np.ceil(size / square)))


def contour_sizes(contours: Mapping[str, Contour], finest: float) -> dict[str, float]:
    """Return the element size along each contour, m."""
    return {name: _contour_size(contour, finest) for name, contour in contours.items()}


def _cells(
    box: Box, contours: Mapping[str, Contour], sizes: Mapping[str, float], line: TargetLine | None
) -> float:
    """Return an estimate of the number of cells, before the mesh is made."""
    cells = 2.0 * float(np.prod(divisions(box)))
    cells += CELLS_PER_EDGE * sum(c.length / sizes[name] for name, c in contours.items())
    if line is not None:
        cells += CELLS_PER_CORRIDOR * line.max_depth * _width(line) / CORRIDOR_SIZE**2
    return cells


def _contour_size(contour: Contour, finest: float) -> float:
    side = float(np.sqrt(contour.area))
    wanted = float(np.clip(side / ACROSS, finest, max(finest, LARGEST)))
    steps = np.round(2.0 * np.log2(wanted / CORRIDOR_SIZE))
    return float(CORRIDOR_SIZE * 2.0 ** (0.5 * steps))  # sizes that bisection can reach


def _width(line: TargetLine | None) -> float:
    sideways = LEAST_SIDEWAYS if line is None else line.sideways
    return 2.0 * (sideways + TIP_RADIUS)


def _nearest(
    box: Box, contours: Mapping[str, Contour], sizes: Mapping[str, float]
) -> tuple[float | None, str]:
    """Return a gap between contours, or contour and face, that is too small for cells; or None."""
    for name, contour in contours.items():
        if box.gap(contour) < sizes[name]:
            return box.gap(contour), "a contour and the box"
    for (one, first), (other, second) in combinations(contours.items(), 2):
        apart = np.minimum(first.distance(second.points).min(), second.distance(first.points).min())
        if apart <= 2.0 * min(sizes[one], sizes[other]):
            return float(apart), "contours"
    return None, ""


def _trial(draft: BoxDraft, contours: Mapping[str, Contour]) -> Scene:
    """Return a scene with the mesh of the draft; its materials and its needle are placeholders."""
    line, largest = draft.line, max(draft.sizes.values())
    named = region_names(contours, "")
    refine = Refinement(
        contour_size=largest,
        corridor_size=0.0 if line is None else CORRIDOR_SIZE,
        corridor_width=_width(line),
    )
    size = draft.box.high - draft.box.low
    return Scene(
        title="",
        axes=("y", "z"),
        mesh=BoxMesh(
            origin=tuple(draft.box.low.tolist()),
            size=tuple(size.tolist()),
            divisions=divisions(draft.box),
            interfaces=draft.interfaces,
            refine=refine,
        ),
        materials={"": Isotropic(youngs_modulus=1e4, poissons_ratio=0.45)},
        default_material="",
        regions={
            named[name]: Region(contour=contour, material="", contour_size=draft.sizes[name])
            for name, contour in contours.items()
        },
        supports={},
        needle=Needle(tip_radius=TIP_RADIUS, cutting_force=1.0, shaft_friction=1.0),
        motion=Motion(
            direction=(0.0, 1.0) if line is None else tuple(line.direction.tolist()),
            max_depth=1e-3 if line is None else line.max_depth,
        ),
        target=None if line is None else tuple(line.target.tolist()),
    )
