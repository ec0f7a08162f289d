"""Functions that several commands use."""

import argparse
from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING

from needlefem._progress import doing
from needlefem.cli import streams
from needlefem.errors import CaseError, NoRendererError
from needlefem.insertion.result import Status
from needlefem.insertion.simulation import Watch
from needlefem.insertion.state import State
from needlefem.io.result_folder import ResultFolder, result_folder, to_json

if TYPE_CHECKING:
    from needlefem.planning.result import Plan

GOOD = (Status.COMPLETED, Status.NOT_PUNCTURED)
"""How a motion ends that did what it was told."""


say = streams.say


def say_json(record: object) -> None:
    """Print a record as the one JSON object of a command."""
    say(to_json(record))


def warn(warnings: Iterable[str]) -> None:
    """Print warnings on standard error, a line each."""
    for sentence in warnings:
        streams.tell(f"warning: {sentence}")


def result_of(
    options: argparse.Namespace, command: str
) -> AbstractContextManager[ResultFolder | None]:
    """Return the locked folder of ``--out`` as a context, or one of None without that option.

    Raises
    ------
    CaseError
        The option is empty, or the folder holds another result.
    OutputError
        The folder can't be made or written.
    """
    return nullcontext(None) if options.out is None else result_folder(named(options.out), command)


def undrawn(draw: Callable[[], object]) -> NoRendererError | None:
    """Draw the pictures of a result that is written; return the error where nothing can draw."""
    try:
        draw()
    except NoRendererError as error:
        return error
    return None


def named(path: str, option: str = "--out") -> str:
    """Return the path that an option gives, or refuse an empty one."""
    if not path.strip():
        raise CaseError(option, f"'{path}' is not a valid name", "give a path")
    return path


def progress(title: str) -> Watch:
    """Return what tells depth and number of the insertions to `needlefem._progress`."""
    count = 0

    def watch(state: State) -> None:
        nonlocal count
        count += state.depth == 0.0
        doing(f"{title}, insertion {count}, depth {100 * state.depth:.2f} cm")

    return watch


def centimetres(point: Iterable[float]) -> str:
    """Return a point as text in cm."""
    return "(" + ", ".join(f"{100.0 * float(x):.3f}" for x in point) + ") cm"


def release_lines(plan: "Plan") -> list[str]:
    """Return a line for every release of a plan: where, how deep behind the skin, how near.

    The coordinates of a release and its depth differ where the origin is not on the skin. What
    the search left of the planned one is no error of its placement, and is said elsewhere.
    """
    best, level = plan.insertion.axis, plan.level.axis
    releases = {
        "release at": (plan.best, best),
        "unplanned": (plan.unplanned, level),
        "depth only": (plan.depth_only, level),
    }
    found = []
    for name, (release, axis) in releases.items():
        if release is None:
            why = plan.missing.get(name.replace(" ", "_"))
            found += [f"  {name:11s} not known: {why}"] if why else []
            continue
        error = f", error {100 * release.placement_error:.2g} cm"
        note = f" ({release.note})" if release.note else ""
        found.append(
            f"  {name:11s} {centimetres(release.release_point)}, "
            f"depth {100 * float(axis.axial_coordinate(release.release_point)):.3f} cm -> "
            f"{centimetres(release.placed_at)}"
            f"{'' if release is plan.best and not note else error}{note}"
        )
    if plan.best is not None:
        found.insert(0, f"  entry at    {centimetres(best.entry)}; depths are measured from there")
    return found


def search_line(plan: "Plan") -> str:
    """Return what the search took, and what it left of the target on the plan's own model."""
    left = ""
    if plan.best is not None:
        left = f", {100 * plan.best.placement_error:.2g} cm residual on this model"
    target = centimetres(plan.target)
    return f"  {plan.insertions} insertions ({plan.search}), target {target}{left}"
