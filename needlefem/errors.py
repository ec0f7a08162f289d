"""Errors that a user can act on; each knows the exit status of the command line."""

from collections.abc import Iterable
from difflib import get_close_matches

LONGEST = 500
"""Most characters of a part of a message, and of a name that is compared with others."""
SHORT = 60
"""Most characters of a value in a message."""


class NeedlefemError(Exception):
    """Base of all errors that needlefem raises on purpose."""

    exit_status = 3


class CaseError(NeedlefemError):
    """A case, option or argument that can't be used.

    Parameters
    ----------
    key : str
        Dotted name of what is wrong, as the user wrote it.
    problem : str
        What is wrong with the value, naming the value.
    remedy : str
        What would do.
    """

    exit_status = 2

    def __init__(self, key: str, problem: str, remedy: str) -> None:
        self.key, self.problem, self.remedy = key, problem, remedy
        super().__init__(one_line(f"{_cut(key)}: {_cut(problem)}; {_cut(remedy)}"))

    def __reduce__(self) -> tuple[type, tuple[str, str, str]]:
        """Let the error travel between processes."""
        return type(self), (self.key, self.problem, self.remedy)


class CheckFailedError(NeedlefemError):
    """A check or an expectation did not hold."""

    exit_status = 1


class SimulationError(NeedlefemError):
    """The simulation could not go on."""

    exit_status = 3


class OutputError(NeedlefemError):
    """The system does not let a file be written; the message names the path and the reason."""

    exit_status = 3


class NoRendererError(NeedlefemError):
    """No picture can be drawn here; the message names what to install."""

    exit_status = 4


def one_line(text: str) -> str:
    """Return a text with its control characters escaped, so that a message is one line."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def nearest(name: str, known: Iterable[str]) -> str:
    """Return a remedy that names the nearest known word, or lists them all."""
    options = sorted(known)
    close = get_close_matches(name[:LONGEST], options, n=1, cutoff=0.5)
    if close:
        return f"did you mean '{close[0]}'?"
    return "known here: " + ", ".join(options)


def matching(name: str, known: Iterable[str]) -> str | None:
    """Return the known word that is meant by a name in another spelling, or None.

    Hyphens and underscores are the same, and so are British and American spelling.
    """
    spelled = _spelling(name)
    return next((option for option in known if _spelling(option) == spelled), None)


def short(value: object) -> str:
    """Return a value as text for a message, in one line and not too long."""
    try:
        text = repr(value)
    except (RecursionError, ValueError):  # nested too deep, or a number of too many digits
        text = f"a {type(value).__name__}"
    return text if len(text) <= SHORT else f"{text[: SHORT - 4]} ..."


def _spelling(name: str) -> str:
    return name.strip().replace("_", "-").replace("ised", "ized").replace("isation", "ization")


def _cut(text: str) -> str:
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 4]} ..."
