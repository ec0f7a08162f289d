"""Case files of schema version 1, rewritten with the words of version 2; comments are kept.

The text is changed word by word. Then both texts are parsed: the new one has to say what the old
one says in the words of version 2, or nothing is written.
"""

import re
import tomllib
from collections.abc import Sequence
from pathlib import Path

from needlefem._inputfile import read_text
from needlefem._toml import key_parts, quoted
from needlefem.casefile.load import SCHEMA_VERSIONS, parsed, spelled
from needlefem.errors import CaseError
from needlefem.scene.varying import SPELLINGS
from needlefem.scene.version_1 import (
    ANY,
    CASE_KEYS,
    OldWord,
    renewed_case,
    renewed_path,
    renewed_value,
)

_NAME = r"""(?:[A-Za-z0-9_-]+|"[^"\n]*"|'[^'\n]*')"""
_KEY = rf"{_NAME}(?:\s*\.\s*{_NAME})*"
_HEADER = re.compile(
    rf"(?P<before>\s*(?P<list>\[?)\[\s*)(?P<key>{_KEY})(?P<after>\s*\].*)", re.DOTALL
)
_ENTRY = re.compile(rf"(?P<before>\s*)(?P<key>{_KEY})(?P<after>\s*=.*)", re.DOTALL)
_TOKENS = re.compile(r"""("(?:[^"\\\n]|\\.)*"|'[^'\n]*'|#[^\n]*)|([A-Za-z0-9_-]+)(?=\s*=)""")


def upgrade_case(path: Path) -> tuple[str, tuple[OldWord, ...]]:
    """Return the text of a case file in the words of version 2, and the words that it replaces.

    Raises
    ------
    CaseError
        The file can't be read, is no TOML, or has words where they can't be replaced.
    """
    text = read_text(path, "case", remedy="give the path of a case.toml")
    old = spelled(parsed(text, str(path)))
    found: list[OldWord] = []
    wanted = renewed_case(old, found)
    if wanted.get("schema_version") == 1:
        wanted["schema_version"] = SCHEMA_VERSIONS[-1]
    new = _rewritten(text)
    if parsed(new, str(path)) != wanted:
        words = "; ".join(dict.fromkeys(map(str, found)))
        remedy = f"rewrite it by hand: {words}"
        raise CaseError("case", f"'{path}' has words of version 1 in nested tables", remedy)
    return new, tuple(dict.fromkeys(found))


def _rewritten(text: str) -> str:
    """Return the text with the keys and values of version 2."""
    table: tuple[str, ...] = ()
    lines = re.findall(r"[^\n]*\n|[^\n]+\Z", text)
    found, start = [], 0
    while start < len(lines):
        end = start + 1
        line = lines[start]
        if (header := _HEADER.fullmatch(line)) is not None:
            parts = _renamed((), key_parts(header["key"]))
            table = (*parts, ANY) if header["list"] else tuple(parts)
            line = header["before"] + _replaced(header["key"], parts) + header["after"]
        elif _ENTRY.fullmatch(line) is not None:
            while not _complete(lines[start:end]) and end < len(lines):
                end += 1
            line = _entry("".join(lines[start:end]), table)
        found.append(line)
        start = end
    return "".join(found)


def _complete(lines: Sequence[str]) -> bool:
    """Say whether lines are a whole assignment."""
    try:
        tomllib.loads("".join(lines))
    except tomllib.TOMLDecodeError:
        return False
    return True


def _entry(text: str, table: tuple[str, ...]) -> str:
    """Return an assignment with the words of version 2."""
    entry = _ENTRY.fullmatch(text)
    assert entry is not None
    old = key_parts(entry["key"])
    parts = _renamed(table, old)
    path, after = (*table, *parts), entry["after"]
    if path == ("schema_version",):
        after = re.sub(r"=(\s*)1\b", rf"=\g<1>{SCHEMA_VERSIONS[-1]}", after, count=1)
    value = tomllib.loads(f"value {after.lstrip()}")["value"]
    new = renewed_value(value, [], tuple("0" if part == ANY else part for part in path))
    if isinstance(new, str) and new != value:
        text_value = r"=(\s*)(\"[^\"\n]*\"|'[^'\n]*')"
        after = re.sub(text_value, lambda m: f"={m[1]}{quoted(new)}", after, count=1)
    elif isinstance(value, dict | list):
        after = _TOKENS.sub(lambda m: m[1] or _inner(path, m[2]), after)
    return entry["before"] + _replaced(entry["key"], parts) + after


def _inner(path: tuple[str, ...], name: str) -> str:
    """Return the name of a key in an inline table that stands at a path."""
    return CASE_KEYS.get((*path, name)) or CASE_KEYS.get((*path, ANY, name)) or name


def _renamed(table: tuple[str, ...], parts: Sequence[str]) -> list[str]:
    """Return the names of a key in a table, whose own names are those of version 2."""
    path = [*table, *parts]
    return renewed_path([SPELLINGS.get(path[0], path[0]), *path[1:]], [])[len(table) :]


def _replaced(key: str, parts: Sequence[str]) -> str:
    """Return the text of a key with other names, or as it is written where they are the same."""
    return key if key_parts(key) == list(parts) else ".".join(parts)
