"""Names in a new case: any text names a region, and no two regions, materials or files meet."""

import re
import unicodedata
from collections.abc import Collection, Iterable

from needlefem.casefile.openkeys import OPEN
from needlefem.mesh.generation import BACKGROUND

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
