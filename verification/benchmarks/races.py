"""Error against seconds in the work-precision comparisons of the reference problems."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from needlefem.bench import median, seconds_of
from needlefem.checks import Point, WorkPrecision, front, load_problems, seconds_to
from needlefem.plotting import ChartLine, loglog
from needlefem.studies import Table

PROBLEMS = "verification"
ENOUGH = 1.2
"""Seconds above which an entrant does not solve finer levels."""
ROUNDS = 5
FACTOR = 1.25
"""Factor in time by which another entrant must be faster than a default to be better."""

Times = Mapping[str, float]
"""Seconds to the target error, by entrant."""


def table_of(about: str, folder: str) -> Table:
    """Run the races about elements or integrators; return what all took to reach the targets."""
    races = _races(about, folder)
    points = [_run(race) for race in races]
    names = list(dict.fromkeys(name for race in races for name in race.entrants))
    times = [_times(race, found) for race, found in zip(races, points, strict=True)]
    rows: list[list[object]] = []
    for race, found, seconds in zip(races, points, times, strict=True):
        best = {p.entrant for p in front(found)}
        cells = [_cell(name, seconds, race, name in best) for name in names]
        rows.append([race.title, f"{race.target:g}", *cells])
    beaten: list[str] = []
    for group in dict.fromkeys(race.group for race in races if race.defaults):
        same = [(r, t) for r, t in zip(races, times, strict=True) if r.group == group]
        means = {name: _mean([t.get(name, math.inf) for _, t in same]) for name in names}
        rows.append([f"mean, {group}", "", *(_cell(n, means, same[0][0], False) for n in names)])
        beaten += _beaten(same[0][0], means)
    verdict = "no default is beaten" if not beaten else "; ".join(beaten)
    return Table(
        title=f"milliseconds to an error, {about}",
        columns=("problem", "error", *names),
        rows=rows,
        passed=not beaten,
        note="*: on the front, where no other is both faster and more accurate; >: the package's "
        "choice; -: not reached. Means are geometric, over problems for which the choice is the "
        f"same. Beyond a factor {FACTOR:g} {verdict}",
        summary={
            "points": {
                race.title: [vars(p) | {"front": p in front(found)} for p in found]
                for race, found in zip(races, points, strict=True)
            }
        },
        charts={race.title: _chart(race, p) for race, p in zip(races, points, strict=True)},
    )


def _races(about: str, folder: str) -> list[WorkPrecision]:
    problems = load_problems(Path(folder or PROBLEMS))
    return [race for problem in problems for race in problem.races if race.about == about]


def _run(race: WorkPrecision) -> list[Point]:
    """Return the points of all entrants by level, up to the time limit."""
    points: list[Point] = []
    running = list(race.entrants)
    for level in race.levels:
        for name in list(running):
            entrant = race.entrants[name]
            spent, solved = seconds_of(lambda go=entrant, at=level: go(at), ROUNDS)  # type: ignore[misc]
            unknowns, error = race.measure(solved)
            points.append(Point(name, level, unknowns, median(spent), error))
            if points[-1].seconds > ENOUGH:
                running.remove(name)
    return points


def _times(race: WorkPrecision, points: Sequence[Point]) -> Times:
    return {
        name: seconds_to(race.target, [p for p in points if p.entrant == name])
        for name in race.entrants
    }


def _cell(name: str, seconds: Times, race: WorkPrecision, best: bool) -> str:
    value = seconds.get(name, math.inf)
    number = f"{1e3 * value:.3g}" if math.isfinite(value) else "-"
    return f"{'>' if name in race.defaults else ''}{number}{'*' if best else ''}"


def _mean(values: Sequence[float]) -> float:
    if not all(math.isfinite(value) for value in values):
        return math.inf
    return math.exp(sum(math.log(value) for value in values) / len(values))


def _beaten(race: WorkPrecision, means: Times) -> list[str]:
    """Return sentences about defaults that are slower than one of their rivals."""
    found = []
    for name in race.defaults:
        rivals = next((r for r in race.rivals if name in r), list(means))
        fastest = min(rivals, key=lambda rival: means[rival])
        if means[fastest] * FACTOR < means[name]:
            found.append(f"{fastest} beats {name} ({race.group})")
    return found


def _chart(race: WorkPrecision, points: Sequence[Point]) -> str:
    """Return a chart of error against seconds; points of the front are highlighted."""
    lines, best = [], front(points)
    for name in race.entrants:
        own = [p for p in points if p.entrant == name and p.error > 0.0]
        ringed = [place for place, p in enumerate(own) if p in best]
        if own:
            lines.append(ChartLine(name, [p.seconds for p in own], [p.error for p in own], ringed))
    title = f"{race.title}: {race.quantity} (ringed: beaten by none)"
    return loglog(title, "seconds", "relative error", lines)
