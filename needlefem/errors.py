"""Errors that a user can correct; each class has its exit status of the command line."""

from collections.abc import Iterable
from difflib import get_close_matches

LONGEST = 500
"""Largest number of characters of a part of a message, and of a name in comparisons."""
SHORT = 60
"""Largest number of characters of a value in a message."""


class NeedlefemError(Exception):
    """Base class of all errors that needlefem raises itself."""

    exit_status = 3


class CaseError(NeedlefemError):
    """A case, option or argument that is not valid.

    Parameters
    ----------
    key : str
        Dotted name of the key, as the user wrote it.
    problem : str
        Description of the error, with the value.
    remedy : str
        How to correct it.
    """

    exit_status = 2

    def __init__(self, key: str, problem: str, remedy: str) -> None:
        self.key, self.problem, self.remedy = key, problem, remedy
        super().__init__(one_line(f"{_cut(key)}: {_cut(problem)}; {_cut(remedy)}"))

    def __reduce__(self) -> tuple[type, tuple[str, str, str]]:
        """Support pickling, so that the error can be raised in another process."""
        return type(self), (self.key, self.problem, self.remedy)


class CheckFailedError(NeedlefemError):
    """A check failed, or a value differs from its expectation."""

    exit_status = 1


class SimulationError(NeedlefemError):
    """The simulation can't continue."""

    exit_status = 3


class OutputError(NeedlefemError):
    """A file can't be written; the message contains the path and the reason."""

    exit_status = 3


class NoRendererError(NeedlefemError):
    """No renderer is available; the message states what to install."""

    exit_status = 4


def one_line(text: str) -> str:
    """Return a text with escaped control characters, so that a message has one line."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def nearest(name: str, known: Iterable[str]) -> str:
    """Return a remedy with the most similar known word, or with all of them."""
    options = sorted(known)
    close = get_close_matches(name[:LONGEST], options, n=1, cutoff=0.5)
    if close:
        return f"did you mean '{close[0]}'?"
    return "known here: " + ", ".join(options)


def matching(name: str, known: Iterable[str]) -> str | None:
    """Return the known word that a name means in another spelling, or None.

    Hyphens and underscores are equal, and so are British and American spelling.
    """
    spelled = _spelling(name)
    return next((option for option in known if _spelling(option) == spelled), None)


def short(value: object) -> str:
    """Return a value as text of limited length in one line for a message."""
    try:
        text = repr(value)
    except (RecursionError, ValueError):  # too deeply nested, or a number with too many digits
        text = f"a {type(value).__name__}"
    return text if len(text) <= SHORT else f"{text[: SHORT - 4]} ..."


def _spelling(name: str) -> str:
    return name.strip().replace("_", "-").replace("ised", "ized").replace("isation", "ization")


def _cut(text: str) -> str:
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 4]} ..."
