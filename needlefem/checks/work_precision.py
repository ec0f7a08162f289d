"""Work-precision comparisons: one problem, several methods, error against seconds."""

import dataclasses
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Any, TypeVar

from needlefem.elements import CATALOGUE, ElementType
from needlefem.scene.resolve import cheapest

T = TypeVar("T")
ELEMENTS, INTEGRATORS = "elements", "integrators"
"""Subjects of the comparisons."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class WorkPrecision:
    """A problem that is solved by several methods.

    Parameters
    ----------
    title, quantity : str
        Such as "thick cylinder, nu 0.3" and "displacement, L2".
    about : str
        Kind of the methods: `ELEMENTS` or `INTEGRATORS`.
    entrants : mapping
        Functions by name that solve a level; a higher level is finer. They are timed.
    levels : sequence of int
    measure : callable
        Returns unknowns and relative error of the result of an entrant.
    target : float
        Typical required error.
    group : str
        Kind of the problem, on which the default of the package depends.
    defaults : tuple of str
        Entrants that are defaults of the package, each from its `rivals`.
    rivals : sequence of sequences of str
        Entrants to choose among (elements on the same cells); all when empty.
    """

    title: str
    quantity: str
    about: str
    entrants: Mapping[str, Callable[[int], object]]
    levels: Sequence[int]
    measure: Callable[[Any], tuple[int, float]]
    target: float = 1e-3
    group: str = ""
    defaults: tuple[str, ...] = ()
    rivals: Sequence[Sequence[str]] = ()


WAVES = ("waves", ("generalised-alpha 0.8", "central diff., lumped"))
"""Group of problems with waves, and its default integrators: an implicit and an explicit one."""


def implicit_and_explicit(entrants: Iterable[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the names of integrators by whether they have a limit to the step."""
    names = tuple(entrants)
    explicit = tuple(name for name in names if name.startswith("central diff."))
    return tuple(name for name in names if name not in explicit), explicit


def same_cells() -> list[list[str]]:
    """Return the elements of the catalogue by the shape of their cells."""
    shapes = dict.fromkeys(row.cell for row in CATALOGUE.values())
    return [[name for name, row in CATALOGUE.items() if row.cell == shape] for shape in shapes]


def elements_race(
    *,
    title: str,
    quantity: str,
    ratio: float,
    solve: Callable[[ElementType, int], T],
    measure: Callable[[T], tuple[int, float]],
    levels: Sequence[int],
    target: float = 1e-3,
) -> WorkPrecision:
    """Return a comparison of all elements at a Poisson's ratio (0 in plane stress)."""
    defaults = cheapest(ratio)
    return WorkPrecision(
        title=title,
        quantity=quantity,
        about=ELEMENTS,
        entrants={
            name: lambda level, row=row: solve(row, level)  # type: ignore[misc]
            for name, row in CATALOGUE.items()
        },
        levels=levels,
        measure=measure,
        target=target,
        group="default " + ", ".join(defaults),
        defaults=defaults,
        rivals=same_cells(),
    )


@dataclasses.dataclass(frozen=True)
class Point:
    """Error and time of an entrant on a level."""

    entrant: str
    level: int
    unknowns: int
    seconds: float
    error: float


def front(points: Sequence[Point]) -> set[Point]:
    """Return the points for which no other has both less time and a smaller error."""
    best: set[Point] = set()
    least = float("inf")
    for point in sorted(points, key=lambda p: (p.seconds, p.error)):
        if point.error < least:
            best.add(point)
            least = point.error
    return best


def seconds_to(target: float, points: Sequence[Point]) -> float:
    """Return the seconds in which an entrant reaches an error; infinite if it does not.

    Between two levels a power law is interpolated. If the coarsest level is already more accurate,
    its time is returned.
    """
    ordered = sorted(points, key=lambda p: p.level)
    if ordered and ordered[0].error <= target:
        return ordered[0].seconds
    for one, two in pairwise(ordered):
        if one.error > target >= two.error:
            floor = max(two.error, 1e-300)
            share = math.log(one.error / target) / math.log(one.error / floor)
            return one.seconds * float((two.seconds / one.seconds) ** share)
    return math.inf
