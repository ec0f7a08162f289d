"""Drafts of cases: their names, their text, and the options of ``needlefem new``.

Names of regions, materials and files are unique in a case. A value that is not known is ``"?"``.
"""

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
"""Allowed characters of a file name before its suffix."""
RESERVED = re.compile(r"con|prn|aux|nul|com\d|lpt\d|case", re.ASCII)
"""File names that Windows reserves for devices, and the file name of the case."""


def different(name: str, taken: Collection[str]) -> str:
    """Return the name, with the smallest number from 2 on appended that makes it unique."""
    chosen, number = name, 2
    while chosen in taken:
        chosen, number = f"{name} {number}", number + 1
    return chosen


def region_names(names: Iterable[str], background: str) -> dict[str, str]:
    """Return the names of regions and of their materials in a case, by their names in a file.

    They differ from each other and from the background's name. None is ``"?"``, which marks open
    values, or the name of the space outside of all regions.
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

    They consist of small letters, digits and hyphens, which all systems allow. They differ from
    each other and from the names in `taken` also without regard to upper and lower case.
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


# A draft of a case and its text.


@dataclasses.dataclass(frozen=True, kw_only=True)
class Draft:
    """Values of a new case as TOML text; unknown values are ``'"?"'``.

    Parameters
    ----------
    title, file : str
    axes : tuple of str
    remarks : tuple of str
        Sentences on the processing of the file.
    mesh : str
        The [mesh] table and its subtables.
    regions : mapping
        Lines that define the shape of each region, by its name in the file.
    background : str
        Name of the material outside of all regions.
    faces : tuple of str
        Names of the faces of the mesh.
    direction, max_depth, target : str
    planning : str
        The [planning] table; empty if nothing is known for it.
        The [planning] table, where something is known for it.
    frame : ImageFrame, optional
    contours : mapping
        Contour files by name, to be written into the folder of the case.
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
        """Names of regions and materials in the case, by the names in the file."""
        return region_names(self.regions, self.background)


def millimetres(value: float, digits: int = 12) -> str:
    """Return a length (m) as TOML text in millimetres."""
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
    """Return the vertices of a contour, shape (n, 2), m, as text of a contour file in mm."""
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
    parts.append(f"[tissue]\ndefault_material = {quoted(draft.background)}")
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
        f"# Created by needlefem new from {comment(draft.file)}.",
        f"# Unknown values are {quoted(OPEN)}; needlefem lists them and the values they can have.",
        *(f"# {comment(sentence)}" for sentence in draft.remarks),
        "",
        "schema_version = 2",
        f"title = {quoted(draft.title)}",
        f"axes = {listed(quoted(axis) for axis in draft.axes)}",
    ]
    return "\n".join(lines)


def frame_text(frame: ImageFrame) -> str:
    """Return the [frame] tables: the case's plane in the scanner's space."""
    lines = [
        "[frame]                        # position of the plane in the scanner's coordinates",
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
        return f"{table}\ntissue = {quoted(tissue)}             # a name of docs/tissues.md"
    return (
        f'{table}\nyoungs_modulus = "{OPEN}"           # such as "20 kPa"; or, instead of both,\n'
        f'poissons_ratio = "{OPEN}"           # tissue = "..." with a name of docs/tissues.md'
    )


def _support(draft: Draft) -> str:
    names = comment(", ".join(draft.faces)) or "none: the file names no edges"
    return f'[supports.held]\nfaces = "{OPEN}"                    # a list of: {names}'


_NEEDLE = f"""[needle]
tip_radius = "1.27 mm"         # an assumption; the value of mesh.refine.corridor_size is equal
cutting_force = "{OPEN}"            # per metre of thickness, such as "90 N/m"
shaft_friction = "{OPEN}"           # such as "25 kPa\""""


def planning_text(sideways: float) -> str:
    """Return the [planning] table for lateral offsets up to a distance from the target, m."""
    ends = listed(millimetres(x) for x in (-sideways, sideways))
    return f"[planning]\noffset_range = {ends}"


def _motion(draft: Draft) -> str:
    return (
        f"[motion]\ndirection = {draft.direction}\nmax_depth = {draft.max_depth}\n\n"
        f"[target]\npoint = {draft.target}"
    )


# Options of ``needlefem new`` besides the file.


FARTHEST = 100.0
"""Largest allowed coordinate of a point, m."""
WIDEST = 1.0
"""Largest allowed margin around the regions, m."""
LENGTHS = (1e-9, 1e9)
"""Allowed range of the largest component of a direction."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class CaseRequest:
    """Options on the needle and the surrounding tissue as texts; empty if omitted.

    Parameters
    ----------
    target, entry : str
        Points, such as ``"12, -3.5, 40 mm"``; the `target` may also be the name of a segment,
        which stands for its centre.
    direction, across : str
        Directions, such as ``"0, 0.2, 1"``.
    space : str
        Coordinate system of the scanner: ``LPS`` or ``RAS``.
    segments : str
        Names of the segments to be used, separated by commas; all by default.
    margin : str
        Width of the tissue around the regions, a length.
    unit : str
        Unit of the coordinates in a mesh file, or in contours without units, as a length.
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
        """The margin as a number, m."""
        found = parse_quantity(self.margin, "length", "--margin")
        if not 0.0 < found <= WIDEST:
            remedy = f"give a length above 0 and up to {WIDEST:g} m"
            raise CaseError("--margin", f"'{self.margin}' is not a margin", remedy)
        return found


def point_of(text: str, dim: int, key: str) -> Vector:
    """Return a point from a text such as ``"12, -3.5, 40 mm"``, shape (dim,), m.

    Raises
    ------
    CaseError
        The number of coordinates is wrong, or the unit of length is missing.
    """
    *first, last = text.split(",")
    _, _, unit = last.strip().partition(" ")
    example = ", ".join("12.5" for _ in range(dim))
    if len(first) + 1 != dim or not unit:
        problem = f"'{text}' is not a point" if unit else f"'{text}' has no unit"
        raise CaseError(key, problem, f"write {dim} numbers and a unit: '{example} mm'")
    texts = [*(f"{number.strip()} {unit}" for number in first), last.strip()]
    found = np.array([parse_quantity(one, "length", key) for one in texts])
    if not np.all(np.abs(found) <= FARTHEST):
        remedy = f"give coordinates of at most {FARTHEST:g} m"
        raise CaseError(key, f"'{text}' is too far from the origin", remedy)
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
        raise CaseError(key, f"'{text}' is not a direction", remedy)
    unit: Vector = found / np.linalg.norm(found)
    return unit
