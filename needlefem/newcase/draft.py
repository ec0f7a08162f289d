"""Names in a new case: any text names a region, and no two regions, materials or files meet."""

import csv
import dataclasses
import io
import re
import unicodedata
from collections.abc import Collection, Iterable, Mapping, Sequence

import numpy as np

from needlefem._arrays import Floats, Points, Vector
from needlefem._toml import comment, key_of, quoted
from needlefem.casefile.reader import OPEN
from needlefem.errors import CaseError
from needlefem.geometry.contour import Contour
from needlefem.geometry.image_frame import ImageFrame
from needlefem.materials.catalogue import library
from needlefem.mesh.generation import BACKGROUND
from needlefem.units import parse_quantity

NAMELESS = "no name"
LONGEST = 40
"""Characters of a file's name before its suffix."""
RESERVED = re.compile(r"con|prn|aux|nul|com\d|lpt\d|case", re.ASCII)
"""Names of files that Windows keeps for devices, and the case's own."""


def different(name: str, taken: Collection[str]) -> str:
    """Return a name, with the first number from 2 on behind it that makes it a new one."""
    chosen, number = name, 2
    while chosen in taken:
        chosen, number = f"{name} {number}", number + 1
    return chosen


def region_names(names: Iterable[str], background: str) -> dict[str, str]:
    """Return the names of a case's regions and of their materials by the names in a file.

    They differ from each other and from the background's, and none is ``"?"``, which marks what
    is open, nor the name of what lies outside all regions.
    """
    found: dict[str, str] = {}
    taken = {background, BACKGROUND, OPEN, ""}
    for name in names:
        plain = name.strip() or NAMELESS
        chosen = different(plain if plain != OPEN else f"({OPEN})", taken)
        taken.add(chosen)
        found[name] = chosen
    return found


def file_names(
    names: Iterable[str], suffix: str = ".csv", taken: Collection[str] = ()
) -> dict[str, str]:
    """Return names of files by names of regions.

    They are in small letters, digits and hyphens, so that every system can write them, and differ
    from each other, and from those that are `taken`, in more than capitals.
    """
    found: dict[str, str] = {}
    used = {name.casefold() for name in taken}
    for name in names:
        letters = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode().lower()
        plain = re.sub(r"[^a-z0-9]+", "-", letters)[:LONGEST].strip("-") or "region"
        if RESERVED.fullmatch(plain):
            plain = f"region-{plain}"
        number, chosen = 2, plain + suffix
        while chosen in used:
            chosen, number = f"{plain}-{number}{suffix}", number + 1
        used.add(chosen)
        found[name] = chosen
    return found


# A case in the making, and its text: what is not known stands as ``"?"``.


@dataclasses.dataclass(frozen=True, kw_only=True)
class Draft:
    """What a file says of a case. Values are TOML already; ``'"?"'`` where it says nothing.

    Parameters
    ----------
    title, file : str
    axes : tuple of str
    remarks : tuple of str
        Sentences on what was done with the file.
    mesh : str
        The [mesh] table and those below it.
    regions : mapping
        By name of a region in the file: the lines that say where it is.
    background : str
        Name of the material outside all regions.
    faces : tuple of str
        Names of the mesh's faces.
    direction, max_depth, target : str
    planning : str
        The [planning] table, where something is known for it.
    frame : ImageFrame, optional
    contours : mapping
        Contour files to write beside the case, by name.
    """

    title: str
    file: str
    axes: tuple[str, ...]
    remarks: tuple[str, ...]
    mesh: str
    regions: Mapping[str, str]
    background: str = "background"
    faces: tuple[str, ...]
    direction: str
    max_depth: str
    target: str
    planning: str = ""
    frame: ImageFrame | None = None
    contours: Mapping[str, Contour] = dataclasses.field(default_factory=dict)

    @property
    def names(self) -> dict[str, str]:
        """Names of the case's regions, and of their materials, by the names in the file."""
        return region_names(self.regions, self.background)


def millimetres(value: float, digits: int = 12) -> str:
    """Return a length as TOML."""
    return f'"{1e3 * value:.{digits}g} mm"'


def listed(values: Iterable[str]) -> str:
    """Return a TOML list."""
    return "[" + ", ".join(values) + "]"


def point_text(point: Floats | Sequence[float]) -> str:
    """Return a point as TOML."""
    return listed(millimetres(float(x)) for x in point)


def numbers_text(vector: Floats | Sequence[float]) -> str:
    """Return plain numbers as TOML."""
    return listed(repr(float(x)) for x in vector)


def csv_text(points: Points, axes: Sequence[str]) -> str:
    """Return a contour's corners, shape (n, 2), m, as the text of a contour file in mm."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(f"{axis} [mm]" for axis in axes)
    writer.writerows([f"{1e3 * x:.9g}" for x in point] for point in points)
    return text.getvalue()


def case_text(draft: Draft) -> str:
    """Return the draft as the text of a commented case."""
    parts = [_head(draft), draft.mesh]
    if draft.frame is not None:
        parts.append(frame_text(draft.frame))
    parts.append(f"[tissue]\nbackground = {quoted(draft.background)}")
    names = draft.names
    parts += [_material(name) for name in (draft.background, *names.values())]
    parts += [
        f"[regions.{key_of(names[name])}]\n{where}\nmaterial = {quoted(names[name])}"
        for name, where in draft.regions.items()
    ]
    parts += [_support(draft), _NEEDLE, _motion(draft)]
    parts += [draft.planning] if draft.planning else []
    return "\n\n".join(parts) + "\n"


def _head(draft: Draft) -> str:
    lines = [
        f"# Begun by needlefem new from {comment(draft.file)}.",
        f"# What it does not say is {quoted(OPEN)}: needlefem names each, and what belongs there.",
        *(f"# {comment(sentence)}" for sentence in draft.remarks),
        "",
        "schema_version = 1",
        f"title = {quoted(draft.title)}",
        f"axes = {listed(quoted(axis) for axis in draft.axes)}",
    ]
    return "\n".join(lines)


def frame_text(frame: ImageFrame) -> str:
    """Return the [frame] tables: the case's plane in the scanner's space."""
    lines = [
        "[frame]                        # the plane in the scanner; results are given there too",
        f"space = {quoted(frame.space)}",
        f"origin = {point_text(frame.origin)}",
        f"axes = {listed(numbers_text(axis) for axis in frame.axes)}",
    ]
    voxels = frame.voxels
    if voxels is not None:
        lines += [
            "",
            "[frame.voxels]",
            f"file = {quoted(voxels.file)}",
            f"origin = {point_text(voxels.origin)}",
            f"axes = {listed(numbers_text(axis) for axis in voxels.axes)}",
            f"spacing = {point_text(voxels.spacing)}",
            f"size = {listed(str(n) for n in voxels.size)}",
        ]
    return "\n".join(lines)


def _material(name: str) -> str:
    tissue = name.lower().replace(" ", "-")
    table = f"[materials.{key_of(name)}]"
    if tissue in library():
        return f"{table}\ntissue = {quoted(tissue)}             # of docs/tissues.md, by its name"
    return (
        f'{table}\nyoungs_modulus = "{OPEN}"           # such as "20 kPa"; or, instead of both,\n'
        f'poissons_ratio = "{OPEN}"           # tissue = "..." with a name of docs/tissues.md'
    )


def _support(draft: Draft) -> str:
    names = comment(", ".join(draft.faces)) or "none: the file names no edges"
    return f'[supports.held]\nfaces = "{OPEN}"                    # a list; there are {names}'


_NEEDLE = f"""[needle]
tip_radius = "1.27 mm"         # an assumption; mesh.refine.corridor_size is the same
cutting_force = "{OPEN}"            # per metre of thickness, such as "90 N/m"
shaft_friction = "{OPEN}"           # such as "25 kPa\""""


def planning_text(sideways: float) -> str:
    """Return the [planning] table: how far from the target's height needles are searched, m."""
    ends = listed(millimetres(x) for x in (-sideways, sideways))
    return f"[planning]\nheight_range = {ends}"


def _motion(draft: Draft) -> str:
    return (
        f"[motion]\ndirection = {draft.direction}\nmax_depth = {draft.max_depth}\n\n"
        f"[target]\npoint = {draft.target}"
    )


# What ``needlefem new`` is told beside the file.


FARTHEST = 100.0
"""Largest coordinate of a point, m."""
WIDEST = 1.0
"""Widest margin around the regions, m."""
LENGTHS = (1e-9, 1e9)
"""Range of the largest component of a direction: what is beyond is no direction but a mistake."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class CaseRequest:
    """The needle and the tissue around, as texts; empty where nothing is said.

    Parameters
    ----------
    target, entry : str
        Points, such as ``"12, -3.5, 40 mm"``; `target` may name a segment: its centre.
    direction, across : str
        Directions, such as ``"0, 0.2, 1"``.
    space : str
        Of the scanner's coordinates: ``LPS`` or ``RAS``.
    segments : str
        Names of those to take, separated by commas; all when empty.
    margin : str
        Tissue around the regions, a length.
    unit : str
        Length of one unit of the coordinates in a mesh file, or in contours without units.
    """

    target: str = ""
    entry: str = ""
    direction: str = ""
    across: str = ""
    space: str = "LPS"
    segments: str = ""
    margin: str = "15 mm"
    unit: str = ""

    @property
    def around(self) -> float:
        """The margin, m."""
        found = parse_quantity(self.margin, "length", "--margin")
        if not 0.0 < found <= WIDEST:
            remedy = f"give a length above 0 and up to {WIDEST:g} m"
            raise CaseError("--margin", f"'{self.margin}' is no margin", remedy)
        return found


def point_of(text: str, dim: int, key: str) -> Vector:
    """Return a point from a text such as ``"12, -3.5, 40 mm"``, shape (dim,), m.

    Raises
    ------
    CaseError
        Not as many numbers as axes, or no unit of length.
    """
    *first, last = text.split(",")
    _, _, unit = last.strip().partition(" ")
    example = ", ".join("12.5" for _ in range(dim))
    if len(first) + 1 != dim or not unit:
        problem = f"'{text}' is no point" if unit else f"'{text}' has no unit"
        raise CaseError(key, problem, f"write {dim} numbers and a unit: '{example} mm'")
    texts = [*(f"{number.strip()} {unit}" for number in first), last.strip()]
    found = np.array([parse_quantity(one, "length", key) for one in texts])
    if not np.all(np.abs(found) <= FARTHEST):
        remedy = f"give coordinates of at most {FARTHEST:g} m"
        raise CaseError(key, f"'{text}' is no point of a body", remedy)
    return found


def direction_of(text: str, dim: int, key: str) -> Vector:
    """Return a unit vector from a text such as ``"0, 0.2, 1"``, shape (dim,)."""
    try:
        found = np.array([float(part) for part in text.split(",")])
    except ValueError:
        found = np.empty(0)
    largest = float(np.abs(found).max(initial=0.0))
    if len(found) != dim or not LENGTHS[0] <= largest <= LENGTHS[1]:
        remedy = f"write {dim} plain numbers, not all zero, separated by commas"
        raise CaseError(key, f"'{text}' is no direction", remedy)
    unit: Vector = found / np.linalg.norm(found)
    return unit
