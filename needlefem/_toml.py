"""Text of TOML files; all strings and keys that are written are made here and can be read back."""

import re
import tomllib
from collections.abc import Iterable, Mapping

BARE = re.compile(r"[A-Za-z0-9_-]+", re.ASCII)
ESCAPES = {"\\": "\\\\", '"': '\\"', "\n": "\\n", "\t": "\\t", "\r": "\\r"}
ASSIGNED = re.compile(r"""((?:[^="']|"(?:[^"\\]|\\.)*"|'[^']*')*)=(.*)""", re.DOTALL)
"""A key, which may contain an equals sign in quotes, and its assigned value."""


def quoted(text: str) -> str:
    """Return a text as a TOML string on one line.

    An unpaired surrogate (in a file name that is not UTF-8) becomes U+FFFD.
    """
    return '"' + "".join(_escaped(character) for character in text) + '"'


def _escaped(character: str) -> str:
    code = ord(character)
    if character in ESCAPES:
        return ESCAPES[character]
    if code < 0x20 or 0x7F <= code < 0xA0 or code in (0x2028, 0x2029):
        return f"\\u{code:04X}"
    return "\ufffd" if 0xD800 <= code < 0xE000 else character


def key_of(name: str) -> str:
    """Return a name as a TOML key, without quotes if possible."""
    return name if BARE.fullmatch(name) else quoted(name)


def dotted_key(parts: Iterable[str]) -> str:
    """Return names of nested tables as one dotted key for a case or ``--set``."""
    return ".".join(key_of(part) for part in parts)


def key_parts(key: str) -> list[str]:
    """Return the names in a dotted key, whose parts may be quoted as in TOML.

    A key that is not valid TOML, such as one with a space, is split at its dots.
    """
    try:
        node: object = tomllib.loads(f"{key} = 0") if "\n" not in key else 0
    except tomllib.TOMLDecodeError:
        node = 0
    parts = []
    while isinstance(node, Mapping) and len(node) == 1:
        ((name, node),) = node.items()
        parts.append(name)
    return parts if parts and node == 0 else key.split(".")


def assignment(text: str) -> tuple[str, str] | None:
    """Return key and value of ``key=value``, or None without an equals sign outside of quotes."""
    found = ASSIGNED.fullmatch(text)
    if found is not None:
        return found[1].strip(), found[2].strip()
    key, equals, value = text.partition("=")  # an unclosed quote is a part of the name
    return (key.strip(), value.strip()) if equals else None


def comment(text: str) -> str:
    """Return a text for a comment or message: on one line, without invisible characters."""
    return "".join(
        character if character.isprintable() else character.encode("unicode_escape").decode()
        for character in text
    )


def brief(text: str, most: int = 60) -> str:
    """Return a name for a sentence: printable, and not longer than `most`."""
    return comment(text if len(text) <= most else f"{text[:most]}...")
