"""Timing that survives a noisy machine: rounds in turn, medians, spread."""

import resource
import statistics
import time
from collections.abc import Callable, Mapping

from needlefem.plotting.verification_report import Bar, bars

LONG = 1.0
"""Seconds after which a task is not repeated."""
Timed = Mapping[str, Callable[[], object]]
"""Tasks to time, by their names."""


def in_turn(
    tasks: Timed, rounds: int, clock: Callable[[], float] = time.process_time
) -> dict[str, list[float]]:
    """Run all tasks round by round and return their seconds; one round before is not counted.

    Of processor time, which others on the machine disturb least, unless another clock is given.
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
    """Run a task some rounds, one before that is not counted, and return its processor time."""
    seconds: list[float] = []
    for _ in range(rounds + 1):
        start = time.process_time()
        task()
        seconds.append(time.process_time() - start)
    return seconds[1:]


def children_seconds(task: Callable[[], object], rounds: int) -> list[float]:
    """Run a task some rounds and return the processor time of the processes that it waits for."""
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
    """Return a chart of medians with the least and the most, in parts `unit` of a second."""
    return bars(
        title,
        label,
        [
            Bar(name, median(spent) / unit, min(spent) / unit, max(spent) / unit)
            for name, spent in seconds.items()
        ],
    )


def seconds_of(task: Callable[[], object], rounds: int) -> tuple[list[float], object]:
    """Run a task some rounds, fewer when it is long, and return its seconds and its answer."""
    seconds: list[float] = []
    while len(seconds) < rounds and (len(seconds) < 1 or sum(seconds) < LONG):
        start = time.perf_counter()
        answer = task()
        seconds.append(time.perf_counter() - start)
    return seconds, answer
