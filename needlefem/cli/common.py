"""What the commands share."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from needlefem.insertion.result import Status
from needlefem.insertion.simulation import Watch
from needlefem.insertion.state import State
from needlefem.output.files import to_json

if TYPE_CHECKING:
    from needlefem.planning.result import Plan

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


def release_lines(plan: "Plan") -> list[str]:
    """Return a line for every release of a plan: where, how deep behind the skin, how near.

    The coordinates of a release and its depth differ where the origin is not on the skin.
    """
    best, level = plan.insertion.axis, plan.level.axis
    releases = {
        "release at": (plan.best, best),
        "unplanned": (plan.unplanned, level),
        "depth only": (plan.depth_only, level),
    }
    found = []
    for name, (release, axis) in releases.items():
        if release is not None:
            found.append(
                f"  {name:11s} {centimetres(release.release_point)}, "
                f"depth {100 * float(axis.along(release.release_point)):.3f} cm -> "
                f"{centimetres(release.placed_at)}, error {100 * release.placement_error:.2g} cm"
            )
    if plan.best is not None:
        found.insert(0, f"  entry at    {centimetres(best.entry)}; depths count from there")
    return found
