"""What the commands share."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from needlefem.insertion.result import Status
from needlefem.insertion.simulation import Watch
from needlefem.insertion.state import State
from needlefem.output.files import to_json

GOOD = (Status.COMPLETED, Status.NOT_PUNCTURED)
"""How a motion ends that did what it was told."""


def say(text: str) -> None:
    """Print a text on standard output."""
    sys.stdout.write(text + "\n")


def say_json(record: Any) -> None:
    """Print a record as the one JSON object of a command."""
    say(to_json(record))


def warn(warnings: Any) -> None:
    """Print warnings on standard error, a line each."""
    for sentence in warnings:
        sys.stderr.write(f"warning: {sentence}\n")


@contextmanager
def progress(title: str) -> Iterator[Watch | None]:
    """Show depth and insertions on a terminal; nothing elsewhere."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console  # noqa: PLC0415  (only a terminal needs it)

    count = 0
    with Console(stderr=True).status(title) as status:

        def watch(state: State) -> None:
            nonlocal count
            count += state.depth == 0.0
            status.update(f"{title}: insertion {count}, depth {100 * state.depth:.2f} cm")

        yield watch


def centimetres(point: Any) -> str:
    """Return a point as text in cm."""
    return "(" + ", ".join(f"{100.0 * float(x):.3f}" for x in point) + ") cm"
