"""Output of the commands to a console, a file, or a pipe that may be closed."""

import os
import sys

from needlefem.errors import OutputError, one_line


def say(text: str) -> None:
    """Print a text on standard output.

    What the console's encoding lacks is escaped. When whoever read has read enough, the rest is
    dropped and the command goes on.

    Raises
    ------
    OutputError
        Standard output is a full disk, or fails otherwise.
    """
    text += "\n"
    try:
        try:
            sys.stdout.write(text)
        except UnicodeEncodeError:
            encoding = sys.stdout.encoding
            sys.stdout.write(text.encode(encoding, "backslashreplace").decode(encoding))
    except OSError as error:
        _failed(error)


def flush() -> None:
    """Send out what was printed; see `say`."""
    try:
        sys.stdout.flush()
    except OSError as error:
        _failed(error)


def _failed(error: OSError) -> None:
    sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115, PTH123  (for good)
    if not isinstance(error, BrokenPipeError):
        reason = (error.strerror or str(error)).lower()
        raise OutputError(f"can't write to standard output: {reason}") from error


def tell(text: str) -> None:
    """Print a line on standard error; nothing happens where that is closed or full."""
    try:
        sys.stderr.write(one_line(text) + "\n")
        sys.stderr.flush()
    except OSError:
        sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115, PTH123


def open_missing() -> None:
    """Give a process that was started with closed streams some that take everything."""
    for name in ("stdin", "stdout", "stderr"):
        if getattr(sys, name) is None:
            mode = "r" if name == "stdin" else "w"
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115, PTH123
