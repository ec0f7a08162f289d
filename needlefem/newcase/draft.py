"""A case in the making, and its text: what is not known stands as ``"?"``."""

import csv
import dataclasses
import io
from collections.abc import Iterable, Mapping, Sequence

from needlefem._arrays import Floats, Points
from needlefem._toml import comment, key_of, quoted
from needlefem.casefile.openkeys import OPEN
from needlefem.geometry.contour import Contour
from needlefem.geometry.image_frame import ImageFrame
from needlefem.materials.catalogue import library
from needlefem.newcase.names import region_names


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
