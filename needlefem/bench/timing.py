"""Measurement of processor time on a machine with other load: rounds in turn, medians, range."""

import resource
import statistics
import time
from collections.abc import Callable, Mapping

from needlefem.plotting.charts import Bar, bars

LONG = 1.0
"""Seconds after which a task is not repeated any more."""
Timed = Mapping[str, Callable[[], object]]
"""Tasks by their names."""


def in_turn(
    tasks: Timed, rounds: int, clock: Callable[[], float] = time.process_time
) -> dict[str, list[float]]:
    """Run all tasks in rounds and return their seconds; a first round is not counted.

    The clock measures processor time, which other load influences least, unless another is given.
    """
    seconds: dict[str, list[float]] = {name: [] for name in tasks}
    for number in range(rounds + 1):
        for name, task in tasks.items():
            start = clock()
            task()
            if number:
                seconds[name].append(clock() - start)
    return seconds


def processor_seconds(task: Callable[[], object], rounds: int) -> list[float]:
    """Run a task several times after an uncounted first time; return its processor times."""
    seconds: list[float] = []
    for _ in range(rounds + 1):
        start = time.process_time()
        task()
        seconds.append(time.process_time() - start)
    return seconds[1:]


def children_seconds(task: Callable[[], object], rounds: int) -> list[float]:
    """Run a task several times; return the processor times of its child processes."""
    seconds: list[float] = []
    for _ in range(rounds):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        task()
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        seconds.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return seconds


def median(values: list[float]) -> float:
    """Return the median."""
    return statistics.median(values)


def spread_bars(title: str, label: str, seconds: Mapping[str, list[float]], unit: float) -> str:
    """Return a chart of medians with smallest and largest values, in units of `unit` seconds."""
    return bars(
        title,
        label,
        [
            Bar(name, median(spent) / unit, min(spent) / unit, max(spent) / unit)
            for name, spent in seconds.items()
        ],
    )


def seconds_of(task: Callable[[], object], rounds: int) -> tuple[list[float], object]:
    """Run a task several times, fewer if it is slow; return its seconds and its result."""
    seconds: list[float] = []
    while len(seconds) < rounds and (len(seconds) < 1 or sum(seconds) < LONG):
        start = time.perf_counter()
        answer = task()
        seconds.append(time.perf_counter() - start)
    return seconds, answer
