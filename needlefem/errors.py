"""Errors that a user can act on; each knows the exit status of the command line."""

from collections.abc import Iterable
from difflib import get_close_matches


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
        super().__init__(f"{key}: {problem}; {remedy}")


class CheckFailedError(NeedlefemError):
    """A check or an expectation did not hold."""

    exit_status = 1


class SimulationError(NeedlefemError):
    """The simulation could not go on."""

    exit_status = 3


class NoRendererError(NeedlefemError):
    """No picture can be drawn here; the message names what to install."""

    exit_status = 4


def nearest(name: str, known: Iterable[str]) -> str:
    """Return a remedy that names the nearest known word, or lists them all."""
    options = sorted(known)
    close = get_close_matches(name, options, n=1, cutoff=0.5)
    if close:
        return f"did you mean '{close[0]}'?"
    return "known here: " + ", ".join(options)
